"""Planned chains and ramps kept on disk, so that equal rows are planned once, ever."""

from __future__ import annotations

import hashlib
import io
import json
import logging
import os
import sqlite3
from collections.abc import Iterable, Sequence
from contextlib import closing
from dataclasses import fields
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from chainsim import Device, Outcome

from .operating_point import Margins, OperatingPoint, Tone
from .plan import Ramp, ToneRamp

__all__ = ["PlanCache", "cache_path"]

log = logging.getLogger(__name__)

# SQLite takes at least 999 values in one question.
ASKED_AT_ONCE = 500


def cache_path() -> Path:
    """The cache's file: below DOTWAVE_CACHE, else XDG_CACHE_HOME, else ~/.cache."""
    own = os.environ.get("DOTWAVE_CACHE")
    base = Path(own) if own else Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "dotwave"
    return base / "plans.sqlite"


@cache
def _code_digest() -> bytes:
    """Digest of the code that plans: what another version planned is not found."""
    digest = hashlib.sha256()
    here = Path(__file__).parent
    for folder in (here, here.parent / "chainsim"):
        for path in sorted(folder.rglob("*.py")):
            digest.update(path.read_bytes())
    return digest.digest()


class PlanCache:
    """States and ramps by everything they depend on: the device, the contrast, the targets and this code.

    A cache that cannot be read or written (read-only home, full disk, damaged file) is a cache that never
    finds anything: it says so once in the log, and planning goes on.
    """

    def __init__(self, device: Device, contrast_db: float, whole: PlanCache | None = None) -> None:
        """`whole` : of the device that `device` is one chain of; on its file, and with all it depends on."""
        profile = device.as_dict()
        for words in ("name", "description", "notes"):
            profile.pop(words)
        text = json.dumps([profile, contrast_db], sort_keys=True)
        self._scope = hashlib.sha256(_code_digest() + text.encode()).digest()
        self._connection: sqlite3.Connection | None = None
        self._damaged = False
        if whole is not None:
            self._scope = hashlib.sha256(whole._scope + self._scope).digest()
            self._connection = whole._connection
            return
        try:
            path = cache_path()
            path.parent.mkdir(parents=True, exist_ok=True)
            self._connection = sqlite3.connect(path, timeout=2.0, isolation_level=None, check_same_thread=False)
            self._connection.execute("PRAGMA synchronous = OFF")
            self._connection.execute("CREATE TABLE IF NOT EXISTS plans (key BLOB PRIMARY KEY, value BLOB)")
        except (OSError, sqlite3.Error) as error:
            self._give_up(error)

    def _give_up(self, error: Exception) -> None:
        log.warning("plan cache %s is not used: %s; delete it, or let DOTWAVE_CACHE name a folder", cache_path(), error)
        if self._connection is not None:
            self._connection.close()
        self._connection = None

    def _key(self, item: bytes) -> bytes:
        return hashlib.sha256(self._scope + item).digest()

    def find(self, items: Sequence[bytes]) -> list[Any]:
        """What is kept for each item, None where nothing is."""
        if self._connection is None:
            return [None] * len(items)
        try:
            keys, rows = [self._key(item) for item in items], dict[bytes, object]()
            for start in range(0, len(keys), ASKED_AT_ONCE):
                part = keys[start : start + ASKED_AT_ONCE]
                marks = ", ".join("?" * len(part))
                with closing(self._connection.cursor()) as cursor:
                    rows.update(cursor.execute(f"SELECT key, value FROM plans WHERE key IN ({marks})", part))
            return [self._sound(key, rows[key]) if key in rows else None for key in keys]
        except sqlite3.Error as error:
            self._give_up(error)
            return [None] * len(items)

    def _sound(self, key: bytes, raw: object) -> OperatingPoint | Ramp | None:
        """What a row holds; a damaged one is deleted, so that it is planned and kept again."""
        try:
            if not isinstance(raw, bytes):
                raise TypeError(f"a value of type {type(raw).__name__}")
            return _unpacked(raw)
        except (ValueError, LookupError, TypeError, AttributeError, EOFError) as error:
            if not self._damaged:
                log.warning("plan cache %s: damaged plans (%s) are made again", cache_path(), error)
            self._damaged = True
            if self._connection is not None:
                self._connection.execute("DELETE FROM plans WHERE key = ?", (key,))
            return None

    def keep(self, items: Iterable[tuple[bytes, OperatingPoint | Ramp]]) -> None:
        """Keep plans for later runs."""
        if self._connection is None:
            return
        try:
            self._connection.execute("BEGIN")
            self._connection.executemany(
                "INSERT OR REPLACE INTO plans VALUES (?, ?)",
                [(self._key(item), _packed(value)) for item, value in items],
            )
            self._connection.execute("COMMIT")
        except sqlite3.Error as error:
            self._give_up(error)


def _packed(value: OperatingPoint | Ramp) -> bytes:
    """Plain values as a line of JSON, then the arrays as NPY; no pickle."""
    arrays: list[np.ndarray[Any, Any]] = []
    plain = _plain(value, arrays)
    parts = [json.dumps(plain).encode(), b"\n"]
    for array in arrays:
        parts += [_header(array.dtype.str, array.shape), array.tobytes()]
    return b"".join(parts)


@lru_cache(maxsize=256)
def _header(descr: str, shape: tuple[int, ...]) -> bytes:
    """What an NPY file begins with; worked out once, since writing it takes longer than most arrays."""
    out = io.BytesIO()
    np.lib.format.write_array_header_1_0(out, {"descr": descr, "fortran_order": False, "shape": shape})
    return out.getvalue()


@lru_cache(maxsize=256)
def _empty(header: bytes) -> np.ndarray[Any, Any]:
    """An array of the kind that an NPY file's beginning speaks of."""
    source = io.BytesIO(header)
    if np.lib.format.read_magic(source) != (1, 0):
        raise ValueError("an array of another format")
    shape, fortran, dtype = np.lib.format.read_array_header_1_0(source)
    if fortran or dtype.kind not in "fcib":
        raise ValueError(f"an array of {dtype}")
    return np.empty(shape, dtype)


_PARTS = {kind.__name__: kind for kind in (OperatingPoint, Margins, Ramp, Tone, ToneRamp)}


def _plain(item: Any, arrays: list[np.ndarray[Any, Any]]) -> Any:
    if isinstance(item, np.ndarray):
        arrays.append(item)
        return {"array": len(arrays) - 1}
    if type(item) in _PARTS.values():
        return {"type": type(item).__name__} | {
            field.name: _plain(getattr(item, field.name), arrays) for field in fields(item)
        }
    if isinstance(item, complex):
        return {"complex": [item.real, item.imag]}
    return [_plain(one, arrays) for one in item] if isinstance(item, tuple) else item


def _unpacked(raw: bytes) -> OperatingPoint | Ramp:
    at = raw.index(b"\n") + 1
    plain = json.loads(raw[:at])
    # Arrays lie in the order of their numbers; bytes 8 and 9 of each say how long its header is.
    arrays: list[np.ndarray[Any, Any]] = []
    while at < len(raw):
        begin = at + 10 + int.from_bytes(raw[at + 8 : at + 10], "little")
        kind = _empty(raw[at:begin])
        at = begin + kind.nbytes
        array = np.frombuffer(raw[begin:at], kind.dtype).reshape(kind.shape)
        arrays.append(array)
    value = _whole(plain, arrays)
    if not isinstance(value, OperatingPoint | Ramp):
        raise ValueError("neither a state nor a ramp")
    return value


def _whole(item: Any, arrays: list[np.ndarray[Any, Any]]) -> Any:
    if isinstance(item, list):
        return tuple(_whole(one, arrays) for one in item)
    if not isinstance(item, dict):
        return item
    if "array" in item:
        return arrays[item["array"]]
    if "complex" in item:
        return complex(*item["complex"])
    found = {name: _whole(one, arrays) for name, one in item.items()}
    kind = found.pop("type")
    if "outcome" in found:
        found["outcome"] = Outcome(found["outcome"])
    return _PARTS[kind](**found)
