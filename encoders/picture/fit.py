"""The pattern that is most like a figure: which part of the picture is laid on the grid, and which dots are raised."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..scene import GridShape
from .climb import climbed, nearby, neighbours, swept
from .held import dot_means, sure_dots, tied_dots
from .options import Fit
from .similarity import DENSE_DOTS, POINTS, Target, agreement, target_of
from .steps import content_box, otsu

__all__ = ["Candidate", "Fitted", "Window", "best_patterns", "choose_window", "plain_size", "sampled"]

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

CLIMBED = 3
CUTS = (0.3, 0.45, 0.6, 0.75)


@dataclass(frozen=True)
class Window:
    """The part of a picture that is laid on the grid, in pixels; it may reach beyond the picture."""

    top: float
    bottom: float
    left: float
    right: float


@dataclass(frozen=True)
class Candidate:
    """A good pattern.

    Attributes
    ----------
    dots : bool, shape (rows, cols), read-only.
    similarity : with the figure in `window`, at most 1.
    window : the part of the picture, in pixels of the figure.
    """

    dots: Bools
    similarity: float
    window: Window


@dataclass(frozen=True)
class Fitted:
    """Candidates, best first, all different; and the figure on the lattice for the best one's window.

    Attributes
    ----------
    figure : float64, shape (4 rows, 4 cols), 0..1.
    """

    candidates: tuple[Candidate, ...]
    figure: Floats


def sampled(figure: NDArray[np.float32], windows: list[Window], shape: GridShape) -> Floats:
    """Mean of a figure over the cells of the lattice, for each window; beyond the figure is ground.

    Returns
    -------
    float64, shape (len(windows), 4 rows, 4 cols).
    """
    rows = _shares([(w.top, w.bottom) for w in windows], shape.rows * POINTS, figure.shape[0])
    cols = _shares([(w.left, w.right) for w in windows], shape.cols * POINTS, figure.shape[1])
    means: Floats = (rows @ figure @ cols.transpose(0, 2, 1)).astype(np.float64)
    return means


def _shares(spans: list[tuple[float, float]], cells: int, pixels: int) -> NDArray[np.float32]:
    """Share of every pixel in every cell, shape (spans, cells, pixels); the rows sum to 1 inside the picture."""
    ends = np.asarray(spans)
    steps = np.linspace(0, 1, cells + 1)
    places = ends[:, :1] + (ends[:, 1:] - ends[:, :1]) * steps
    inside = np.clip(places[:, :, None] - np.arange(pixels), 0, 1)
    shares: NDArray[np.float32] = (np.diff(inside, axis=1) / np.diff(places, axis=1)[..., None]).astype(np.float32)
    return shares


def plain_size(
    figure: NDArray[np.float32], shape: GridShape, fit: Fit, pitch_m: tuple[float, float], crop: bool
) -> tuple[float, float]:
    """Height and width, in pixels, of the plain fit: the part of the picture that is laid on the whole grid."""
    top, bottom, left, right = content_box(figure) if crop else (0, figure.shape[0], 0, figure.shape[1])
    if fit is Fit.STRETCH:
        return bottom - top, right - left
    high_m, wide_m = shape.rows * pitch_m[0], shape.cols * pitch_m[1]
    by_rows, by_cols = (bottom - top) / high_m, (right - left) / wide_m
    scale = min(by_rows, by_cols) if fit is Fit.COVER else max(by_rows, by_cols)
    return scale * high_m, scale * wide_m


def choose_window(
    figure: NDArray[np.float32], shape: GridShape, fit: Fit, pitch_m: tuple[float, float], crop: bool
) -> Window:
    """The part of a picture that is laid on the grid: the plain fit around the middle of the content.

    Other sizes and places can raise the similarity, but patterns in their true place are known more often.
    """
    height, width = figure.shape
    top, bottom, left, right = content_box(figure) if crop else (0, height, 0, width)
    high, wide = plain_size(figure, shape, fit, pitch_m, crop)
    return _around(((top + bottom) / 2, (left + right) / 2), high, wide)


def _around(middle: tuple[float, float], height: float, width: float) -> Window:
    return Window(middle[0] - height / 2, middle[0] + height / 2, middle[1] - width / 2, middle[1] + width / 2)


def best_patterns(figure: NDArray[np.float32], window: Window, shape: GridShape, count: int) -> Fitted:
    """Search the dots for the patterns most similar to a figure.

    The start is four thresholds of the mean over each dot, and Otsu's: what a plain box filter gives is among what
    is tried. What `held` says is sure stays. Each is improved by flips of one dot, with those that go together, until
    none helps, the best of them by flips of two as well.

    Parameters
    ----------
    figure : float32, shape (height, width), 0..1.
    count : how many patterns are wanted.

    Returns
    -------
    Fitted
        With at least one candidate; more, up to `count`, are found near the best ones: by flips of one and two dots,
        on grids of more than 144 dots of one.
    """
    target = target_of(sampled(figure, [window], shape), shape)
    found: dict[bytes, tuple[float, Bools]] = {}
    for similarity, dots in _searched(target, count):
        found.setdefault(dots.tobytes(), (similarity, dots))
    ranked = sorted(found.items(), key=lambda item: (-item[1][0], item[0]))[:count]
    candidates = tuple(
        Candidate(_frozen(dots.reshape(shape.rows, shape.cols)), similarity, window) for _, (similarity, dots) in ranked
    )
    return Fitted(candidates, target.figure[0])


def cut_starts(figure: Floats, shape: GridShape) -> Floats:
    """Patterns by thresholds of the mean of each dot; float64, shape (K, rows, cols)."""
    means = dot_means(figure, shape)
    cuts = [*(cut * means.max() for cut in CUTS), otsu(means.astype(np.float32))[0]]
    starts: Floats = np.stack([means > cut for cut in cuts]).astype(np.float64)
    return starts


def _searched(target: Target, count: int) -> list[tuple[float, Bools]]:
    shape, size = target.shape, target.shape.rows * target.shape.cols
    if target.flat[0]:
        mean = float(target.figure.mean())
        return [(max(mean, 1 - mean), np.full(size, mean > 0.5))]
    starts = cut_starts(target.figure[0], shape)
    if size > DENSE_DOTS:
        best = int(agreement(target, starts)[0].argmax())
        return nearby(target, swept(target, starts[best]), count)
    ties = tied_dots(target.figure[0], shape)
    sure = sure_dots(target.figure[0], shape).along(ties)
    begins = ((starts.reshape(len(starts), -1) > 0.5) | sure.raised) & ~sure.flat
    tops, values = climbed(target, begins, ties, sure.free)
    order = np.argsort(-values, kind="stable")[: 1 if count == 1 else CLIMBED]
    found: list[tuple[float, Bools]] = []
    for index in order:
        found += neighbours(target, tops[index], sure.free, count)
    top = max(value for value, _ in found)
    if len(found) < count:
        # What is sure gives way where nothing else is left to tell icons apart by.
        more = neighbours(target, tops[order[0]], np.ones(size, np.bool_), count)
        found += [one for one in more if one[0] < top]
    return found


def _frozen(dots: Bools) -> Bools:
    dots.flags.writeable = False
    return dots
