"""What an NPY file says of its array before the numbers: read strictly, so that anything may be in it."""

from __future__ import annotations

import math
import re
from typing import IO, NamedTuple

import numpy as np

__all__ = ["NpyHeader", "read_npy_header"]

MAGIC = b"\x93NUMPY"
LONGEST = 4096
# As NumPy writes it: no record types, whose descriptions nest.
PLAIN = re.compile(
    r"\{'descr': '(?P<dtype>[<>|=]?[A-Za-z]\d*(\[\w+\])?)', 'fortran_order': (?P<fortran>True|False), "
    r"'shape': \((?P<shape>(\d{1,19},? ?)*)\),? ?\}\s*"
)


class NpyHeader(NamedTuple):
    """Kind and shape of an array, and whether its first index runs fastest."""

    dtype: np.dtype[np.generic]
    shape: tuple[int, ...]
    fortran: bool

    @property
    def size(self) -> int:
        """How many numbers."""
        return math.prod(self.shape)


def read_npy_header(stream: IO[bytes]) -> NpyHeader:
    """Read the header of an NPY file; `stream` then stands at the numbers.

    Raises
    ------
    ValueError
        When there is none, or the array is not one of plain values.
    """
    start = stream.read(8)
    if start[:6] != MAGIC or start[6:] not in (b"\x01\x00", b"\x02\x00", b"\x03\x00"):
        raise ValueError("it does not begin as an array of NumPy does")
    length = int.from_bytes(stream.read(2 if start[6] == 1 else 4), "little")
    text = stream.read(min(length, LONGEST)).decode("latin-1")
    found = PLAIN.fullmatch(text)
    if found is None or len(text) != length:
        raise ValueError("its header is not that of an array of plain values")
    try:
        dtype = np.dtype(found["dtype"])
    except TypeError:
        raise ValueError(f"its values are of the unknown kind {found['dtype']}") from None
    shape = tuple(int(number) for number in re.findall(r"\d+", found["shape"]))
    return NpyHeader(dtype, shape, found["fortran"] == "True")
