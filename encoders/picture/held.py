"""What the measure of likeness must not decide: dots that are sure from the figure, and dots that go together.

A blur sees no difference between a solid body and one with a dot missing, nor between a straight line and a comb of
dots along it; a finger and an eye do.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..scene import GridShape
from .similarity import POINTS

__all__ = ["Sure", "dot_means", "sure_dots", "tied_dots"]

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

# A dot is raised that is covered so much. Of a part of the figure that covers half a dot the
# fullest dot is raised, and the gap around a small one, covered less than that, is flat.
SOLID, PART, GAP = 0.65, 0.5, 0.25
# Icons that are nearly symmetric have their mark in what is not.
SYMMETRIC = 0.99
# So many dots in a line, covered alike, are a straight edge of the figure.
STRAIGHT, ALIKE = 5, 0.02


@dataclass(frozen=True)
class Sure:
    """Dots that the figure decides; bool, shape (dots,).

    Attributes
    ----------
    raised, flat : no dot is both.
    """

    raised: Bools
    flat: Bools

    @property
    def free(self) -> Bools:
        """The others."""
        return ~(self.raised | self.flat)

    def along(self, ties: Floats) -> Sure:
        """The same for all that go together; what is raised counts more than what is flat."""
        raised, flat = (ties @ (ties.T @ dots) > 0 for dots in (self.raised, self.flat))
        return Sure(raised, flat & ~raised)


def dot_means(figure: Floats, shape: GridShape) -> Floats:
    """How much of each dot a figure on the lattice covers; float64, shape (rows, cols)."""
    means: Floats = figure.reshape(shape.rows, POINTS, shape.cols, POINTS).mean(axis=(1, 3))
    return means


def sure_dots(figure: Floats, shape: GridShape) -> Sure:
    """Solid places are raised, and of every part of the figure something; around a small part there is a gap.

    Parameters
    ----------
    figure : float64, shape (4 rows, 4 cols), 0..1.
    """
    from scipy.ndimage import label

    means = dot_means(figure, shape)
    raised, flat = means >= SOLID, np.zeros(means.shape, np.bool_)
    parts, count = label(figure >= 0.5, np.ones((3, 3)))
    for number in range(1, count + 1 if count > 1 else 1):
        mine = dot_means((parts == number) * figure, shape)
        place = np.unravel_index(mine.argmax(), mine.shape)
        if mine.sum() < PART or raised[mine > 0].any():
            continue
        raised[place] = True
        for down, right in ((-1, 0), (1, 0), (0, -1), (0, 1)):
            row, col = int(place[0]) + down, int(place[1]) + right
            if 0 <= row < shape.rows and 0 <= col < shape.cols and means[row, col] < GAP:
                flat[row, col] = True
    return Sure(raised.ravel(), (flat & ~raised).ravel())


def tied_dots(figure: Floats, shape: GridShape) -> Floats:
    """Which dots go together: mirror images where the figure is symmetric, and dots along a straight edge.

    Returns
    -------
    float64, shape (dots, groups), 1 where a dot is in a group.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    means = dot_means(figure, shape)
    places = np.arange(means.size).reshape(means.shape)
    links = []
    for axis, size in enumerate(means.shape):
        if _mirrored(figure, axis):
            links.append((places.ravel(), np.flip(places, axis).ravel()))
        if size >= STRAIGHT:
            lines = np.lib.stride_tricks.sliding_window_view(means, STRAIGHT, axis=axis)
            along = np.lib.stride_tricks.sliding_window_view(places, STRAIGHT, axis=axis)
            straight = along[np.ptp(lines, axis=-1) <= ALIKE]
            links.append((np.repeat(straight[:, 0], STRAIGHT), straight.ravel()))
    pairs = np.concatenate([np.stack(pair) for pair in links], axis=1) if links else np.empty((2, 0), np.intp)
    graph = coo_array((np.ones(pairs.shape[1]), tuple(pairs)), shape=(means.size, means.size))
    groups = connected_components(graph, directed=False)[1]
    ties: Floats = (groups[:, None] == np.unique(groups)).astype(np.float64)
    return ties


def _mirrored(figure: Floats, axis: int) -> bool:
    less = figure - figure.mean()
    return float((less * np.flip(less, axis)).sum()) >= SYMMETRIC * float((less**2).sum())
