"""Which pictures an icon set has: folders, globs, single files, zip and tar archives."""

from __future__ import annotations

import glob
import lzma
import tarfile
import zipfile
import zlib
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path, PurePosixPath

from encoders import PictureLimits

from .errors import AppError

__all__ = ["IconFile", "IconPlace", "find_icons", "read_icons"]

SUFFIXES = {".bmp", ".gif", ".jpeg", ".jpg", ".png", ".svg", ".svgz", ".tif", ".tiff", ".webp"}
ARCHIVES = (".zip", ".tar", ".tgz", ".tar.gz", ".tbz2", ".tar.bz2", ".txz", ".tar.xz")
# What the readers of archives raise on damaged ones.
BROKEN = (
    EOFError, LookupError, NotImplementedError, OSError, RuntimeError, ValueError, lzma.LZMAError, tarfile.TarError,
    zipfile.BadZipFile, zlib.error,
)  # fmt: skip


@dataclass(frozen=True, order=True)
class IconPlace:
    """Where a picture is: `member` of an archive or below a folder, empty for a file; `name` is unique in the set."""

    container: Path
    member: str
    name: str = ""


@dataclass(frozen=True)
class IconFile:
    """A picture that was read: its bytes, or an `error` in one line."""

    name: str
    data: bytes = b""
    error: str = ""


def find_icons(sources: Sequence[str]) -> tuple[IconPlace, ...]:
    """Every picture of the sources, sorted by name; hidden files and other kinds are left out.

    Names are paths below the folder or in the archive, after its name when there are several.

    Raises
    ------
    AppError
        When a source does not exist, an archive cannot be opened, or there is no picture at all.
    """
    places = {place for source in sources for path in _paths(source) for place in _places(path)}
    if not places:
        raise AppError(f"{', '.join(sources)}: no pictures found; give PNG, JPEG, GIF, WebP, BMP, TIFF or SVG files")
    several = len({place.container for place in places if place.member}) > 1
    named = sorted((_name(place, several), place) for place in places)
    seen: Counter[str] = Counter()
    found = []
    for name, place in named:
        seen[name] += 1
        unique = name if seen[name] == 1 else f"{name} ({seen[name]})"
        found.append(IconPlace(place.container, place.member, unique))
    return tuple(found)


def _name(place: IconPlace, several: bool) -> str:
    if not place.member:
        return _text(place.container.name)
    parts = [part for part in PurePosixPath(place.member).parts if part not in {"/", ".."}]
    return _text("/".join([place.container.name, *parts] if several else parts))


def _text(name: str) -> str:
    """A name to show and to write; bytes that are no UTF-8 are replaced."""
    return name.encode("utf-8", "surrogateescape").decode("utf-8", "replace")


def _paths(source: str) -> Iterable[Path]:
    if Path(source).exists():
        return [Path(source)]
    found = [path for path in map(Path, glob.glob(source, recursive=True)) if "__MACOSX" not in path.parts]
    if not found:
        raise AppError(f"{source}: no such file or folder; correct the path")
    return found


def _places(path: Path) -> Iterator[IconPlace]:
    if path.is_dir():
        below = (found.relative_to(path).as_posix() for found in path.rglob("*") if found.is_file())
        yield from (IconPlace(path, name) for name in below if _is_icon(name))
    elif path.name.lower().endswith(ARCHIVES):
        try:
            names = [name for name, _ in _members(path, None)]
        except BROKEN as error:
            raise AppError(f"{path}: the archive cannot be read: {_clause(error)}; fetch it again") from None
        yield from (IconPlace(path, name) for name in names)
    elif path.suffix.lower() in SUFFIXES:
        yield IconPlace(path, "")


def _is_icon(name: str) -> bool:
    path = PurePosixPath(name)
    hidden = any(part.startswith((".", "__MACOSX")) and part not in {".", ".."} for part in path.parts)
    return path.suffix.lower() in SUFFIXES and not hidden


def read_icons(places: Iterable[IconPlace]) -> Iterator[IconFile]:
    """The pictures at `places`, one at a time; what cannot be read comes with its error."""
    most = PictureLimits().file_bytes + 1
    for container, group in groupby(sorted(places), key=lambda place: place.container):
        wanted = {place.member: place.name for place in group}
        if container.is_file() and "" not in wanted:
            yield from _unpacked(container, wanted, most)
            continue
        for member, name in wanted.items():
            try:
                with (container / member if member else container).open("rb") as file:
                    yield IconFile(name, file.read(most))
            except OSError as error:
                yield IconFile(name, error=f"cannot be read: {_clause(error)}")


def _unpacked(archive: Path, wanted: dict[str, str], most: int) -> Iterator[IconFile]:
    left = dict(wanted)
    problem = "it is not in the archive any more"
    try:
        for member, data in _members(archive, most):
            if member in left:
                yield IconFile(left.pop(member), data)
    except BROKEN as error:
        problem = f"the archive {archive.name} is damaged: {_clause(error)}; fetch it again"
    yield from (IconFile(name, error=problem) for name in left.values())


def _members(archive: Path, most: int | None) -> Iterator[tuple[str, bytes]]:
    """Names of the pictures in an archive with their first `most` bytes (None: unread), in the archive's order."""
    if archive.name.lower().endswith(".zip"):
        with zipfile.ZipFile(archive) as unzipped:
            for info in unzipped.infolist():
                if not info.is_dir() and _is_icon(info.filename):
                    yield info.filename, b"" if most is None else _first(unzipped, info, most)
        return
    with tarfile.open(archive) as tar:
        for entry in tar:
            if entry.isfile() and _is_icon(entry.name):
                file = None if most is None else tar.extractfile(entry)
                yield entry.name, b"" if file is None or most is None else file.read(most)


def _first(archive: zipfile.ZipFile, info: zipfile.ZipInfo, most: int) -> bytes:
    with archive.open(info) as file:
        return file.read(most)


def _clause(error: BaseException) -> str:
    return " ".join(str(getattr(error, "strerror", None) or error).split())[:160] or type(error).__name__
