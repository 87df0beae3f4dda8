"""Files of a sweep: its parts on disk, and the two formats they are joined into, one part in memory at a time."""

from __future__ import annotations

import zipfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["WRITERS", "Parts"]

# The oldest date a ZIP can hold: same input, same bytes.
EPOCH = (1980, 1, 1, 0, 0, 0)


@dataclass(frozen=True)
class Parts:
    """Chunks of a sweep in `folder`; `firsts` are the numbers of their first settings."""

    folder: Path
    firsts: range

    def path(self, first: int) -> Path:
        """Where the chunk that starts at `first` lies."""
        return self.folder / f"{first:012d}.npz"

    def field(self, name: str) -> Iterator[NDArray[Any]]:
        """One field, chunk by chunk."""
        for first in self.firsts:
            with np.load(self.path(first), allow_pickle=False) as stored:
                yield stored[name]


def _write_npz(path: Path, parts: Parts, fields: tuple[str, ...], size: int) -> None:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_STORED) as archive:
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


def _write_csv(path: Path, parts: Parts, fields: tuple[str, ...], size: int) -> None:
    """A line for each setting; numbers as short as they can be read back exactly, what is not known as nothing."""
    with path.open("w", encoding="utf-8", newline="\n") as stream:
        for number, chunk in enumerate(zip(*(parts.field(name) for name in fields), strict=True)):
            named = [column for name, array in zip(fields, chunk, strict=True) for column in _columns(name, array)]
            if not number:
                stream.write(",".join(name for name, _ in named) + "\n")
            texts = [_texts(column) for _, column in named]
            stream.writelines(",".join(row) + "\n" for row in zip(*texts, strict=True))


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


WRITERS: dict[str, Callable[[Path, Parts, tuple[str, ...], int], None]] = {".npz": _write_npz, ".csv": _write_csv}
"""How to join the parts of a sweep, by suffix."""
