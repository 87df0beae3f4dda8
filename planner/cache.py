"""Planned chains and ramps kept on disk, so that equal rows are planned once, ever."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from chainsim import Device

from .cache_file import CacheFile
from .operating_point import OperatingPoint
from .packed import packed, unpacked
from .plan import Ramp

__all__ = ["PLANS_VERSION", "PlanCache", "cache_path"]

PLANS_VERSION = 2
"""One more whenever planning, or the simulator under it, gives other numbers: what was kept before is not found."""

# How long another process may write before the cache is not waited for.
PATIENCE_S = 2.0


def cache_path() -> Path:
    """The cache's file: below DOTWAVE_CACHE, else XDG_CACHE_HOME, else ~/.cache."""
    own = os.environ.get("DOTWAVE_CACHE")
    base = Path(own) if own else Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "dotwave"
    return base / "plans.sqlite"


class PlanCache:
    """States and ramps by everything they depend on: the device, the contrast, the targets and `PLANS_VERSION`.

    What is damaged is not found and kept anew; a cache that cannot be read or written never finds anything. The log
    says so once, and planning goes on.
    """

    def __init__(self, device: Device, contrast_db: float, whole: PlanCache | None = None) -> None:
        """`whole` : of the device that `device` is one chain of; on its file, and with all it depends on."""
        profile = device.as_dict()
        for words in ("name", "description", "notes"):
            profile.pop(words)
        text = json.dumps([profile, contrast_db], sort_keys=True)
        self._scope = hashlib.sha256(f"{PLANS_VERSION} {text}".encode()).digest()
        if whole is not None:
            self._scope = hashlib.sha256(whole._scope + self._scope).digest()
        self._file: CacheFile = CacheFile(cache_path(), PATIENCE_S) if whole is None else whole._file

    def _key(self, item: bytes) -> bytes:
        return hashlib.sha256(self._scope + item).digest()

    def find(self, items: Sequence[bytes]) -> list[Any]:
        """What is kept for each item, None where nothing is."""
        keys = [self._key(item) for item in items]
        rows = self._file.find(keys)
        return [_read(rows[key]) if key in rows else None for key in keys]

    def keep(self, items: Iterable[tuple[bytes, OperatingPoint | Ramp]]) -> None:
        """Keep plans for later runs."""
        self._file.keep((self._key(item), packed(value)) for item, value in items)


def _read(raw: bytes) -> OperatingPoint | Ramp | None:
    """The plan; None where somebody else wrote the bytes."""
    try:
        return unpacked(raw)
    except (ValueError, LookupError, TypeError, AttributeError, EOFError):
        return None
