"""Cells that somebody else wrote, such as a screen reader, put on a grid as they are: cell for cell."""

from __future__ import annotations

from typing import Any

from ..choices import Presentation
from ..errors import LayoutError
from ..scene import Frame, GridShape
from .dots import BLANK
from .layout import Layout
from .presentation import presenter

__all__ = ["CellGrid", "are_cells"]


def are_cells(what: str) -> bool:
    """Whether a text is nothing but Unicode Braille and ends of lines."""
    return all(char == "\n" or "\u2800" <= char <= "\u28ff" for char in what)


class CellGrid:
    """A grid as a display of `lines` x `cells_per_line` cells, without gaps.

    Parameters
    ----------
    dots : of a cell, 6 or 8; None: 8 where the rows make cells of four and not of three, else 6. Of 6, dots 7 and 8 of
        what is shown are left out.

    Raises
    ------
    LayoutError
        When the grid has no room for one cell, or cells have other dots.

    Examples
    --------
    >>> from encoders import CellGrid, GridShape
    >>> grid = CellGrid(GridShape(6, 6))
    >>> grid.lines, grid.cells_per_line
    (2, 3)
    >>> grid.frame("⠓⠊").cells
    '⠓⠊⠀\\n⠀⠀⠀'
    """

    def __init__(self, shape: GridShape, dots: int | None = None) -> None:
        if dots not in (None, 6, 8):
            raise LayoutError(f"dots: expected 6 or 8, got {dots}")
        fours = shape.rows % 4 == 0 and shape.rows % 3 != 0
        self.dots = dots or (8 if fours else 6)
        self._layout = Layout(shape, 4 if self.dots == 8 else 3)
        self._show = presenter(self._layout, Presentation.TOGETHER)

    @property
    def lines(self) -> int:
        """Lines of cells."""
        return self._layout.lines

    @property
    def cells_per_line(self) -> int:
        """Cells in a line."""
        return self._layout.cells_per_line

    @property
    def encoding(self) -> dict[str, Any]:
        """What `read_cells` needs to read the dots."""
        return {
            "kind": "cells", "dots": self.dots, "cell_gap": 0, "line_gap": 0, "lines": self.lines,
            "cells_per_line": self.cells_per_line,
        }  # fmt: skip

    def frame(self, cells: str, text: str = "") -> Frame:
        """Cells in reading order, as a frame that shows `text`; a newline ends a line, what is missing is blank.

        Raises
        ------
        LayoutError
            When there are more than the grid has room for, or they are no cells.
        """
        if not are_cells(cells):
            raise LayoutError(f"cells: expected characters U+2800..U+28FF, got {cells!r:.40}")
        width, page = self.cells_per_line, ""
        for line in cells.split("\n"):
            page += line + BLANK * (-len(line) % width)
        page = page.ljust(self._layout.capacity, BLANK)
        if len(page) > self._layout.capacity:
            raise LayoutError(f"cells: {len(cells)} do not fit into {self.lines} x {width}; show so many at a time")
        shown = self._show(page)
        return Frame(shown.parts[0], 1.0, text=text, cells=shown.cells)
