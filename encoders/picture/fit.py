"""The pattern that is most like a figure: which part of the picture is laid on the grid, and which dots are raised."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ..scene import GridShape
from .climb import climbed, nearby, neighbours, swept
from .options import Fit
from .similarity import POINTS, Target, agreement, quadratics, target_of
from .steps import content_box

__all__ = ["Candidate", "Fitted", "Window", "best_patterns", "choose_windows", "plain_size", "sampled"]

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

CLIMBED_WINDOWS = 3
DENSE_DOTS = 144
CLOSER_BY = 1 / 13
CUTS = (0.3, 0.45, 0.6, 0.75)
SYMMETRIC = 0.93


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


def choose_windows(
    figure: NDArray[np.float32], shape: GridShape, fit: Fit, pitch_m: tuple[float, float], crop: bool
) -> list[Window]:
    """Windows worth trying: the plain fit, and for `contain` small changes of size, width and place.

    A figure that fills the grid is cut by up to 1/26 on each side (a quarter of an actuator of six), or stretched
    by up to a fifth; one that leaves room is moved by half an actuator, unless it is symmetric in that direction.
    `cover` tries cuts of 1/13 in all.
    """
    height, width = figure.shape
    top, bottom, left, right = content_box(figure) if crop else (0, height, 0, width)
    tall, wide = bottom - top, right - left
    middle = (top + bottom) / 2, (left + right) / 2
    if fit is Fit.STRETCH:
        return [Window(top, bottom, left, right)]
    high_m, wide_m = shape.rows * pitch_m[0], shape.cols * pitch_m[1]
    by_rows, by_cols = tall / high_m, wide / wide_m
    if fit is Fit.COVER:
        scale = min(by_rows, by_cols)
        return _closer_by_a_little(middle, scale * high_m, scale * wide_m)
    scale = max(by_rows, by_cols)
    if not crop:
        return [_around(middle, scale * high_m, scale * wide_m)]
    mirror = symmetries(figure[top:bottom, left:right])
    found: dict[Window, None] = {}
    for closer in (1.0, 1 - CLOSER_BY):
        for stretch in (1.0, 1 / 1.1, 1 / 1.2, 1 / 0.9):
            down = scale * closer * high_m * (stretch if by_rows < by_cols else 1.0)
            across = scale * closer * wide_m * (stretch if by_rows >= by_cols else 1.0)
            down, across = max(down, tall * (1 - CLOSER_BY)), max(across, wide * (1 - CLOSER_BY))
            for up in _moves(tall / down * shape.rows, shape.rows, mirror[0]):
                for aside in _moves(wide / across * shape.cols, shape.cols, mirror[1]):
                    place = middle[0] - up * down / shape.rows, middle[1] - aside * across / shape.cols
                    found.setdefault(_around(place, down, across))
    return list(found)


def _closer_by_a_little(middle: tuple[float, float], height: float, width: float) -> list[Window]:
    """The window itself, and smaller ones inside of it, in the middle and at its corners."""
    found = [_around(middle, height, width)]
    for down, across in ((0, 0), (-1, -1), (-1, 1), (1, -1), (1, 1)):
        place = middle[0] + down * CLOSER_BY / 2 * height, middle[1] + across * CLOSER_BY / 2 * width
        found.append(_around(place, (1 - CLOSER_BY) * height, (1 - CLOSER_BY) * width))
    return found


def _around(middle: tuple[float, float], height: float, width: float) -> Window:
    return Window(middle[0] - height / 2, middle[0] + height / 2, middle[1] - width / 2, middle[1] + width / 2)


def _moves(covered: float, available: int, symmetric: bool) -> tuple[float, ...]:
    return (0.0,) if symmetric or covered > available - 0.4 else (-0.5, 0.0, 0.5)


def symmetries(figure: NDArray[np.float32]) -> tuple[bool, bool]:
    """Whether a figure is its own mirror image top to bottom, and left to right, seen with 24 x 24 points."""
    if min(figure.shape) < 2:
        return False, False
    coarse = sampled(figure, [Window(0, figure.shape[0], 0, figure.shape[1])], GridShape(6, 6))[0]
    return _mirrored(coarse, 0), _mirrored(coarse, 1)


def _mirrored(figure: Floats, axis: int) -> bool:
    less = figure - figure.mean()
    return float((less * np.flip(less, axis)).sum()) >= SYMMETRIC * float((less**2).sum())


def best_patterns(figure: NDArray[np.float32], windows: list[Window], shape: GridShape, count: int) -> Fitted:
    """Search windows and dots for the patterns most similar to a figure.

    Every window is scored with four thresholds of the mean over each dot; the best three windows are searched on
    by flips of one and of two dots (mirror images together, where the figure is symmetric) until none helps.

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
    target = target_of(sampled(figure, windows, shape), shape)
    starts = cut_starts(target.figure, shape)
    scores = agreement(target, starts)
    order = np.argsort(-scores.max(axis=1), kind="stable")
    order = order[: CLIMBED_WINDOWS if shape.rows * shape.cols <= DENSE_DOTS else 1]
    found: dict[bytes, tuple[float, Bools, int]] = {}
    for index in order:
        for similarity, dots in _searched(target[int(index)], starts[index], scores[index], count):
            key = dots.tobytes()
            if key not in found or similarity > found[key][0]:
                found[key] = similarity, dots, int(index)
    ranked = sorted(found.items(), key=lambda item: (-item[1][0], item[0]))[:count]
    candidates = tuple(
        Candidate(_frozen(dots.reshape(shape.rows, shape.cols)), similarity, windows[index])
        for _, (similarity, dots, index) in ranked
    )
    return Fitted(candidates, target.figure[ranked[0][1][2]])


def cut_starts(figure: Floats, shape: GridShape) -> Floats:
    """Patterns by thresholds of the mean of each dot; float64, shape (K, 4, rows, cols)."""
    means = figure.reshape(len(figure), shape.rows, POINTS, shape.cols, POINTS).mean(axis=(2, 4))
    top = means.max(axis=(1, 2), keepdims=True)
    cuts: Floats = np.stack([means > cut * top for cut in CUTS], axis=1).astype(np.float64)
    return cuts


def _searched(target: Target, starts: Floats, scores: Floats, count: int) -> list[tuple[float, Bools]]:
    shape, size = target.shape, target.shape.rows * target.shape.cols
    if target.flat[0]:
        mean = float(target.figure.mean())
        return [(max(mean, 1 - mean), np.full(size, mean > 0.5))]
    if size > DENSE_DOTS:
        best = int(scores.argmax())
        return nearby(target, swept(target, starts[best]), count)
    parts = quadratics(target)
    ties = tied_dots(target.figure[0], shape)
    order = np.argsort(-scores, kind="stable")[:2]
    begins = {starts[int(k)].tobytes(): starts[int(k)].ravel() > 0.5 for k in order}
    tops = {climbed(parts, begin, ties).tobytes(): None for begin in begins.values()}
    found: list[tuple[float, Bools]] = []
    for raw in tops:
        found += neighbours(parts, np.frombuffer(raw, np.bool_), count)
    return found


def tied_dots(figure: Floats, shape: GridShape) -> Floats:
    """Which dots go together: float64, shape (dots, groups), 1 where a dot is in a group."""
    return _ties(shape, _mirrored(figure, 0), _mirrored(figure, 1))


@lru_cache(maxsize=64)
def _ties(shape: GridShape, down: bool, across: bool) -> Floats:
    groups = np.arange(shape.rows * shape.cols).reshape(shape.rows, shape.cols)
    for axis, symmetric in enumerate((down, across)):
        if symmetric:
            groups = np.minimum(groups, np.flip(groups, axis))
    ties: Floats = (groups.reshape(-1, 1) == np.unique(groups)).astype(np.float64)
    return ties


def _frozen(dots: Bools) -> Bools:
    dots.flags.writeable = False
    return dots
