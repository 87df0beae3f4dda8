"""A pattern without a picture: as Unicode Braille and in words."""

from __future__ import annotations

from itertools import groupby

import numpy as np
from numpy.typing import NDArray

from encoders import bits_to_cell

__all__ = ["in_braille", "in_words"]

Floats = NDArray[np.float64]

# Bits of the dots of a cell of four rows and two columns (ISO 11548-1).
BITS = np.array([[1, 8], [2, 16], [4, 32], [64, 128]])
MOST_ROWS = 16


def in_braille(amplitude: Floats) -> str:
    """Raised dots as a picture of 8-dot cells, lines separated by a newline.

    Parameters
    ----------
    amplitude : float64, shape (rows, cols), 0..1; what is above 0 is raised.
    """
    rows, cols = amplitude.shape
    padded = np.zeros((-(-rows // 4) * 4, -(-cols // 2) * 2), np.bool_)
    padded[:rows, :cols] = amplitude > 0
    cells = padded.reshape(len(padded) // 4, 4, -1, 2).transpose(0, 2, 1, 3)
    bits = (cells * BITS).sum(axis=(2, 3))
    return "\n".join("".join(bits_to_cell(int(value)) for value in line) for line in bits)


def in_words(amplitude: Floats) -> str:
    """How many dots are raised, how they mirror one another, and which they are, row by row.

    Rows are told for grids of up to 16 of them; columns count from 1.
    """
    raised = amplitude > 0
    count = int(raised.sum())
    parts = [f"{count} of {raised.size} dots raised" + _mirrors(amplitude)]
    if count and len(raised) <= MOST_ROWS:
        parts += [f"Row {number}: {_row(line)}" for number, line in enumerate(amplitude, 1)]
    return ". ".join(parts) + "."


def _mirrors(amplitude: Floats) -> str:
    ways = [
        name
        for axis, name in ((1, "left and right"), (0, "top and bottom"))
        if np.array_equal(amplitude, np.flip(amplitude, axis))
    ]
    return f", {' and '.join(ways)} alike" if ways and amplitude.any() else ""


def _row(line: Floats) -> str:
    said: dict[float, list[str]] = {1.0: [], 0.5: []}
    place = 1
    for strength, run in groupby(line.tolist()):
        last = place + len(list(run)) - 1
        if strength:
            said[strength].append(f"{place}" if last == place else f"{place} to {last}")
        place = last + 1
    parts = [", ".join(said[1.0]), ", ".join(said[0.5]) + " at half strength" if said[0.5] else ""]
    return "; ".join(part for part in parts if part) or "none"
