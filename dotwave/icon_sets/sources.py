"""Which pictures an icon set has: folders, globs, single files, zip and tar archives."""

from __future__ import annotations

import glob
import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import groupby
from pathlib import Path, PurePosixPath
from typing import NoReturn

from encoders import PictureLimits

from ..errors import AppError
from .archives import ARCHIVES, BROKEN, check_plain, members
from .names import shown_name, unique_names

__all__ = ["IconFile", "IconPlace", "find_icons", "read_icons"]

SUFFIXES = {".bmp", ".gif", ".jpeg", ".jpg", ".png", ".svg", ".svgz", ".tif", ".tiff", ".webp"}


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

    Names are paths below the folder or in the archive, after its name when there are several, as `shown_name` shows
    them; two that are alike are numbered.

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
    names = unique_names(name for name, _ in named)
    return tuple(IconPlace(place.container, place.member, name) for name, (_, place) in zip(names, named, strict=True))


def _name(place: IconPlace, several: bool) -> str:
    if not place.member:
        return shown_name(place.container.name)
    name = shown_name(place.member)
    return f"{shown_name(place.container.name)}/{name}" if several else name


def _paths(source: str) -> Iterable[Path]:
    if os.path.exists(source):
        return [Path(source)]
    found = [path for path in map(Path, glob.glob(source, recursive=True)) if "__MACOSX" not in path.parts]
    if not found:
        raise AppError(f"{source}: no such file or folder; correct the path")
    return found


def _places(path: Path) -> Iterator[IconPlace]:
    if path.is_dir():
        yield from (IconPlace(path, name) for name in _below(path) if _is_icon(name))
    elif path.name.lower().endswith(ARCHIVES):
        try:
            names = [name for name, _ in members(path)]
        except BROKEN as error:
            raise AppError(f"{path}: the archive cannot be read: {_clause(error)}; fetch it again") from None
        yield from (IconPlace(path, name) for name in names if _is_icon(name))
    elif path.suffix.lower() in SUFFIXES:
        yield IconPlace(path, "")


def _below(folder: Path) -> Iterator[str]:
    """Files in a folder and in those in it; pictures of one that cannot be read are not left out unsaid."""

    def refuse(error: OSError) -> NoReturn:
        raise AppError(f"{error.filename}: the folder cannot be read: {error.strerror}; change its permissions")

    for place, folders, names in os.walk(folder, onerror=refuse):
        folders[:] = [name for name in folders if not _is_hidden(name)]
        files = (Path(place, name) for name in names)
        yield from (file.relative_to(folder).as_posix() for file in files if file.is_file())


def _is_hidden(part: str) -> bool:
    return part.startswith((".", "__MACOSX")) and part not in {".", ".."}


def _is_icon(name: str) -> bool:
    path = PurePosixPath(name)
    return path.suffix.lower() in SUFFIXES and not any(map(_is_hidden, path.parts))


def read_icons(places: Iterable[IconPlace]) -> Iterator[IconFile]:
    """The pictures at `places`, one at a time; what cannot be read comes with its error."""
    most = PictureLimits().file_bytes + 1
    for container, group in groupby(sorted(places), key=lambda place: place.container):
        wanted = {place.member: place.name for place in group}
        if container.is_file() and "" not in wanted:
            yield from _unpacked(container, wanted, most)
            continue
        for member, name in wanted.items():
            yield _member(name, partial(_first, container / member if member else container), most)


def _unpacked(archive: Path, wanted: dict[str, str], most: int) -> Iterator[IconFile]:
    left = dict(wanted)
    problem = "it is not in the archive any more"
    try:
        for member, first in members(archive):
            if member in left:
                yield _member(left.pop(member), first, most)
    except BROKEN as error:
        problem = f"the archive {archive.name} is damaged: {_clause(error)}; fetch it again"
    yield from (IconFile(name, error=problem) for name in left.values())


def _member(name: str, first: Callable[[int], bytes], most: int) -> IconFile:
    try:
        return IconFile(name, first(most))
    except BROKEN as error:
        return IconFile(name, error=f"cannot be read: {_clause(error)}")


def _first(path: Path, most: int) -> bytes:
    check_plain(path)
    with path.open("rb") as file:
        return file.read(most)


def _clause(error: BaseException) -> str:
    return " ".join(str(getattr(error, "strerror", None) or error).split())[:160] or type(error).__name__
