"""Files of a sweep: its parts on disk, and the two formats they are joined into, one part in memory at a time."""

from __future__ import annotations

import hashlib
import struct
import zipfile
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from io import TextIOWrapper
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from drivers import atomic_file

from .errors import AppError

__all__ = ["WRITERS", "Arrays", "Parts"]

Arrays = dict[str, NDArray[Any]]

# The oldest date a ZIP can hold: same input, same bytes.
EPOCH = (1980, 1, 1, 0, 0, 0)
# What zipfile and numpy say of a file that is not what they wrote.
DAMAGE = (
    zipfile.BadZipFile, zlib.error, struct.error, KeyError, ValueError, TypeError, EOFError, NotImplementedError,
    RuntimeError, MemoryError,
)  # fmt: skip
DIGEST = "digest"


@dataclass(frozen=True)
class Parts:
    """Chunks of the sweep `sweep` (its digest) in `folder`; `firsts` are the numbers of their first settings."""

    folder: Path
    firsts: range
    sweep: str = ""

    def path(self, first: int) -> Path:
        """Where the chunk that starts at `first` lies."""
        return self.folder / f"{first:012d}.npz"

    def save(self, first: int, arrays: Arrays) -> None:
        """Keep the chunk that starts at `first`, with a digest of it."""
        with atomic_file(self.path(first)) as file:
            np.savez(file, allow_pickle=False, **arrays, **{DIGEST: np.array(self._digest(first, arrays))})

    def done(self, first: int) -> bool:
        """Whether the chunk that starts at `first` is there as it was kept; one that is damaged is not."""
        try:
            with zipfile.ZipFile(self.path(first)) as archive:
                arrays = {name.removesuffix(".npy"): _array(archive, name) for name in archive.namelist()}
            return str(arrays.pop(DIGEST)) == self._digest(first, arrays)
        except (FileNotFoundError, *DAMAGE):
            return False

    def field(self, name: str) -> Iterator[NDArray[Any]]:
        """One field, chunk by chunk."""
        for first in self.firsts:
            try:
                with zipfile.ZipFile(self.path(first)) as archive:
                    array = _array(archive, f"{name}.npy")
            except DAMAGE:
                raise AppError(f"{self.path(first)}: damaged; the same call again solves it anew") from None
            yield array

    def _digest(self, first: int, arrays: Arrays) -> str:
        digest = hashlib.sha256(f"{self.sweep} {first}".encode())
        for name, array in arrays.items():
            digest.update(f"{name} {array.dtype.str} {array.shape}".encode() + np.ascontiguousarray(array).tobytes())
        return digest.hexdigest()


def _array(archive: zipfile.ZipFile, name: str) -> NDArray[Any]:
    with archive.open(name) as member:
        array: NDArray[Any] = np.lib.format.read_array(member, allow_pickle=False)
    return array


def _write_npz(file: BinaryIO, parts: Parts, fields: tuple[str, ...], size: int) -> None:
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


def _write_csv(file: BinaryIO, parts: Parts, fields: tuple[str, ...], size: int) -> None:
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


WRITERS: dict[str, Callable[[BinaryIO, Parts, tuple[str, ...], int], None]] = {".npz": _write_npz, ".csv": _write_csv}
"""How to join the parts of a sweep into an open file, by suffix."""
