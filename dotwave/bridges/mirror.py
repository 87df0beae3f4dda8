"""What is felt, in the terminal: a line for each change, which a screen reader can read."""

from __future__ import annotations

from typing import TextIO

from ..plain import one_line
from .window import BLANK_CELL

__all__ = ["LiveMirror", "dot_numbers"]

_SPELLED = 12  # cells; the dots of more are too long a line


class LiveMirror:
    """Writes plain lines, never over what stands.

    Parameters
    ----------
    out : where to.
    per_line : cells in a line of the grid.
    """

    def __init__(self, out: TextIO, per_line: int) -> None:
        self._out, self._per_line = out, per_line

    def stood(self, cells: str, text: str, latency_s: float | None) -> None:
        """A pattern stands now."""
        lines = [cells[at : at + self._per_line] for at in range(0, len(cells), self._per_line)]
        parts = [" ".join(lines) or "at rest"]
        if cells and len(cells) <= _SPELLED:
            parts.append(f"dots {dot_numbers(cells)}")
        if text.strip():
            parts.append(one_line(text.strip()))
        if latency_s is not None:
            parts.append(f"{1e3 * latency_s:.0f} ms")
        self.say("; ".join(parts))

    def say(self, words: str) -> None:
        """A line."""
        self._out.write(words + "\n")
        self._out.flush()


def dot_numbers(cells: str) -> str:
    """Cells as numbers of their dots, a 0 for none: ``125 15 0 123``."""
    bits = (ord(cell) - BLANK_CELL for cell in cells)
    return " ".join("".join(str(dot + 1) for dot in range(8) if one >> dot & 1) or "0" for one in bits)
