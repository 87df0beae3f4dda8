"""One cell as a character U+2800..U+28FF, as bits (bit 0 = dot 1), and as a block of dots on the grid."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["BLANK", "HIGHEST_6_DOT", "LOWER_SIX", "bits_to_cell", "blocks", "cell_to_bits"]

BLANK = "\u2800"
HIGHEST_6_DOT = "\u283f"
LOWER_SIX = {code: 0x2800 | (code & 0x3F) for code in range(0x2840, 0x2900)}
"""For `str.translate`: leaves dots 7 and 8 of every cell out."""

# Row and column inside the cell of dots 1..8 (ISO 11548-1).
_PLACES = ((0, 0), (1, 0), (2, 0), (0, 1), (1, 1), (2, 1), (3, 0), (3, 1))


def cell_to_bits(cell: str) -> int:
    """Bits 0..255 of one Braille character.

    Raises
    ------
    ValueError
        When `cell` is not one character of U+2800..U+28FF.
    """
    if len(cell) != 1 or not "\u2800" <= cell <= "\u28ff":
        raise ValueError(f"cell: expected one character U+2800..U+28FF, got {cell!r}")
    return ord(cell) - 0x2800


def bits_to_cell(bits: int) -> str:
    """The Braille character of `bits`.

    Raises
    ------
    ValueError
        When `bits` is not in 0..255.
    """
    if not 0 <= bits <= 255:
        raise ValueError(f"bits: expected 0..255, got {bits}")
    return chr(0x2800 + bits)


def blocks(height: int) -> NDArray[np.bool_]:
    """The dots of all 256 cells: bool, shape (256, height, 2), read-only; `height` 3 leaves dots 7 and 8 out."""
    table = np.zeros((256, 4, 2), dtype=np.bool_)
    for dot, (row, col) in enumerate(_PLACES):
        table[:, row, col] = (np.arange(256) >> dot) & 1
    cut = np.ascontiguousarray(table[:, :height])
    cut.flags.writeable = False
    return cut
