"""Text that scrolls: one line of cells that moves to the left, column by column, under a finger that is still."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..choices import PageNumbering, TextOptions
from ..errors import LayoutError
from ..scene import Frame, GridShape, TargetPattern
from ..travel import LEAD_S, QUICKEST, SLOWEST
from .dots import BLANK
from .layout import Layout

__all__ = ["scroll_layout", "scrolled"]

LINE_CELLS = 40
"""Cells that are laid out together; a word is cut only where it is longer."""
SCROLL_RATE = 1.0
"""Cells that pass in a second where nothing else is asked."""
LEAST_GAP = 1
"""Free columns between cells: a finger that is still has nothing else to tell one cell from the next."""


def scroll_layout(shape: GridShape, height: int, options: TextOptions) -> Layout:
    """The layout of lines that pass over a grid.

    Raises
    ------
    LayoutError
        When the grid is too low for a cell, or an option asks for what a text that scrolls has not.
    """
    if options.dwell_s is not None:
        raise LayoutError("dwell: a text that scrolls does not stand; give a rate, cells per second")
    if options.page_numbers is not PageNumbering.NONE:
        raise LayoutError("page-numbers: a text that scrolls has no pages; choose none")
    # Refuses a grid without room for one cell.
    Layout(shape, height)
    gap = max(LEAST_GAP, options.cell_gap)
    if not SLOWEST <= (2 + gap) * (options.rate or SCROLL_RATE) <= QUICKEST:
        ends = f"{SLOWEST / (2 + gap):.3g} to {QUICKEST / (2 + gap):.3g}"
        raise LayoutError(f"rate: a text scrolls by {ends} cells a second, got {options.rate:g}")
    return Layout(GridShape(height, LINE_CELLS * (2 + gap) - gap), height, gap)


def scrolled(lines: Iterable[Frame], layout: Layout, shape: GridShape, rate: float | None) -> Iterator[Frame]:
    """The frames of lines that scroll in the uppermost rows of a grid.

    The first is blank and stands; then comes one for every column of the lines, each of which ends with a blank cell.
    The text enters at the right edge and leaves at the left, so that all of it passes every column of the grid.

    Parameters
    ----------
    lines : one frame each, as `scroll_layout` lays them out.
    rate : cells that pass in a second; None: `SCROLL_RATE`.
    """
    step_s = 1 / ((2 + layout.cell_gap) * (rate or SCROLL_RATE))
    window = np.zeros((shape.rows, shape.cols), dtype=np.complex128)
    line: Frame | None = None
    for page in lines:
        if line is None:
            yield replace(page, pattern=_seen(window), dwell_s=LEAD_S, headings=(), leads=True)
        line = page
        for column in _columns(page, layout, shape):
            yield replace(line, pattern=_entered(window, column), dwell_s=step_s, travels=True)
            # The first frame has the headings.
            line = replace(line, headings=())
    if line is not None:
        for _ in range(shape.cols):
            yield replace(line, pattern=_entered(window, 0.0), dwell_s=step_s, travels=True)


def _columns(page: Frame, layout: Layout, shape: GridShape) -> NDArray[np.complex128]:
    """The columns of a line and of the blank cell behind it, as rows; each as high as the grid."""
    count = (2 + layout.cell_gap) * (len(page.cells.rstrip(BLANK)) + 1)
    strip = np.zeros((count, shape.rows), dtype=np.complex128)
    held = page.pattern.amplitude.T[:count]
    strip[: len(held), : layout.height] = held
    return strip


def _entered(window: NDArray[np.complex128], column: NDArray[np.complex128] | float) -> TargetPattern:
    """What is seen when all of a window, which it changes, goes to the left and a column enters at the right."""
    window[:, :-1] = window[:, 1:].copy()
    window[:, -1] = column
    return _seen(window)


def _seen(window: NDArray[np.complex128]) -> TargetPattern:
    amplitude = window.copy()
    amplitude.flags.writeable = False
    return TargetPattern(amplitude)
