"""Curves through values and slopes, and the best broken line through such a curve."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

__all__ = ["broken_line"]

Floats = NDArray[np.float64]

# Four-point Gauss-Legendre rule on [0, 1].
_ABSCISSAE, _WEIGHTS = np.polynomial.legendre.leggauss(4)
_ABSCISSAE, _WEIGHTS = (_ABSCISSAE + 1) / 2, _WEIGHTS / 2


def _at(values: Floats, slopes: Floats, x: Floats) -> Floats:
    """Cubic Hermite interpolation over equally spaced nodes of [0, 1]; axis 1 is the nodes."""
    pieces = values.shape[1] - 1
    piece = np.minimum((x * pieces).astype(np.intp), pieces - 1)
    u = (x * pieces - piece)[:, None]
    left, right = values[:, piece], values[:, piece + 1]
    rise, fall = slopes[:, piece] / pieces, slopes[:, piece + 1] / pieces
    return np.asarray(
        left + u * (rise + u * (3 * (right - left) - 2 * rise - fall + u * (2 * (left - right) + rise + fall)))
    )


@cache
def _interior_inverse(pieces: int) -> Floats:
    """Inverse of the hat functions' mass matrix without its end nodes, in units of 1/pieces."""
    size = pieces - 1
    matrix = (
        np.diag(np.full(size, 2 / 3)) + np.diag(np.full(size - 1, 1 / 6), 1) + np.diag(np.full(size - 1, 1 / 6), -1)
    )
    return np.asarray(np.linalg.inv(matrix))


def broken_line(values: Floats, slopes: Floats, pieces: int) -> Floats:
    """The broken line nearest to a curve in the mean square, exact at both ends.

    A line drawn through points of the curve lies on one side of it, and that bias is slow: a chain of
    resonators magnifies it a million times. The error of the nearest line is orthogonal to all broken lines,
    so what is left of it is fast and does no harm.

    Parameters
    ----------
    values, slopes : float64, shape (P, nodes, C), the curve over [0, 1] at equally spaced nodes.
    pieces : straight pieces of equal length, 2 or more.

    Returns
    -------
    float64, shape (P, pieces + 1, C).
    """
    count, _, channels = values.shape
    x = (np.arange(pieces)[:, None] + _ABSCISSAE).ravel() / pieces
    curve = _at(values, slopes, x).reshape(count, pieces, 4, channels)
    left = np.einsum("q,pkqc->pkc", _WEIGHTS * (1 - _ABSCISSAE), curve)
    right = np.einsum("q,pkqc->pkc", _WEIGHTS * _ABSCISSAE, curve)
    load = left[:, 1:] + right[:, :-1]
    load[:, 0] -= values[:, 0] / 6
    load[:, -1] -= values[:, -1] / 6
    inner = np.einsum("ij,pjc->pic", _interior_inverse(pieces), load)
    return np.concatenate([values[:, :1], inner, values[:, -1:]], axis=1)
