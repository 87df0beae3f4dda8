"""How small deviations of an open chain, or grid, from the motion it is meant to do ring on: linear, exact in time."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from chainsim import Chain

__all__ = ["carried", "exponential", "first_harmonic", "ringing"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

# Terms of the series of an exponential, once its matrix was halved below `HALVED`.
TERMS, HALVED = 12, 0.5


def ringing(chain: Chain, lam: Floats, amplitude: Floats) -> Floats:
    """The matrix M of ``x' = M x`` (in tau) for deviations x = (z, v) from a motion under links that stay.

    The cubic spring counts with its mean over a cycle, ``(3/2) beta a^2``.

    Parameters
    ----------
    lam : float64, shape (..., n-1); of a grid its links to the right, row by row, then those downwards.
    amplitude : float64, shape (..., n), of the motion, dimensionless.

    Returns
    -------
    float64, shape (..., 2n, 2n).
    """
    n = chain.n
    whole = np.zeros((*lam.shape[:-1], 2 * n, 2 * n))
    at = np.arange(n)
    whole[..., at, n + at] = 1.0
    whole[..., n + at, n + at] = -np.asarray(chain.deltas)
    whole[..., n + at, at] = -(chain.stiffness + 1.5 * np.asarray(chain.betas) * amplitude**2)
    along = chain.rows * (chain.cols - 1)
    right = np.flatnonzero(at % chain.cols)
    for fed, step, links in ((right, 1, lam[..., :along]), (at[chain.cols :], chain.cols, lam[..., along:])):
        whole[..., n + fed, fed] -= links
        whole[..., n + fed, fed - step] = links
    return whole


def exponential(matrix: Floats) -> Floats:
    """e to the power of square matrices, float64, shape (..., N, N)."""
    largest = float(np.abs(matrix).sum(axis=-1).max(initial=0.0))
    halvings = max(0, math.ceil(math.log2(max(largest / HALVED, 1.0))))
    small = matrix / 2**halvings
    found = np.eye(matrix.shape[-1]) + np.zeros_like(matrix)
    for term in range(TERMS, 0, -1):
        found = np.eye(matrix.shape[-1]) + small @ found / term
    for _ in range(halvings):
        found = found @ found
    return np.asarray(found)


def carried(chain: Chain, lam: Floats, amplitude: Floats, duration: float) -> Floats:
    """What a change makes of a deviation that was there when it began: its end is this matrix times its begin.

    Parameters
    ----------
    lam : float64, shape (L, n-1), L > 1: links at evenly spaced instants of the change.
    amplitude : float64, shape (L, n), of the motion there.
    duration : in tau.

    Returns
    -------
    float64, shape (2n, 2n).
    """
    pieces = exponential(
        ringing(chain, (lam[1:] + lam[:-1]) / 2, (amplitude[1:] + amplitude[:-1]) / 2) * (duration / (len(lam) - 1))
    )
    while len(pieces) > 1:
        # In pairs, the later from the left.
        odd = pieces[len(pieces) & ~1 :]
        pieces = np.concatenate([pieces[1::2] @ pieces[: len(pieces) & ~1 : 2], odd])
    return np.asarray(pieces[0])


def first_harmonic(matrix: Floats, omega: float, span: float, over: Floats) -> Complexes:
    """What is felt of a deviation at `omega` while it rings for a `span` in tau: this matrix times its begin.

    Parameters
    ----------
    matrix : float64, shape (2n, 2n), as `ringing` gives it.
    over : its `exponential` over the span.

    Returns
    -------
    complex128, shape (n, 2n): first harmonics of the n positions over the span, with the phase at its begin.
    """
    n = len(matrix) // 2
    shifted = matrix - 1j * omega * np.eye(2 * n)
    whole = over * np.exp(-1j * omega * span) - np.eye(2 * n)
    return np.asarray(2 / span * np.linalg.solve(shifted, whole)[:n])
