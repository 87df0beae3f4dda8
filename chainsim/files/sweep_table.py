"""The table beside a sweep file: columns of numbers in NPZ or CSV, checked before memory is taken for them."""

from __future__ import annotations

import csv
import math
import re
import warnings
import zipfile
import zlib
from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from stat import S_ISREG
from typing import TextIO

import numpy as np
from numpy.typing import NDArray

from ..complaints import shown
from ..errors import ProfileError
from ..npy_header import NpyHeader, read_npy_header
from ..npz_file import opened_npz

__all__ = ["AXES", "MOST_NUMBERS", "read_table"]

Floats = NDArray[np.float64]
AXES = ("epsilon", "lam", "omega")
COLUMNS = f"{', '.join(AXES)} or lam_1, lam_2, ..."

# 0.8 GB in memory.
MOST_NUMBERS = 100_000_000
LONGEST_NUMBER = 30
LONGEST_HEADER = 1 << 20
LOCKED = 1
# What zipfile raises on what is not a ZIP, or not one that it reads.
UNREADABLE = (
    zipfile.BadZipFile, zlib.error, EOFError, ValueError, OverflowError, NotImplementedError, RuntimeError,
)  # fmt: skip


def read_table(path: Path) -> dict[str, Floats]:
    """Columns of the table at `path` by axis: float64, shape (rows,), lam also (rows, links); all of one length.

    Raises
    ------
    ProfileError
        When it cannot be read, is too large, or has other columns or something else than finite numbers.
    """
    readers = {".npz": _read_npz, ".csv": _read_csv}
    if path.suffix.lower() not in readers:
        raise ProfileError(f"{path}: expected a table named .npz or .csv")
    try:
        plain = S_ISREG(path.stat().st_mode)
    except (OSError, ValueError) as error:
        raise ProfileError(f"{path}: {getattr(error, 'strerror', None) or error}") from None
    if not plain:
        raise ProfileError(f"{path}: is not a file; save what comes from elsewhere first, a table is read twice")
    try:
        found = readers[path.suffix.lower()](path)
    except OSError as error:
        raise ProfileError(f"{path}: {error.strerror or error}") from None
    lengths = {name: len(column) for name, column in found.items()}
    if not found or not min(lengths.values()):
        raise ProfileError(f"{path}: no rows of {', '.join(AXES)}")
    if len(set(lengths.values())) > 1:
        raise ProfileError(f"{path}: columns of different lengths: {lengths}; give each a value for every row")
    for name, column in found.items():
        if not np.isfinite(column).all():
            row = int(np.argwhere(~np.isfinite(column))[0][0])
            raise ProfileError(
                f"{path}: {name}: expected finite numbers, got {column[row]} in row {row}, counted from 0"
            )
    return found


def _refuse_size(path: Path, numbers: int) -> None:
    if numbers > MOST_NUMBERS:
        raise ProfileError(f"{path}: {numbers} numbers; a table has at most {MOST_NUMBERS}; sweep it in parts")


def _read_npz(path: Path) -> dict[str, Floats]:
    try:
        with opened_npz(path) as archive:
            members = {info.filename: info for info in archive.infolist()}
            if len(members) < len(archive.infolist()):
                raise ProfileError(f"{path}: an array is given twice; keep one")
            for name in members:
                if name.removesuffix(".npy") not in AXES or not name.endswith(".npy"):
                    raise ProfileError(
                        f"{path}: unknown array {shown(name.removesuffix('.npy'))}; expected {', '.join(AXES)} "
                        "(the links of a chain are the columns of lam)"
                    )
            headers = {name: _checked(path, archive, info) for name, info in members.items()}
            _refuse_size(path, sum(header.size for header in headers.values()))
            return {name.removesuffix(".npy"): _numbers(archive, name, header) for name, header in headers.items()}
    except UNREADABLE as error:
        if isinstance(error, ProfileError):
            raise
        raise ProfileError(f"{path}: not an NPZ of numbers: {str(error)[:80]}") from None


def _checked(path: Path, archive: zipfile.ZipFile, info: zipfile.ZipInfo) -> NpyHeader:
    """The header of an array, which the archive must confirm."""
    name = info.filename.removesuffix(".npy")
    if info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED) or info.flag_bits & LOCKED:
        raise ProfileError(f"{path}: {name}: packed in another way than NumPy does; save it with numpy.savez")
    with archive.open(info) as member:
        header = read_npy_header(member)
        rest = info.file_size - member.tell()
    if header.dtype.kind not in "fiu":
        cure = "; give the real part alone" if header.dtype.kind == "c" else ""
        raise ProfileError(f"{path}: {name}: expected real numbers, got {header.dtype}{cure}")
    if len(header.shape) != 1 and not (name == "lam" and len(header.shape) == 2):
        wanted = "a column, or one for each link" if name == "lam" else "one column"
        raise ProfileError(f"{path}: {name}: expected {wanted}, got shape {header.shape}")
    if header.size * header.dtype.itemsize != rest:
        raise ProfileError(f"{path}: {name}: shape {header.shape} does not go with its {rest} bytes; it is damaged")
    return header


def _numbers(archive: zipfile.ZipFile, name: str, header: NpyHeader) -> Floats:
    with archive.open(name) as member:
        read_npy_header(member)
        values = np.frombuffer(member.read(), header.dtype)
    return values.reshape(header.shape, order="F" if header.fortran else "C").astype(np.float64)


def _read_csv(path: Path) -> dict[str, Floats]:
    if path.stat().st_size > MOST_NUMBERS * LONGEST_NUMBER:
        _refuse_size(path, path.stat().st_size // LONGEST_NUMBER)
    try:
        with path.open(encoding="utf-8-sig", newline="") as lines:
            names = _names(path, lines)
            with warnings.catch_warnings():
                # A table without rows is refused by the caller.
                warnings.simplefilter("ignore", UserWarning)
                some = islice(lines, MOST_NUMBERS // len(names) + 1)
                numbers = np.loadtxt(some, delimiter=",", ndmin=2, comments=None, quotechar='"')
    except ValueError as error:
        if isinstance(error, ProfileError):
            raise
        raise _where(path) from None
    _refuse_size(path, numbers.size)
    if not numbers.size:
        return {}
    if numbers.shape[1] != len(names) or not np.isfinite(numbers).all():
        raise _where(path)
    found = {name: numbers[:, at] for at, name in enumerate(names) if name in AXES}
    links = [at for at, name in enumerate(names) if name not in AXES]
    if links:
        found["lam"] = numbers[:, sorted(links, key=lambda at: int(names[at][4:]))]
    return found


def _names(path: Path, lines: TextIO) -> list[str]:
    """The header's columns, each once and known."""
    try:
        cells = next(csv.reader([lines.readline(LONGEST_HEADER)]), [])
    except csv.Error as error:
        raise ProfileError(f"{path}:1: not CSV: {error}") from None
    names = [name.strip() for name in cells]
    for name in names:
        if name not in AXES and not re.fullmatch("lam_[1-9][0-9]{0,6}", name):
            raise ProfileError(f"{path}:1: unknown column {shown(name)}; expected {COLUMNS}")
    repeated = next((name for name in names if names.count(name) > 1), None) if len(set(names)) < len(names) else None
    if repeated:
        raise ProfileError(f"{path}:1: column {repeated} is given twice; keep one")
    links = sorted(int(name[4:]) for name in names if name not in AXES)
    if links and "lam" in names:
        raise ProfileError(f"{path}:1: columns lam and lam_{links[0]}; give lam for all links, or lam_1, lam_2, ...")
    missing = next((link for link, have in enumerate(links, 1) if link != have), None)
    if missing:
        raise ProfileError(f"{path}:1: column lam_{links[-1]} but no lam_{missing}; give every link from lam_1 on")
    if not names:
        raise ProfileError(f"{path}:1: no header; expected {COLUMNS}")
    return names


def _where(path: Path) -> ProfileError:
    """The complaint about the first line that is not numbers, found by reading again one by one."""
    line = 1
    try:
        with path.open(encoding="utf-8-sig", newline="") as lines:
            names = _names(path, lines)
            for line, cells in _cells(lines):
                if len(cells) != len(names):
                    return ProfileError(f"{path}:{line}: expected {len(names)} numbers, got {len(cells)}")
                for name, cell in zip(names, cells, strict=True):
                    if not _is_number(cell):
                        return ProfileError(f"{path}:{line}: {name}: expected a finite number, got {shown(cell)}")
    except UnicodeDecodeError:
        return ProfileError(f"{path}: after line {line}: not UTF-8; save it as UTF-8")
    except csv.Error as error:
        return ProfileError(f"{path}: after line {line}: not CSV: {error}")
    return ProfileError(f"{path}: not a CSV of numbers")


def _cells(lines: TextIO) -> Iterator[tuple[int, list[str]]]:
    reader = csv.reader(lines)
    yield from ((reader.line_num + 1, cells) for cells in reader if cells)


def _is_number(cell: str) -> bool:
    try:
        return math.isfinite(float(cell)) and "_" not in cell and cell.isascii()
    except ValueError:
        return False
