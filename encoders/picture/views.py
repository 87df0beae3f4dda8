"""Looking at a big picture in parts: an overview, then windows in reading order."""

from __future__ import annotations

import math
from dataclasses import dataclass

__all__ = ["View", "views"]


@dataclass(frozen=True)
class View:
    """A part of a picture.

    Attributes
    ----------
    top, bottom, left, right : edges in pixels, bottom and right not included.
    name : ``overview``, or ``row i of m, column j of n``.
    """

    top: int
    bottom: int
    left: int
    right: int
    name: str


def views(height: int, width: int, aspect: float, zoom: int, overlap: float) -> tuple[View, ...]:
    """The whole picture, and when `zoom` > 1 windows of its parts, left to right, top to bottom.

    The windows have the grid's form and are 1/zoom as large as the one that holds the whole picture; neighbours
    share at least `overlap` (0..0.9) of their size; the outer ones end at the picture's edges.

    Parameters
    ----------
    aspect : width over height of the grid, in metres.
    """
    whole = View(0, height, 0, width, "overview")
    if zoom == 1:
        return (whole,)
    tall = max(height, width / aspect) / zoom
    rows, columns = _spans(height, tall, overlap), _spans(width, tall * aspect, overlap)
    parts = [
        View(*down, *across, f"row {i} of {len(rows)}, column {j} of {len(columns)}")
        for i, down in enumerate(rows, start=1)
        for j, across in enumerate(columns, start=1)
    ]
    return (whole, *parts)


def _spans(size: int, wanted: float, overlap: float) -> list[tuple[int, int]]:
    part = max(1, math.ceil(wanted))
    if part >= size:
        return [(0, size)]
    step = max(1.0, part * (1 - overlap))
    count = math.ceil((size - part) / step - 1e-9) + 1
    starts = [round(k * (size - part) / (count - 1)) for k in range(count)]
    return [(start, start + part) for start in starts]
