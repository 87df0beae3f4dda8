"""What was wanted beside what is felt, as a figure of matplotlib."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..reports.text import VerifyReport

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from .shown import ShownFigure

__all__ = ["felt_figure"]

INCH, DISC_POINTS = 2.6, 130.0


def felt_figure(report: VerifyReport, most: int, words: str) -> ShownFigure:
    """A row for each of the first `most` frames: wanted on the left, felt on the right; `words` is the same as text.

    Raises
    ------
    ValueError
        When there is no frame to draw.
    """
    from .shown import ShownFigure

    frames = report.frames[:most]
    if not frames:
        raise ValueError(f"figure: nothing to draw, {len(report.frames)} frames and most = {most}")
    figure = ShownFigure(words, figsize=(2 * INCH, INCH * len(frames)), layout="constrained")
    places = figure.subplots(len(frames), 2, squeeze=False)
    for number, (frame, (left, right)) in enumerate(zip(frames, places, strict=True), 1):
        _discs(left, frame.target, f"frame {number}, wanted")
        _discs(right, frame.felt, f"felt, error {100 * frame.amplitude_error:.2f} %")
    return figure


def _discs(axes: Axes, level: NDArray[np.float64], title: str) -> None:
    rows, cols = level.shape
    row, col = np.mgrid[:rows, :cols]
    size = DISC_POINTS * 6 / max(rows, cols)
    axes.scatter(col, row, s=size, facecolors="none", edgecolors="0.75", linewidths=0.6)
    axes.scatter(col, row, s=size * np.nan_to_num(np.abs(level)) ** 2, color="black")
    axes.set(title=title, xlim=(-0.6, cols - 0.4), ylim=(rows - 0.4, -0.6), aspect="equal", xticks=[], yticks=[])
