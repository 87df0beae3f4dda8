"""How the dots of a page are given to the fingers: together, row by row, or dot by dot; and read back."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..choices import Presentation
from ..errors import LayoutError
from ..scene import TargetPattern
from .dots import blocks
from .layout import Layout

__all__ = ["MIN_PART_S", "ShownPage", "presenter", "read_cells", "read_page"]

MIN_PART_S = 0.6
"""A part of a page lasts at least this long: up to 0.35 s of ramp, and 0.25 s to feel it."""
WHOLE = (Presentation.TOGETHER, Presentation.SCROLL)
"""Presentations of all dots of a page, or of a line, at a time."""
_CACHE_BYTES = 16_000_000


class ShownPage(NamedTuple):
    """A page ready to be shown: its `cells` as lines, and its patterns one after another."""

    cells: str
    parts: tuple[TargetPattern, ...]


def presenter(layout: Layout, presentation: Presentation) -> Callable[[str], ShownPage]:
    """A function from a page of cells (lines run together) to what is shown; it remembers recent pages."""
    places = _places(layout)
    dots_of = blocks(layout.height)
    shape = (layout.shape.rows, layout.shape.cols)
    width, spots = layout.cells_per_line, places.reshape(-1)

    def show(page: str) -> ShownPage:
        # The low byte of U+28xx says which dots there are.
        codes = np.frombuffer(page.encode("utf-16-le"), dtype=np.uint8)[::2]
        grid = np.zeros(shape, dtype=np.complex128)
        grid.put(spots, dots_of.take(codes, axis=0))
        lines = "\n".join([page[at : at + width] for at in range(0, len(page), width)])
        return ShownPage(lines, tuple([_pattern(part) for part in _parts(grid, places, presentation)]))

    size = 16 * shape[0] * shape[1] * (1 if presentation in WHOLE else layout.height * layout.lines)
    return lru_cache(maxsize=max(16, min(4096, _CACHE_BYTES // size)))(show)


def _places(layout: Layout) -> NDArray[np.intp]:
    """Flat index on the grid of each dot: intp, shape (cells of a page, height, 2)."""
    line, cell, row, col = np.ogrid[: layout.lines, : layout.cells_per_line, : layout.height, :2]
    rows = line * (layout.height + layout.line_gap) + row
    cols = cell * (2 + layout.cell_gap) + col
    flat: NDArray[np.intp] = (rows * layout.shape.cols + cols).astype(np.intp)
    return flat.reshape(layout.capacity, layout.height, 2)


def _parts(
    grid: NDArray[np.complex128], places: NDArray[np.intp], presentation: Presentation
) -> list[NDArray[np.complex128]]:
    if presentation in WHOLE:
        return [grid]
    flat = np.arange(grid.size).reshape(grid.shape)
    if presentation is Presentation.BY_ROW:
        groups = list(flat)
    else:
        groups = [places[:, row, col] for col in (0, 1) for row in range(min(3, places.shape[1]))]
        groups += [places[:, row, col] for row in range(3, places.shape[1]) for col in (0, 1)]
    parts = []
    for group in groups:
        part = np.zeros_like(grid)
        part.reshape(-1)[group] = grid.reshape(-1)[group]
        if part.any():
            parts.append(part)
    return parts or [grid]


def _pattern(amplitude: NDArray[np.complex128]) -> TargetPattern:
    amplitude.flags.writeable = False
    return TargetPattern(amplitude)


def read_cells(dots: NDArray[np.bool_], encoding: Mapping[str, Any]) -> str:
    """Cells felt on the grid, lines separated by a newline, as in `Frame.cells`.

    Parameters
    ----------
    dots : bool, shape (rows, cols), which actuators are felt; of a page shown in parts, all parts or-ed.
    encoding : of the scene; ``dots``, ``cell_gap``, ``line_gap``, ``lines`` and ``cells_per_line`` are used.

    Raises
    ------
    LayoutError
        When the array is too small for the layout.
    """
    height = 3 if encoding["dots"] == 6 else 4
    row_step, col_step = height + int(encoding["line_gap"]), 2 + int(encoding["cell_gap"])
    lines, width = int(encoding["lines"]), int(encoding["cells_per_line"])
    rows, cols = (lines - 1) * row_step + height, (width - 1) * col_step + 2
    if dots.ndim != 2 or dots.shape[0] < rows or dots.shape[1] < cols:
        raise LayoutError(f"dots: expected at least {rows} x {cols} actuators, got shape {dots.shape}")
    row, col = _reading(height, lines, width, row_step, col_step)
    felt = dots[row, col]
    codes = (felt * _WEIGHTS[:height]).sum(axis=(2, 3), dtype=np.uint16) + np.uint16(0x2800)
    return "\n".join(codes[at].astype("<u2").tobytes().decode("utf-16-le") for at in range(lines))


def read_page(parts: Sequence[NDArray[np.bool_]], encoding: Mapping[str, Any]) -> str:
    """Cells felt of a page that was shown in parts, as `read_cells`: all parts together.

    Of a text that scrolls the parts are the patterns that travelled by, one after another. What is felt at the right
    edge of each is put side by side, and read.
    """
    if encoding.get("presentation") != Presentation.SCROLL:
        return read_cells(np.any(parts, axis=0), encoding)
    passed = np.stack([part[:, -1] for part in parts], axis=1)
    length = int(encoding["cells_per_line"]) * (2 + int(encoding["cell_gap"]))
    strip = np.zeros((len(passed), length), dtype=np.bool_)
    count = min(length, passed.shape[1])
    strip[:, :count] = passed[:, :count]
    return read_cells(strip, encoding)


_WEIGHTS = np.array([[1, 8], [2, 16], [4, 32], [64, 128]], dtype=np.uint16)


@lru_cache(maxsize=16)
def _reading(
    height: int, lines: int, width: int, row_step: int, col_step: int
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    line, cell, row, col = np.ogrid[:lines, :width, :height, :2]
    return line * row_step + row, cell * col_step + col
