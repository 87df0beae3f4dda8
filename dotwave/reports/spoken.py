"""A verified waveform as text: what the pictures show, for a screen reader or a Braille display."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from .text import FrameCheck, VerifyReport, decibels

__all__ = ["spoken"]

Floats = NDArray[np.float64]

WIDEST_LEVELS = 12
"""Wider grids get the range of their levels instead of every level."""


def spoken(report: VerifyReport) -> Iterator[str]:
    """Lines (without newline) that say everything the pictures of `report` show."""
    yield report.as_text()
    yield ""
    yield "In the patterns below o is a raised dot and . is a flat one; the first row is the top of the grid."
    for number, frame in enumerate(report.frames, 1):
        yield ""
        yield f"Frame {number} of {len(report.frames)}, page {frame.page + 1}."
        yield from _frame(frame)


def _frame(frame: FrameCheck) -> Iterator[str]:
    yield f"Time: {frame.start_s:.2f} to {frame.end_s:.2f} s, settled at {frame.settled_s:.2f} s."
    yield f"Text: {' '.join(frame.text.split()) or '(none)'}"
    if frame.wanted_cells.strip() or frame.felt_cells.strip():
        yield f"Cells wanted: {_one_line(frame.wanted_cells)}"
        same = frame.felt_cells == frame.wanted_cells
        yield f"Cells felt: {'the same' if same else _one_line(frame.felt_cells)}"
    if frame.outcome != "ok":
        yield f"Outcome: {frame.outcome}."
    yield "Dots wanted:"
    yield from _pattern(frame.wanted_dots)
    if np.array_equal(frame.wanted_dots, frame.felt_dots):
        yield "Dots felt: the same."
    else:
        yield f"Dots felt, {frame.wrong_dots} wrong:"
        yield from _pattern(frame.felt_dots)
    error = f"amplitude error {100 * frame.amplitude_error:.2f} %"
    yield f"Contrast {decibels(frame.contrast_db)}, {error}."
    yield from _levels(frame)


def _one_line(cells: str) -> str:
    return " / ".join(cells.split("\n"))


def _pattern(dots: NDArray[np.bool_]) -> Iterator[str]:
    for row in dots:
        yield " ".join("o" if dot else "." for dot in row)


def _levels(frame: FrameCheck) -> Iterator[str]:
    """Felt levels in dB of full scale: the range of both kinds of dots, and all of them on small grids."""
    levels = _in_db(frame.felt)
    for name, chosen in (("raised", frame.wanted_dots), ("flat", ~frame.wanted_dots)):
        if chosen.any():
            low, high = levels[chosen].min(), levels[chosen].max()
            yield f"Levels where a dot should be {name}: {_level(low)} to {_level(high)} dB."
    if levels.shape[1] <= WIDEST_LEVELS:
        yield "Levels felt, dB of full scale:"
        yield from (" ".join(_level(level) for level in row) for row in levels)


def _in_db(amplitude: Floats) -> Floats:
    with np.errstate(divide="ignore"):
        levels: Floats = 20 * np.log10(np.abs(amplitude))
    return levels


def _level(level: float) -> str:
    return "silent" if level < -99 else f"{round(level, 1) + 0.0:.1f}"
