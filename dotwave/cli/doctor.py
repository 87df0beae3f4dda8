"""What `dotwave doctor` examines: everything outside this code that it needs to work."""

from __future__ import annotations

import importlib.util
import os
import re
import shutil
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Any

__all__ = ["Check", "Health", "examine"]

PACKAGES = ("chainsim", "drivers", "dotwave", "encoders", "planner")
OLDEST_PYTHON = (3, 11)
LEAST_FREE_BYTES = 1_000_000_000


@dataclass(frozen=True)
class Check:
    """One thing that was examined; `cure` says what to do and is empty when all is well."""

    name: str
    found: str
    cure: str = ""

    @property
    def ok(self) -> bool:
        """Nothing is to be done."""
        return not self.cure


@dataclass(frozen=True)
class Health:
    """All checks, in the order they were made."""

    checks: tuple[Check, ...]

    @property
    def ok(self) -> bool:
        """Every check is ok."""
        return all(check.ok for check in self.checks)

    def as_dict(self) -> dict[str, Any]:
        """The checks in plain JSON types."""
        return {"ok": self.ok, "checks": [vars(check) | {"ok": check.ok} for check in self.checks]}

    def as_text(self) -> str:
        """One line per check, starting with ok or PROBLEM."""
        lines = [f"ok: {c.name}: {c.found}" if c.ok else f"PROBLEM: {c.name}: {c.found}; {c.cure}" for c in self.checks]
        wrong = sum(not check.ok for check in self.checks)
        return "\n".join([*lines, "All is well." if not wrong else f"Problems: {wrong}."])


def examine() -> Health:
    """Examine this installation; nothing is changed by it."""
    return Health((_python(), *_requirements(), _liblouis(), *_shadows(), _numba_cache(), _disk(Path.cwd())))


def _python() -> Check:
    found = f"{sys.version.split()[0]} at {sys.executable}"
    return Check("Python", found, "" if sys.version_info >= OLDEST_PYTHON else "install Python 3.11 or newer")


def _requirements() -> Iterator[Check]:
    """One check per package that the distribution requires (its extras apart)."""
    try:
        required = metadata.requires("dotwave") or []
    except metadata.PackageNotFoundError:
        yield Check("dotwave", "not installed", "install it: ./run dotwave doctor, or pip install -e .")
        return
    for line in required:
        parts = re.match(r"([A-Za-z0-9_.-]+)\s*(?:>=\s*([0-9.]+))?", line)
        if parts and "extra ==" not in line:
            yield _package(parts[1], parts[2] or "0")


def _package(name: str, oldest: str) -> Check:
    try:
        found = metadata.version(name)
    except metadata.PackageNotFoundError:
        return Check(name, "missing", f"pip install '{name}>={oldest}'")
    return Check(name, found, "" if _release(found) >= _release(oldest) else f"pip install '{name}>={oldest}'")


def _release(version: str) -> tuple[int, ...]:
    """The leading numbers of a version, trailing zeros dropped: 2.0.1rc1 -> (2, 0, 1)."""
    numbers = [int(part) for part in re.match(r"[0-9.]*", version)[0].split(".") if part]  # type: ignore[index]
    while numbers and numbers[-1] == 0:
        numbers.pop()
    return tuple(numbers)


def _liblouis() -> Check:
    from encoders import EncodeError, liblouis_place, liblouis_version, list_tables

    try:
        version, tables = liblouis_version(), len(list_tables())
    except EncodeError as error:
        return Check("liblouis", "not usable", str(error))
    return Check("liblouis", f"{version}, {tables} tables, {liblouis_place()}")


def _shadows() -> Iterator[Check]:
    """Our package names are plain words; another distribution may install one of the same name."""
    home = Path(__file__).resolve().parents[2]
    owners = metadata.packages_distributions()
    for name in PACKAGES:
        others = sorted({owner for owner in owners.get(name, []) if owner != "dotwave"})
        spec = importlib.util.find_spec(name)
        place = Path(spec.origin).resolve().parent if spec is not None and spec.origin else None
        if others:
            yield Check(
                f"package {name}", f"also installed by {others[0]}", f"pip uninstall {others[0]}, or use a .venv"
            )
        elif place != home / name:
            yield Check(
                f"package {name}", f"found in {place}", f"start from another folder; it belongs in {home / name}"
            )
        else:
            yield Check(f"package {name}", str(place))


def _numba_cache() -> Check:
    """Numba compiles once into a folder it can write: NUMBA_CACHE_DIR, beside the source, or the user's."""
    given = os.environ.get("NUMBA_CACHE_DIR")
    beside = Path(__file__).resolve().parents[2] / "chainsim"
    folders = [Path(given)] if given else [beside, Path.home() / ".cache", Path(tempfile.gettempdir())]
    for folder in folders:
        if folder.is_dir() and os.access(folder, os.W_OK):
            return Check("numba cache", f"writable, {folder}")
    cure = "set NUMBA_CACHE_DIR to a folder that can be written, or every start compiles again"
    return Check("numba cache", f"{folders[0]} cannot be written", cure)


def _disk(folder: Path) -> Check:
    free = shutil.disk_usage(folder).free
    cure = "" if free >= LEAST_FREE_BYTES else "free some space: a minute of 42 channels takes 81 MB"
    return Check("disk", f"{free / 1e9:.1f} GB free in {folder}", cure)
