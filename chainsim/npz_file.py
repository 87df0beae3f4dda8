"""An NPZ that may be of anybody: its directory, which is read in one piece, has a sensible length."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

__all__ = ["opened_npz"]

# A directory has some hundred bytes for an array; zipfile would take memory for as many as the file says.
LONGEST_DIRECTORY = 1 << 20


@contextmanager
def opened_npz(path: Path) -> Iterator[zipfile.ZipFile]:
    """The archive at `path`, for reading.

    Raises
    ------
    OSError
        When it cannot be read.
    zipfile.BadZipFile
        When it is none, or its directory is longer than that of any NPZ.
    """
    with _Bounded(path) as file, zipfile.ZipFile(file) as archive:
        file.bounded = False
        yield archive


class _Bounded(io.BufferedReader):
    """A file that refuses to be read by the megabyte, for as long as its archive is opened."""

    def __init__(self, path: Path) -> None:
        super().__init__(io.FileIO(path))
        self.bounded = True

    def read(self, size: int | None = -1, /) -> bytes:
        if self.bounded and size is not None and size > LONGEST_DIRECTORY:
            raise zipfile.BadZipFile(f"its directory has {size} bytes")
        return super().read(size)
