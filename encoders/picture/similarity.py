"""How alike a pattern of dots and a picture are, as one number.

Between dots the finger feels the sum of their neighbourhoods, so a pattern p is drawn up to U = sum_i p_i k(x - x_i),
with k the product of two tents that fall to 0 at the next dot (bilinear up-sampling), and compared with the figure T on
a lattice of 4 x 4 points an actuator. Points count w(x) = 1 + |grad T|/max |grad T|: the outline counts twice. The
similarity is

    S = 1/2 corr_w(U, T) + 1/2 corr_w(U - g*U, T - g*T),

with corr_w the weighted correlation coefficient and g a Gaussian with a standard deviation of 1.5 actuators: the first
half asks for the right masses, the second for the right structure beside one another (holes, gaps, strokes). It is at
most 1, does not change when the figure becomes fainter, and is negative for the inverse picture.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ..scene import GridShape

__all__ = ["POINTS", "Quadratic", "Slope", "Target", "agreement", "quadratics", "similarities", "slopes", "target_of"]

Floats = NDArray[np.float64]

POINTS = 4
SURROUND = 1.5
SHARES = (0.5, 0.5)
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
    weight : the same shape, sum 1 for each.
    flat : bool, shape (K,), filled or empty throughout, so that a correlation says nothing.
    centred : for each half of the measure the figure less its weighted mean, over its weighted standard
        deviation, times the weight; zero where the figure is flat.
    """

    shape: GridShape
    figure: Floats
    weight: Floats
    flat: NDArray[np.bool_]
    centred: tuple[Floats, ...]

    def __getitem__(self, index: int) -> Target:
        """One of the figures, as a target with K = 1."""
        one = slice(index, index + 1)
        halves = tuple(half[one] for half in self.centred)
        return Target(self.shape, self.figure[one], self.weight[one], self.flat[one], halves)


@dataclass(frozen=True)
class Quadratic:
    """One half of the measure as a function of the dots: share (c.p)/sqrt(p.M.p).

    Attributes
    ----------
    share : its part of the whole.
    linear : float64, shape (n,).
    matrix : float64, shape (n, n).
    """

    share: float
    linear: Floats
    matrix: Floats


@dataclass(frozen=True)
class Slope:
    """One half of the measure around one pattern, for grids of any size.

    With c and M of `Quadratic`: top = c.p, square = p.M.p, and as arrays of shape (rows, cols) linear = c,
    pull = M p and diagonal = diag M.
    """

    share: float
    top: float
    square: float
    linear: Floats
    pull: Floats
    diagonal: Floats


@dataclass(frozen=True)
class _Lattice:
    tents: tuple[Floats, Floats]
    blurs: tuple[Floats, Floats]


@lru_cache(maxsize=16)
def _lattice(shape: GridShape) -> _Lattice:
    tents, blurs = [], []
    for count in (shape.rows, shape.cols):
        points = (np.arange(count * POINTS) + 0.5) / POINTS
        tents.append(np.clip(1 - np.abs(points[:, None] - (np.arange(count) + 0.5)), 0, 1))
        blur = np.exp(-(((points[:, None] - points) / SURROUND) ** 2) / 2)
        blurs.append(blur / blur.sum(axis=1, keepdims=True))
    return _Lattice((tents[0], tents[1]), (blurs[0], blurs[1]))


def target_of(figure: Floats, shape: GridShape) -> Target:
    """Weights and moments of figures, so that many patterns can be compared with them.

    Parameters
    ----------
    figure : float64, shape (K, 4 rows, 4 cols), 0..1.
    """
    figure = np.asarray(figure, np.float64)
    outline = _outline(figure)
    top = outline.max(axis=(1, 2), keepdims=True, initial=0.0)
    weight = 1 + outline / np.maximum(top, FLAT)
    weight /= weight.sum(axis=(1, 2), keepdims=True)
    centred = []
    for half in _halves(figure, _lattice(shape)):
        less = half - (weight * half).sum(axis=(1, 2), keepdims=True)
        variance = (weight * less**2).sum(axis=(1, 2), keepdims=True)
        centred.append(np.where(variance > FLAT, weight * less / np.sqrt(np.maximum(variance, FLAT)), 0.0))
    filled = (figure.std(axis=(1, 2)) < FAINT) & (figure.mean(axis=(1, 2)) > 0.5)
    flat = filled | (np.ptp(figure, axis=(1, 2)) < RIPPLE)
    return Target(shape, figure, weight, flat, tuple(centred))


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
    lattice = _lattice(target.shape)
    rows, cols = lattice.tents
    total = np.zeros(dots.shape[:2])
    for share, half, centred in zip(SHARES, _halves(rows @ dots @ cols.T, lattice), target.centred, strict=True):
        weight = target.weight[:, None]
        mean = (weight * half).sum(axis=(2, 3))
        variance = (weight * half**2).sum(axis=(2, 3)) - mean**2
        covariance = (centred[:, None] * half).sum(axis=(2, 3))
        total += np.where(variance > FLAT, share * covariance / np.sqrt(np.maximum(variance, FLAT)), 0.0)
    apart = np.abs(dots - target.figure.mean(axis=(1, 2))[:, None, None, None]).mean(axis=(2, 3))
    return np.where(target.flat[:, None], 1 - apart, total)


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


def quadratics(target: Target) -> list[Quadratic]:
    """The measure for the first figure of a target in closed form, for grids of some hundred dots."""
    weight = target.weight[0].ravel()
    found = []
    for share, basis, centred in zip(SHARES, _bases(target.shape), target.centred, strict=True):
        mean = basis @ weight
        matrix = _product(basis * weight, basis) - np.outer(mean, mean)
        found.append(Quadratic(share, basis @ centred[0].ravel(), matrix))
    return found


def _product(left: Floats, right: Floats) -> Floats:
    """left @ right.T in pieces: small products stay on one core, so that a worker on each core is not in the way."""
    points = left.shape[1]
    piece = points if points > 1024 else points // 4
    stacked = [values.reshape(len(values), -1, piece).transpose(1, 0, 2) for values in (left, right)]
    total: Floats = (stacked[0] @ stacked[1].transpose(0, 2, 1)).sum(axis=0)
    return total


def slopes(target: Target, dots: Floats) -> list[Slope]:
    """The measure for the first figure of a target around a pattern of shape (rows, cols)."""
    lattice = _lattice(target.shape)
    rows, cols = lattice.tents
    blurred = lattice.blurs[0] @ rows, lattice.blurs[1] @ cols
    weight = target.weight[0]
    found = []
    drawn = rows @ dots @ cols.T
    for share, half, centred, fine in zip(SHARES, _halves(drawn, lattice), target.centred, (0.0, 1.0), strict=True):

        def back(values: Floats, left: Floats = rows, right: Floats = cols) -> Floats:
            return left.T @ values @ right

        def onto(values: Floats, fine: float = fine) -> Floats:
            return back(values) - fine * back(values, *blurred)

        squares = back(weight, rows**2, cols**2)
        if fine:
            squares += back(weight, blurred[0] ** 2, blurred[1] ** 2)
            squares -= 2 * back(weight, rows * blurred[0], cols * blurred[1])
        less = half - (weight * half).sum()
        mean = onto(weight)
        top, square = float((centred[0] * half).sum()), float((weight * less**2).sum())
        found.append(Slope(share, top, square, onto(centred[0]), onto(weight * less), squares - mean**2))
    return found


@lru_cache(maxsize=16)
def _bases(shape: GridShape) -> tuple[Floats, ...]:
    """What each dot adds to each half of the measure; float64, shape (dots, points)."""
    lattice = _lattice(shape)
    rows, cols = lattice.tents
    drawn = np.einsum("yr,xc->rcyx", rows, cols).reshape(shape.rows * shape.cols, len(rows), len(cols))
    return tuple(np.ascontiguousarray(half.reshape(len(half), -1)) for half in _halves(drawn, lattice))


def _halves(values: Floats, lattice: _Lattice) -> Iterator[Floats]:
    rows, cols = lattice.blurs
    yield values
    yield values - rows @ values @ cols.T


def _outline(figure: Floats) -> Floats:
    """Size of the gradient over three points, shape (K, height, width); the border is repeated."""
    wide = np.pad(figure, ((0, 0), (1, 1), (1, 1)), mode="edge")
    down = wide[:, 2:] - wide[:, :-2]
    right = wide[:, :, 2:] - wide[:, :, :-2]
    down = down[:, :, :-2] + 2 * down[:, :, 1:-1] + down[:, :, 2:]
    right = right[:, :-2] + 2 * right[:, 1:-1] + right[:, 2:]
    size: Floats = np.hypot(down, right)
    return size
