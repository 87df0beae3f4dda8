"""The best broken line through a curve that is given by values and slopes."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..drive import cubic

__all__ = ["broken_line"]

Floats = NDArray[np.float64]

# Four-point Gauss-Legendre rule on [0, 1].
_ABSCISSAE, _WEIGHTS = np.polynomial.legendre.leggauss(4)
_ABSCISSAE, _WEIGHTS = (_ABSCISSAE + 1) / 2, _WEIGHTS / 2


class _Moments(NamedTuple):
    """Integrals of a curve times the hat functions of inner corners, by what its nodes from `first` on contribute.

    first : intp, shape (corners,). of_values, of_slopes : float64, shape (width, corners).
    """

    first: NDArray[np.intp]
    of_values: Floats
    of_slopes: Floats


@lru_cache(maxsize=64)
def _moments(nodes: int, pieces: int) -> _Moments:
    """In units of 1/pieces; those of the hat functions at both ends, which are given, are taken off."""
    x = (np.arange(pieces)[:, None] + _ABSCISSAE).ravel() / pieces
    unit, nothing = np.eye(nodes), np.zeros((nodes, nodes))
    loads = []
    for values, slopes in ((unit, nothing), (nothing, unit / (nodes - 1))):
        curve = cubic(x * (nodes - 1), np.arange(nodes, dtype=np.float64), values, slopes).reshape(pieces, 4, nodes)
        left = np.einsum("q,kqc->kc", _WEIGHTS * (1 - _ABSCISSAE), curve)
        right = np.einsum("q,kqc->kc", _WEIGHTS * _ABSCISSAE, curve)
        loads.append(left[1:] + right[:-1])
    loads[0][0, 0] -= 1 / 6
    loads[0][-1, -1] -= 1 / 6
    touched = (loads[0] != 0) | (loads[1] != 0)
    last = nodes - np.argmax(touched[:, ::-1], axis=1)
    width = int(np.max(last - np.argmax(touched, axis=1)))
    first = np.minimum(np.argmax(touched, axis=1), nodes - width)
    place = first + np.arange(width)[:, None]
    return _Moments(first, *(load[np.arange(pieces - 1), place] for load in loads))


@lru_cache(maxsize=64)
def _pivots(size: int) -> Floats:
    """Pivots of the hat functions' mass matrix without its end nodes, 2/3 beside 1/6, in units of 1/pieces."""
    found = [2 / 3]
    while len(found) < size:
        found.append(2 / 3 - 1 / 36 / found[-1])
    return np.array(found)


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
    float64, shape (P, pieces + 1, C); each curve's numbers do not depend on the others.
    """
    nodes = values.shape[1]
    moments = _moments(nodes, pieces)
    load = np.zeros((len(values), pieces - 1, values.shape[2]))
    for past, (of_values, of_slopes) in enumerate(zip(moments.of_values, moments.of_slopes, strict=True)):
        load += of_values[:, None] * values[:, moments.first + past]
        load += of_slopes[:, None] * slopes[:, moments.first + past]
    inner = np.ascontiguousarray(load.transpose(1, 0, 2))
    pivots = _pivots(len(inner))
    corners, shares = list(inner), (1 / (6 * pivots)).tolist()
    for before, here, share in zip(corners, corners[1:], shares, strict=False):
        here -= share * before
    inner /= pivots[:, None, None]
    for here, after, share in zip(corners[-2::-1], corners[::-1], shares[-2::-1], strict=False):
        here -= share * after
    return np.concatenate([values[:, :1], inner.transpose(1, 0, 2), values[:, -1:]], axis=1)
