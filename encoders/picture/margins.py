"""How clearly a pattern is its own icon's, in a set: more like its figure than like those it could be taken for."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from ..scene import GridShape
from .similarity import POINTS, SHARES, pulls, ratio, target_of

__all__ = ["margins"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

RIVALS = 12
BESIDE = 0.7
# Figures compared at a time, so that some ten thousand take megabytes.
BLOCK = 256


def margins(figures: Floats, patterns: Sequence[Floats], similarity: Sequence[Floats]) -> list[Floats]:
    """What each pattern is worth where the set is known.

    It is the similarity with its own figure, less 0.7 of the greatest similarity with one of the twelve figures of the
    set that are most like it. A dot that says what is peculiar to an icon counts more than one that says nothing.

    Parameters
    ----------
    figures : float64, shape (N, 4 rows, 4 cols), 0..1.
    patterns : of each icon, float64, shape (its patterns, rows, cols), 0..1.
    similarity : of each of them with its figure.

    Returns
    -------
    For each icon float64, shape (its patterns,); the similarity itself in a set of one.
    """
    if len(figures) < 2:
        return [np.asarray(own, np.float64) for own in similarity]
    shape = GridShape(figures.shape[1] // POINTS, figures.shape[2] // POINTS)
    linear = [np.concatenate(half) for half in zip(*_linear(figures, shape), strict=True)]
    found = []
    for own, some, rivals in zip(similarity, patterns, _rivals(figures, shape), strict=True):
        flat = some.reshape(len(some), -1)
        others = np.zeros((len(flat), len(rivals)))
        for share, half, pull in zip(SHARES, linear, pulls(shape, flat), strict=True):
            others += share * ratio(flat @ half[rivals].T, (flat * pull).sum(axis=1)[:, None])
        found.append(np.asarray(own - BESIDE * others.max(axis=1), np.float64))
    return found


def _linear(figures: Floats, shape: GridShape) -> Iterator[tuple[Floats, ...]]:
    for start in range(0, len(figures), BLOCK):
        yield target_of(figures[start : start + BLOCK], shape).linear


def _rivals(figures: Floats, shape: GridShape) -> Iterator[Ints]:
    """For each figure the indices of those most like it."""
    means = figures.reshape(len(figures), shape.rows, POINTS, shape.cols, POINTS).mean(axis=(2, 4))
    flat = means.reshape(len(figures), -1)
    flat = flat - flat.mean(axis=1, keepdims=True)
    unit = flat / np.maximum(np.linalg.norm(flat, axis=1, keepdims=True), 1e-9)
    for start in range(0, len(unit), BLOCK):
        # Rounded, so that another order of sums does not decide between equals.
        like = np.round(unit[start : start + BLOCK] @ unit.T, 9)
        like[np.arange(len(like)), np.arange(start, start + len(like))] = -np.inf
        for row in like:
            yield np.argsort(-row, kind="stable")[: min(RIVALS, len(unit) - 1)]
