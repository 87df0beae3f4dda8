"""What is in zip and tar archives, one member at a time; what one member is like stops no other."""

from __future__ import annotations

import errno
import io
import lzma
import struct
import tarfile
import zipfile
import zlib
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

__all__ = ["ARCHIVES", "BROKEN", "check_plain", "members"]

ARCHIVES = (".zip", ".tar", ".tgz", ".tar.gz", ".tbz2", ".tar.bz2", ".txz", ".tar.xz")
# What the readers of archives raise on damaged ones.
BROKEN = (
    EOFError, LookupError, NotImplementedError, OSError, RuntimeError, ValueError, lzma.LZMAError, tarfile.TarError,
    zipfile.BadZipFile, zlib.error,
)  # fmt: skip

# Longest name or other header of a tar member that is read, in bytes; tarfile itself would take any.
LONGEST_HEADER = 1 << 20
# Of a zip's directory, which is read in one piece; a million members have about as much.
LONGEST_DIRECTORY = 1 << 27
HEADERS = {
    tarfile.GNUTYPE_LONGLINK, tarfile.GNUTYPE_LONGNAME, tarfile.SOLARIS_XHDTYPE, tarfile.XGLTYPE, tarfile.XHDTYPE,
}  # fmt: skip
# Zip's central directory: an entry's mark, its fixed part, where its flags are, and the flag for names in UTF-8.
ENTRY, ENTRY_BYTES, FLAGS, UTF_8 = b"PK\1\2", 46, 8, 0x800
ENCRYPTED = 0x1


def members(archive: Path) -> Iterator[tuple[str, Callable[[int], bytes]]]:
    """Names of the plain files in an archive, in its order, each with a function that reads its first bytes.

    Links, devices and folders are left out. The function must be called before the next name is asked for.

    Raises
    ------
    BROKEN
        When the archive, or the part that comes next, cannot be read; the function too, for its member only.
    """
    check_plain(archive)
    if archive.name.lower().endswith(".zip"):
        with _LenientNames(archive) as file, zipfile.ZipFile(file) as unzipped:
            for info in unzipped.infolist():
                if not info.is_dir():
                    yield info.filename, partial(_first, unzipped, info)
        return
    with tarfile.open(archive, tarinfo=_Entry) as tar:
        for entry in tar:
            if entry.isfile():
                yield entry.name, partial(_first_of_tar, tar, entry)


def check_plain(path: Path) -> None:
    """Refuse a pipe or a device, which might never come to an end.

    Raises
    ------
    OSError
        Without a word on anything else.
    """
    if path.exists() and not path.is_file():
        raise OSError(errno.EINVAL, "is not a file")


def _first(archive: zipfile.ZipFile, info: zipfile.ZipInfo, most: int) -> bytes:
    if info.flag_bits & ENCRYPTED:
        raise RuntimeError("it is encrypted; pack the archive without a password")
    try:
        with archive.open(info) as file:
            return file.read(most)
    except UnicodeDecodeError:
        raise zipfile.BadZipFile("its name is not the UTF-8 that it is said to be; pack the archive again") from None


def _first_of_tar(archive: tarfile.TarFile, entry: tarfile.TarInfo, most: int) -> bytes:
    file = archive.extractfile(entry)
    return b"" if file is None else file.read(most)


class _Entry(tarfile.TarInfo):
    """A header of bounded length: a small archive may unpack to one of many gigabytes."""

    def _proc_member(self, archive: tarfile.TarFile) -> tarfile.TarInfo:
        # What tarfile leaves to be overridden: every header comes here, and past `frombuf` in some versions.
        if self.type in HEADERS and self.size > LONGEST_HEADER:
            raise tarfile.TarError(f"a header of {self.size} bytes; at most {LONGEST_HEADER} are read")
        entry: tarfile.TarInfo = super()._proc_member(archive)  # type: ignore[misc]
        return entry


class _LenientNames(io.BufferedReader):
    """A zip file whose directory has the name of every member.

    zipfile gives up on the whole archive for one name that says it is UTF-8 and is not. It counts as code page 437
    here, as names in old archives do.
    """

    def __init__(self, path: Path) -> None:
        super().__init__(io.FileIO(path))

    def read(self, size: int | None = -1, /) -> bytes:
        """As of the file; the directory, which zipfile reads in one piece, has its flags put right."""
        if size is not None and size > LONGEST_DIRECTORY:
            raise zipfile.BadZipFile(f"a directory of {size} bytes; at most {LONGEST_DIRECTORY} are read")
        data = super().read(size)
        return _relabelled(data) if data.startswith(ENTRY) else data


def _relabelled(directory: bytes) -> bytes:
    data, at = bytearray(directory), 0
    while data[at : at + 4] == ENTRY and at + ENTRY_BYTES <= len(data):
        (flags,) = struct.unpack_from("<H", data, at + FLAGS)
        name, extra, comment = struct.unpack_from("<3H", data, at + 28)
        end = at + ENTRY_BYTES + name
        try:
            data[at + ENTRY_BYTES : end].decode()
        except UnicodeDecodeError:
            struct.pack_into("<H", data, at + FLAGS, flags & ~UTF_8)
        at = end + extra + comment
    return bytes(data)
