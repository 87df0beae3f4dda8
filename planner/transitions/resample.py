"""Curves over [0, 1] computed at few points, Chebyshev's, and given at many equally spaced ones."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

__all__ = ["chebyshev_points", "converged", "resampled"]

Floats = NDArray[np.float64]

# The last so many coefficients of a curve that its points describe are nothing beside its largest value.
LAST, NOTHING = 4, 1e-9


@cache
def chebyshev_points(count: int) -> Floats:
    """``(1 - cos(pi k / (count - 1))) / 2``, both ends among them; float64, shape (count,)."""
    points: Floats = (1 - np.cos(np.pi * np.arange(count) / (count - 1))) / 2
    points.flags.writeable = False
    return points


def resampled(values: Floats, nodes: int) -> Floats:
    """The polynomials through values at Chebyshev's points, at equally spaced nodes.

    Parameters
    ----------
    values : float64, shape (P, points, C).

    Returns
    -------
    float64, shape (P, nodes, C); each curve's numbers do not depend on the others.
    """
    return np.asarray(np.matmul(_interpolation(values.shape[1], nodes), values))


@cache
def _interpolation(points: int, nodes: int) -> Floats:
    """Barycentric interpolation; float64, shape (nodes, points)."""
    weights = (-1.0) ** np.arange(points)
    weights[[0, -1]] /= 2
    away = np.linspace(0.0, 1.0, nodes)[:, None] - chebyshev_points(points)
    there = np.abs(away) < 1e-15
    matrix: Floats = weights / np.where(there, 1.0, away)
    matrix /= matrix.sum(axis=1, keepdims=True)
    hit = there.any(axis=1)
    matrix[hit] = there[hit]
    return matrix


def converged(values: Floats) -> NDArray[np.bool_]:
    """Whether polynomials through values at Chebyshev's points are the curves themselves, by their last coefficients.

    Parameters
    ----------
    values : float64, shape (P, points, C).

    Returns
    -------
    bool, shape (P,); all C curves of each.
    """
    last = np.abs(np.matmul(_coefficients(values.shape[1]), values)).max(axis=1)
    return np.asarray((last <= NOTHING * np.abs(values).max(axis=1)).all(axis=1))


@cache
def _coefficients(points: int) -> Floats:
    """The last coefficients of the Chebyshev series; float64, shape (LAST, points)."""
    k = np.arange(points)
    order = np.arange(points - 1 - LAST, points - 1)[:, None]
    weights = np.full(points, 2 / (points - 1))
    weights[[0, -1]] /= 2
    # The points run upwards, the cosines downwards.
    return np.asarray(weights * np.cos(np.pi * order * (points - 1 - k) / (points - 1)))
