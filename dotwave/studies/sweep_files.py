"""Files of a sweep: its parts on disk, and the two formats they are joined into, one part in memory at a time."""

from __future__ import annotations

import hashlib
import os
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from io import TextIOWrapper
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from drivers import atomic_file

from ..errors import AppError

__all__ = ["WRITERS", "Arrays", "SweepParts"]

Arrays = dict[str, NDArray[Any]]

# The oldest date a ZIP can hold: same input, same bytes.
EPOCH = (1980, 1, 1, 0, 0, 0)
# What numpy says of a file that was damaged after it was found whole.
DAMAGE = (zipfile.BadZipFile, KeyError, ValueError, EOFError)
DIGEST = 32  # bytes


@dataclass(frozen=True)
class SweepParts:
    """Chunks of the sweep `sweep` (its digest) in `folder`; `firsts` are the numbers of their first settings."""

    folder: Path
    firsts: range
    sweep: str = ""

    def path(self, first: int) -> Path:
        """Where the chunk that starts at `first` lies."""
        return self.folder / f"{first:012d}.npz"

    def save(self, first: int, arrays: Arrays) -> None:
        """Keep the chunk that starts at `first`; a digest of the file stands at its end, as the comment of the ZIP."""
        with atomic_file(self.path(first)) as file:
            np.savez(file, allow_pickle=False, **arrays)
            with zipfile.ZipFile(file, "a") as archive:
                archive.comment = bytes(DIGEST)
            file.seek(-DIGEST, os.SEEK_END)
            file.write(self._digest(first, file))

    def done(self, first: int) -> bool:
        """Whether the chunk that starts at `first` is there as it was kept; one that is damaged is not."""
        if not self.path(first).is_file():
            return False
        try:
            with self.path(first).open("rb") as file:
                digest = self._digest(first, file)
                return file.read() == digest
        except FileNotFoundError:
            return False

    def field(self, name: str) -> Iterator[NDArray[Any]]:
        """One field, chunk by chunk."""
        for first in self.firsts:
            try:
                with self.path(first).open("rb") as file, np.load(file, allow_pickle=False) as stored:
                    array = stored[name]
            except DAMAGE:
                raise AppError(f"{self.path(first)}: damaged; the same call again solves it anew") from None
            yield array

    def _digest(self, first: int, file: BinaryIO) -> bytes:
        """Of all that stands before it, and of where it belongs; leaves the file where it begins."""
        left = max(0, file.seek(0, os.SEEK_END) - DIGEST)
        file.seek(0)
        digest = hashlib.sha256(f"{self.sweep} {first}".encode())
        while piece := file.read(min(left, 1 << 20)):
            digest.update(piece)
            left -= len(piece)
        return digest.digest()


def _write_npz(file: BinaryIO, parts: SweepParts, fields: tuple[str, ...], size: int) -> None:
    with zipfile.ZipFile(file, "w", zipfile.ZIP_STORED) as archive:
        for name in fields:
            info = zipfile.ZipInfo(f"{name}.npy", EPOCH)
            with archive.open(info, "w", force_zip64=True) as stream:
                for number, array in enumerate(parts.field(name)):
                    if not number:
                        header = {
                            "descr": np.lib.format.dtype_to_descr(array.dtype), "fortran_order": False,
                            "shape": (size, *array.shape[1:]),
                        }  # fmt: skip
                        np.lib.format.write_array_header_1_0(stream, header)
                    stream.write(np.ascontiguousarray(array).data.cast("B"))


def _write_csv(file: BinaryIO, parts: SweepParts, fields: tuple[str, ...], size: int) -> None:
    """A line for each setting; numbers as short as they can be read back exactly, what is not known as nothing."""
    stream = TextIOWrapper(file, encoding="utf-8", newline="\n")
    for number, chunk in enumerate(zip(*(parts.field(name) for name in fields), strict=True)):
        named = [column for name, array in zip(fields, chunk, strict=True) for column in _columns(name, array)]
        if not number:
            stream.write(",".join(name for name, _ in named) + "\n")
        texts = [_texts(column) for _, column in named]
        stream.writelines(",".join(row) + "\n" for row in zip(*texts, strict=True))
    stream.detach()


def _columns(name: str, array: NDArray[Any]) -> Iterator[tuple[str, NDArray[Any]]]:
    if array.ndim == 1:
        yield name, array
        return
    for at in range(array.shape[1]):
        if np.iscomplexobj(array):
            yield f"{name}_{at + 1}_re", array[:, at].real
            yield f"{name}_{at + 1}_im", array[:, at].imag
        else:
            yield f"{name}_{at + 1}", array[:, at]


def _texts(column: NDArray[Any]) -> list[str]:
    if column.dtype.kind == "f":
        return [repr(value) if np.isfinite(value) else "" for value in column.tolist()]
    if column.dtype.kind == "b":
        return ["true" if value else "false" for value in column.tolist()]
    return [str(value) for value in column.tolist()]


WRITERS: dict[str, Callable[[BinaryIO, SweepParts, tuple[str, ...], int], None]] = {
    ".npz": _write_npz,
    ".csv": _write_csv,
}
"""How to join the parts of a sweep into an open file, by suffix."""
