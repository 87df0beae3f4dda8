"""Zip archives as documents use them, read with bounds: sizes, ratios, numbers and names are checked first."""

from __future__ import annotations

import io
import posixpath
import zipfile
import zlib
from typing import NoReturn
from urllib.parse import unquote, urlsplit

from ..errors import InvalidText, UnsupportedSource
from .limits import MOST_BYTES, MOST_MEMBERS, MOST_PART_BYTES, MOST_RATIO

__all__ = ["DocumentArchive", "joined_name"]

# What zipfile raises of archives that are broken, encrypted, or packed in a way it does not know.
_BROKEN = (zipfile.BadZipFile, zlib.error, EOFError, OSError, ValueError, RuntimeError, OverflowError, LookupError)
FREE_BYTES = 1_000_000


class DocumentArchive:
    """A zip file in memory; nothing is ever written to a disk.

    Raises
    ------
    InvalidText
        When it is broken, or its names leave it.
    UnsupportedSource
        When it is larger, or packed tighter, than documents are.
    """

    def __init__(self, data: bytes) -> None:
        try:
            self._zip = zipfile.ZipFile(io.BytesIO(data))
            infos = self._zip.infolist()
        except _BROKEN as error:
            raise InvalidText(f"not a whole zip archive ({error}); save it again") from None
        if len(infos) > MOST_MEMBERS:
            raise UnsupportedSource(f"an archive of {len(infos)} files; at most {MOST_MEMBERS} are read")
        self._infos: dict[str, zipfile.ZipInfo] = {}
        for info in infos:
            _check(info)
            if info.filename in self._infos:
                raise InvalidText(f"two files of the archive have the name {info.filename!r}; pack it again")
            self._infos[info.filename] = info
        self._taken: dict[str, int] = {}

    @property
    def names(self) -> tuple[str, ...]:
        """Of all files, in the archive's order."""
        return tuple(self._infos)

    def __contains__(self, name: str) -> bool:
        return name in self._infos

    def read(self, name: str) -> bytes:
        """The bytes of one file.

        Raises
        ------
        InvalidText, UnsupportedSource
            As for the archive; also when there is no such file.
        """
        info = self._infos.get(name)
        if info is None:
            raise InvalidText(f"{name!r} is not in the archive; save it again")
        try:
            with self._zip.open(info) as file:
                data = file.read(MOST_PART_BYTES + 1)
        except (*_BROKEN, NotImplementedError) as error:
            raise InvalidText(f"{name}: cannot be taken out of the archive ({error}); save it again") from None
        if len(data) > MOST_PART_BYTES:
            _refuse_size(name)
        self._taken[name] = len(data)
        if sum(self._taken.values()) > MOST_BYTES:
            raise UnsupportedSource(f"its files have more than {MOST_BYTES} bytes together; give it in parts")
        return data


def _check(info: zipfile.ZipInfo) -> None:
    name = info.filename
    parts = name.split("/")
    if name.startswith("/") or "\\" in name or "\0" in name or ".." in parts or ":" in parts[0]:
        raise InvalidText(f"a file of the archive has the name {name!r}, which leaves it; pack it again")
    if info.file_size > FREE_BYTES + MOST_RATIO * info.compress_size:
        raise UnsupportedSource(
            f"{name}: {info.compress_size} bytes that become {info.file_size}; documents are not packed so tight"
        )


def _refuse_size(name: str) -> NoReturn:
    raise UnsupportedSource(f"{name}: more than {MOST_PART_BYTES} bytes; give it in parts")


def joined_name(base: str, href: str) -> str:
    """The name in an archive that `href` in the file `base` means; empty when it means nothing in it."""
    try:
        parts = urlsplit(href)
    except ValueError:
        return ""
    if parts.scheme or parts.netloc or not parts.path:
        return ""
    name = posixpath.normpath(posixpath.join(posixpath.dirname(base), unquote(parts.path)))
    return "" if name.startswith(("/", "..")) else name
