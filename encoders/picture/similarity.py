"""How alike a pattern of dots and a picture are, as one number.

A finger does not feel the outline of single dots, so a pattern p is drawn with a square for each dot and, like the
figure T, blurred by a Gaussian f with a standard deviation of half an actuator; both are compared on a lattice of
4 x 4 points an actuator. The similarity of U = f * sum_i p_i square(x - x_i) and V = f * T is

    S = 1/2 corr(U, V) + 1/2 corr(U - g*U, V - g*V),

with corr the correlation coefficient and g a Gaussian with a standard deviation of two actuators: the first half asks
for the right masses, the second for the right structure beside one another (holes, gaps, strokes). It is at most 1,
does not change when the figure becomes fainter, and is negative for the inverse picture.

All points weigh the same, so each half is c.p / sqrt(p.M.p) with an M that hangs on the grid alone. That is what makes
the search quick.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ..scene import GridShape

__all__ = [
    "DENSE_DOTS",
    "POINTS",
    "SHARES",
    "Target",
    "agreement",
    "matrices",
    "pulls",
    "ratio",
    "similarities",
    "squares",
    "target_of",
]

Floats = NDArray[np.float64]

POINTS = 4
BLUR = 0.5
SURROUND = 2.0
SHARES = (0.5, 0.5)
DENSE_DOTS = 144
"""Grids of more dots have no matrix M; products with it are worked out along rows and columns."""

FLAT = 1e-9
FAINT = 0.1
RIPPLE = 0.05


@dataclass(frozen=True)
class Target:
    """Figures to be matched, K of them on the lattice of one grid.

    Attributes
    ----------
    shape : the grid.
    figure : float64, shape (K, 4 rows, 4 cols), 0..1.
    flat : bool, shape (K,), filled or empty throughout, so that a correlation says nothing.
    linear : for each half of the measure its c, float64, shape (K, rows * cols); zero where the figure is flat.
    """

    shape: GridShape
    figure: Floats
    flat: NDArray[np.bool_]
    linear: tuple[Floats, ...]

    def __getitem__(self, index: int) -> Target:
        """One of the figures, as a target with K = 1."""
        one = slice(index, index + 1)
        return Target(self.shape, self.figure[one], self.flat[one], tuple(half[one] for half in self.linear))


@dataclass(frozen=True)
class _Lattice:
    """Along rows and along columns: dots drawn as blurred squares, the figure's blur, and the surroundings."""

    drawn: tuple[Floats, Floats]
    soft: tuple[Floats, Floats]
    around: tuple[Floats, Floats]


@lru_cache(maxsize=16)
def _lattice(shape: GridShape) -> _Lattice:
    drawn, soft, around = [], [], []
    for count in (shape.rows, shape.cols):
        blur = _gauss(count, BLUR)
        soft.append(blur)
        around.append(_gauss(count, SURROUND))
        drawn.append(blur @ np.kron(np.eye(count), np.ones((POINTS, 1))))
    return _Lattice((drawn[0], drawn[1]), (soft[0], soft[1]), (around[0], around[1]))


def _gauss(count: int, sigma: float) -> Floats:
    points = (np.arange(count * POINTS) + 0.5) / POINTS
    bell = np.exp(-(((points[:, None] - points) / sigma) ** 2) / 2)
    shares: Floats = bell / bell.sum(axis=1, keepdims=True)
    return shares


def target_of(figure: Floats, shape: GridShape) -> Target:
    """What many patterns can be compared with.

    Parameters
    ----------
    figure : float64, shape (K, 4 rows, 4 cols), 0..1.
    """
    figure = np.asarray(figure, np.float64)
    lattice = _lattice(shape)
    linear = []
    for half, fine in _halves(lattice.soft[0] @ figure @ lattice.soft[1].T, lattice):
        less = half - half.mean(axis=(1, 2), keepdims=True)
        spread = np.sqrt((less**2).mean(axis=(1, 2), keepdims=True))
        unit = np.where(spread > FLAT**0.5, less / np.maximum(spread, FLAT), 0.0)
        linear.append(_back(unit, fine, lattice).reshape(len(figure), -1))
    filled = (figure.std(axis=(1, 2)) < FAINT) & (figure.mean(axis=(1, 2)) > 0.5)
    flat = filled | (np.ptp(figure, axis=(1, 2)) < RIPPLE)
    return Target(shape, figure, flat, tuple(linear))


def agreement(target: Target, dots: Floats) -> Floats:
    """Similarity of patterns with the figures of a target.

    Parameters
    ----------
    dots : float64, shape (K, A, rows, cols) or (A, rows, cols) when K = 1, amplitudes 0..1.

    Returns
    -------
    float64, shape (K, A), -1..1; 0 for a flat pattern. When the figure is flat, 1 less the mean distance of the
    dots from its mean.
    """
    dots = np.asarray(dots, np.float64)
    dots = dots[None] if dots.ndim == 3 else dots
    flat = dots.reshape(*dots.shape[:2], -1)
    total = np.zeros(dots.shape[:2])
    for share, linear, pull in zip(SHARES, target.linear, pulls(target.shape, flat), strict=True):
        total += share * ratio((linear[:, None] * flat).sum(axis=2), (flat * pull).sum(axis=2))
    apart = np.abs(dots - target.figure.mean(axis=(1, 2))[:, None, None, None]).mean(axis=(2, 3))
    return np.where(target.flat[:, None], 1 - apart, total)


def ratio(top: Floats, square: Floats) -> Floats:
    """One half of the measure; 0 where the pattern is flat."""
    found: Floats = np.where(square > FLAT, top / np.sqrt(np.maximum(square, FLAT)), 0.0)
    return found


def similarities(figure: Floats, amplitudes: Floats) -> Floats:
    """Similarity of patterns with one figure; float64, shape (A,).

    Parameters
    ----------
    figure : float64, shape (4 rows, 4 cols), 0..1.
    amplitudes : float64, shape (A, rows, cols), 0..1.
    """
    target = target_of(figure[None], GridShape(*amplitudes.shape[1:]))
    found: Floats = agreement(target, amplitudes)[0]
    return found


def pulls(shape: GridShape, dots: Floats) -> list[Floats]:
    """M p of each half for patterns of shape (..., rows * cols); the same shape."""
    if shape.rows * shape.cols <= DENSE_DOTS:
        return [dots @ matrix for matrix in matrices(shape)]
    lattice = _lattice(shape)
    rows, cols = lattice.drawn
    found = []
    for half, fine in _halves(rows @ dots.reshape(*dots.shape[:-1], shape.rows, shape.cols) @ cols.T, lattice):
        found.append(_back(half - half.mean(axis=(-2, -1), keepdims=True), fine, lattice).reshape(dots.shape))
    return found


@lru_cache(maxsize=16)
def matrices(shape: GridShape) -> tuple[Floats, ...]:
    """M of each half; float64, shape (dots, dots)."""
    lattice = _lattice(shape)
    rows, cols = lattice.drawn
    drawn = np.einsum("yr,xc->rcyx", rows, cols).reshape(shape.rows * shape.cols, len(rows), len(cols))
    found = []
    for half, _ in _halves(drawn, lattice):
        less = (half - half.mean(axis=(1, 2), keepdims=True)).reshape(len(half), -1)
        found.append(less @ less.T / less.shape[1])
    return tuple(found)


@lru_cache(maxsize=16)
def squares(shape: GridShape) -> tuple[Floats, ...]:
    """The diagonal of M of each half; float64, shape (rows * cols,)."""
    if shape.rows * shape.cols <= DENSE_DOTS:
        return tuple(np.diag(matrix).copy() for matrix in matrices(shape))
    lattice = _lattice(shape)
    far = [around @ drawn for around, drawn in zip(lattice.around, lattice.drawn, strict=True)]
    found = []
    for fine in (0.0, 1.0):
        sides = [
            [(drawn**2).sum(axis=0), (drawn * blurred).sum(axis=0), (blurred**2).sum(axis=0), drawn.sum(axis=0)
             , blurred.sum(axis=0)]
            for drawn, blurred in zip(lattice.drawn, far, strict=True)
        ]  # fmt: skip
        own, across, beyond, mass, far_mass = (np.outer(down, right) for down, right in zip(*sides, strict=True))
        size = len(lattice.drawn[0]) * len(lattice.drawn[1])
        mean = (mass - fine * far_mass) / size
        found.append(((own - fine * 2 * across + fine * beyond) / size - mean**2).ravel())
    return tuple(found)


def _halves(values: Floats, lattice: _Lattice) -> Iterator[tuple[Floats, bool]]:
    """What each half of the measure compares, and whether it is without its surroundings."""
    rows, cols = lattice.around
    yield values, False
    yield values - rows @ values @ cols.T, True


def _back(values: Floats, fine: bool, lattice: _Lattice) -> Floats:
    """The mean over the lattice of values times what each dot adds to a half; shape (..., rows, cols)."""
    if fine:
        rows, cols = lattice.around
        values = values - rows.T @ values @ cols
    found: Floats = lattice.drawn[0].T @ values @ lattice.drawn[1] / (values.shape[-1] * values.shape[-2])
    return found
