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
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from chainsim import Device, Outcome

from .plan import ChainState, Margins, Ramp

__all__ = ["PlanCache", "cache_path"]

log = logging.getLogger(__name__)


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
        for path in sorted(folder.glob("*.py")):
            digest.update(path.read_bytes())
    return digest.digest()


class PlanCache:
    """States and ramps by everything they depend on: the device, the contrast, the targets and this code.

    A cache that cannot be read or written (read-only home, full disk, damaged file) is a cache that never
    finds anything: it says so once in the log, and planning goes on.
    """

    def __init__(self, device: Device, contrast_db: float) -> None:
        profile = device.as_dict()
        for words in ("name", "description", "notes"):
            profile.pop(words)
        text = json.dumps([profile, contrast_db], sort_keys=True)
        self._scope = hashlib.sha256(_code_digest() + text.encode()).digest()
        self._connection: sqlite3.Connection | None = None
        try:
            path = cache_path()
            path.parent.mkdir(parents=True, exist_ok=True)
            self._connection = sqlite3.connect(path, timeout=2.0, isolation_level=None, check_same_thread=False)
            self._connection.execute("PRAGMA synchronous = OFF")
            self._connection.execute(
                "CREATE TABLE IF NOT EXISTS plans (key BLOB PRIMARY KEY, value BLOB) WITHOUT ROWID"
            )
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
            with closing(self._connection.cursor()) as cursor:
                rows = [
                    cursor.execute("SELECT value FROM plans WHERE key = ?", (self._key(item),)).fetchone()
                    for item in items
                ]
            return [None if row is None else _unpacked(row[0]) for row in rows]
        except (sqlite3.Error, ValueError, LookupError, TypeError, AttributeError, EOFError) as error:
            self._give_up(error)
            return [None] * len(items)

    def keep(self, items: Iterable[tuple[bytes, ChainState | Ramp]]) -> None:
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


def _packed(value: ChainState | Ramp) -> bytes:
    """Plain values as a line of JSON, then the arrays; no pickle."""
    plain: dict[str, Any] = {"type": type(value).__name__}
    arrays: list[np.ndarray[Any, Any]] = []
    for field in fields(value):
        item = getattr(value, field.name)
        if isinstance(item, np.ndarray):
            plain[field.name] = {"array": len(arrays)}
            arrays.append(item)
        elif isinstance(item, Margins):
            plain[field.name] = {"margins": [item.volts, item.well, item.noise_gain]}
        elif isinstance(item, complex):
            plain[field.name] = {"complex": [item.real, item.imag]}
        else:
            plain[field.name] = item
    out = io.BytesIO()
    out.write(json.dumps(plain).encode() + b"\n")
    for array in arrays:
        np.save(out, array, allow_pickle=False)
    return out.getvalue()


def _unpacked(raw: bytes) -> ChainState | Ramp:
    source = io.BytesIO(raw)
    plain = json.loads(source.readline())
    kind: type[ChainState] | type[Ramp] = {"ChainState": ChainState, "Ramp": Ramp}[plain.pop("type")]
    for name, item in plain.items():
        if isinstance(item, dict):
            if "array" in item:
                array = np.load(source, allow_pickle=False)
                array.flags.writeable = False
                plain[name] = array
            elif "margins" in item:
                plain[name] = Margins(*item["margins"])
            else:
                plain[name] = complex(*item["complex"])
    if "outcome" in plain:
        plain["outcome"] = Outcome(plain["outcome"])
    return kind(**plain)
