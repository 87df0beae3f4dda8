"""How a line of cells stands on a grid: folded where the grid is narrow, six dots or eight, with the cursor drawn."""

from __future__ import annotations

from dataclasses import dataclass

from .window import BrailleWindow, braille_of

__all__ = ["CURSOR_PERIOD_S", "GridFold"]

CURSOR_PERIOD_S = 2.0
"""The cursor blinks: half of this it is drawn, half of it not. A grid needs up to 0.35 s for each change."""
_NARROW = 8  # as in `encoders.braille.layout`: in shorter lines no word has room


@dataclass(frozen=True)
class GridFold:
    """Cells of a grid in reading order.

    Attributes
    ----------
    lines, per_line : of cells on the grid.
    dots : of a cell, 6 or 8.
    """

    lines: int
    per_line: int
    dots: int = 6

    @property
    def capacity(self) -> int:
        """Cells on the grid."""
        return self.lines * self.per_line

    @property
    def columns(self) -> int:
        """Cells of a line as screen readers are told: they cut and pan in lines, so a narrow grid is one line."""
        return self.capacity if self.per_line < _NARROW else self.per_line

    @property
    def rows(self) -> int:
        """Lines as screen readers are told."""
        return self.capacity // self.columns

    def place(self, cell: int) -> tuple[int, int]:
        """Line and column on the grid of a cell."""
        return cell // self.per_line, cell % self.per_line

    def braille(self, window: BrailleWindow, cursor_drawn: bool = False) -> str:
        """What is felt, all cells of the grid as Unicode Braille: dots that a cell has not are left out.

        Parameters
        ----------
        window : of up to `capacity` cells.
        cursor_drawn : whether the cursor, where there is one, covers its cell now.
        """
        mask = 0x3F if self.dots == 6 else 0xFF
        cells = bytearray(bits & mask for bits in window.cells[: self.capacity].ljust(self.capacity, b"\0"))
        if cursor_drawn and window.cursor is not None and window.cursor < self.capacity:
            cells[window.cursor] = _covered(cells[window.cursor], 0x3F if self.dots == 6 else 0xC0)
        return braille_of(bytes(cells))


def _covered(cell: int, by: int) -> int:
    """A cell under the cursor, which must differ from the cell without it."""
    return cell | by if cell | by != cell else cell & ~by
