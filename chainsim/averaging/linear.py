"""The linear half of the slow flow: what of ``A'' + D A' + Z A = G`` turns slowly, and its exponential.

With two solutions S (slow) and R (near -2 i omega) of the matrix equation ``X^2 + D X + Z = 0`` every motion is
``A = a + c``, ``A' = S a + R c``, and exactly ``a' = S a + W G``, ``c' = R c - W G``, ``W = (S - R)^-1``: no coupling
is too strong, and equal oscillators, whose matrix has no full set of eigenvectors, are no special case.
"""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

__all__ = ["diagonal", "exponential", "inverse", "solvent", "times"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
Numbers = TypeVar("Numbers", Floats, Complexes)

ROUNDS = 200
SETTLED = 1e-14
DEGREE = 14  # Of the Taylor polynomial of e^x: 0.5^15/15! is below rounding.


def solvent(damping: Complexes, matrix: Complexes, root: Complexes) -> Complexes:
    """The solution X of ``X^2 + D X + Z = 0`` near the diagonal `root`; complex128, shape (N, n, n).

    `damping` and `root` have the shape (N, n). Each round divides the residual by what a change of X does to it but for
    links: exact after n rounds in an open chain, and quick wherever links are weaker than the oscillators' springs. NaN
    where it does not settle.
    """
    found = diagonal(root)
    apart = root[:, :, None] + root[:, None, :] + damping[:, :, None]
    size = np.abs(root).max(axis=1) + np.abs(matrix / apart).max(axis=(1, 2))
    good = np.zeros(len(root), dtype=bool)
    for _ in range(ROUNDS):
        step = (found @ found + damping[:, :, None] * found + matrix) / apart
        found = found - step
        good = np.abs(step).max(axis=(1, 2)) <= SETTLED * size
        if good.all():
            break
    # Far from resonance the residual itself is a difference of large numbers.
    good |= np.abs(step).max(axis=(1, 2)) <= 1e-9 * size
    found[~good] = np.nan
    return found


def exponential(matrix: Complexes) -> Complexes:
    """e^matrix of each of (N, n, n), by Taylor's series of a part and squaring; not finite where it overflows."""
    norm = np.abs(matrix).sum(axis=2).max(axis=1)
    halvings = np.ceil(np.log2(np.clip(np.nan_to_num(norm, nan=1.0, posinf=1.0), 0.5, 2.0**60))).astype(np.int64) + 1
    part = matrix / np.exp2(halvings)[:, None, None]
    one = np.eye(matrix.shape[1])
    found: Complexes = one + part / DEGREE
    for k in range(DEGREE - 1, 0, -1):
        found = one + part @ found / k
    for k in range(int(halvings.max(initial=0))):
        lanes = halvings > k
        found = np.where(lanes[:, None, None], found @ found, found)
    return found


def diagonal(entries: Numbers) -> Numbers:
    """Matrices (N, n, n) with `entries` (N, n) on their diagonals."""
    matrix = np.zeros((*entries.shape, entries.shape[1]), dtype=entries.dtype)
    each = np.arange(entries.shape[1])
    matrix[:, each, each] = entries
    return matrix


def inverse(matrix: Numbers) -> Numbers:
    """The inverse of each of (N, n, n); NaN where it has none."""
    found: Numbers = np.full_like(matrix, np.nan)
    finite = np.flatnonzero(np.isfinite(matrix).all(axis=(1, 2)))
    try:
        found[finite] = np.linalg.inv(matrix[finite])
    except np.linalg.LinAlgError:
        for j in finite:
            try:
                found[j] = np.linalg.inv(matrix[j])
            except np.linalg.LinAlgError:
                continue
    return found


def times(matrix: Complexes | Floats, vector: Numbers) -> Numbers:
    """``matrix @ vector`` of each setting, (N, n, n) and (N, n); a real vector needs a real matrix."""
    product: Numbers = np.matmul(matrix, vector[:, :, None])[:, :, 0]
    return product
