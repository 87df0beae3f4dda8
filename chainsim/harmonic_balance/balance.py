"""Harmonic balance of one forced Duffing oscillator: exact Jacobian, Newton over a batch of settings."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..equations.basis import Basis

__all__ = ["Oscillator", "Solved", "linearise", "newton", "solve_blocks"]

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

# A step this small, relative to the answer, leaves an error of its square over the sharpness; the error estimate's own
# Newton step sees what is left.
SMALL_STEP = 1e-6
MAX_STEPS = 25
# Steps after which only the settings still moving are iterated.
COMMON_STEPS = 4
# LAPACK on a stack of small matrices costs about 1.5 us each, elimination over the batch about 60 us a stack.
LAPACK_BELOW = 48


@dataclass(frozen=True)
class Oscillator:
    """One oscillator of the chain for every setting of a batch, or several side by side, scaled.

    omega, k : float64, shape (N,). delta, sign : the same, or shape (1,).
    """

    omega: Floats
    k: Floats
    delta: Floats
    sign: Floats

    def pick(self, index: NDArray[np.intp] | Bools) -> Oscillator:
        """The oscillator at some settings."""
        delta, sign = (value if len(value) == 1 else value[index] for value in (self.delta, self.sign))
        return Oscillator(self.omega[index], self.k[index], delta, sign)

    def coefficients(self, basis: Basis) -> Floats:
        """Work array for `linearise`: room for z^2, then k, omega^2 and delta omega."""
        columns = np.empty((len(basis.values) + 3, len(self.omega)))
        columns[-3] = self.k
        columns[-2] = self.omega * self.omega
        columns[-1] = self.delta * self.omega
        return columns


@dataclass(frozen=True)
class Solved:
    """x : float64, shape (d, N). ok : bool, shape (N,). steps : Newton steps, summed over settings."""

    x: Floats
    ok: Bools
    steps: int


def linearise(basis: Basis, columns: Floats, sign: Floats, x: Floats) -> tuple[Floats, Floats]:
    """Jacobian, shape (d, d, N), of the balance equations R(x) = 0 at x, and its product with x less R and force.

    The cubic term c(x) is homogeneous, so J x = L x + 3 c(x), and Newton's next x solves
    J x' = force + 2 c(x): the second array is 2 c(x), shape (d, N).
    """
    z = basis.values @ x
    square = z * z
    np.multiply(square, sign, out=columns[:-3])
    jacobian = (basis.bilinear @ columns).reshape(basis.size, basis.size, -1)
    square *= z
    return jacobian, (2 * sign) * (basis.project @ square)


def newton(basis: Basis, oscillator: Oscillator, force: Floats, start: Floats) -> Solved:
    """Solve the balance equations by Newton's method from `start` (d, N) under `force` (d, N).

    `ok` is False where the steps do not die out; x there is meaningless.
    """
    x, ok = start.copy(), np.zeros(start.shape[1], dtype=bool)
    active: NDArray[np.intp] | slice = slice(None)
    count = 0
    part, here = oscillator, x
    columns, push = oscillator.coefficients(basis), force
    for step in range(MAX_STEPS):
        jacobian, twice = linearise(basis, columns, part.sign, here)
        moved = solve_blocks(jacobian, push + twice)
        still = ~_settled(here, moved)
        count += moved.shape[1]
        here = moved
        x[:, active] = moved
        ok[active] = ~still
        if not still.any():
            break
        if step + 1 >= COMMON_STEPS:
            still &= np.isfinite(moved).all(axis=0)
            active = _next(active, still)
            if not len(active):
                break
            part, here, push = oscillator.pick(active), x[:, active], force[:, active]
            columns = part.coefficients(basis)
    return Solved(x, ok, count)


def _next(active: NDArray[np.intp] | slice, still: Bools) -> NDArray[np.intp]:
    return np.flatnonzero(still) if isinstance(active, slice) else active[still]


def _settled(before: Floats, after: Floats) -> Bools:
    size = np.abs(after).max(axis=0)
    settled: Bools = np.abs(after - before).max(axis=0) <= SMALL_STEP * size
    return settled


def solve_blocks(matrix: Floats, right: Floats) -> Floats:
    """Solve (d, d, N) systems with one right side (d, N) each; NaN or inf where singular."""
    if len(right) == 1:
        ratio: Floats = right / matrix[0]
        return ratio
    if right.shape[1] < LAPACK_BELOW or len(right) % 2:
        return _lapack(matrix, right)
    return _eliminate(matrix, right)


def _lapack(matrix: Floats, right: Floats) -> Floats:
    try:
        answer = np.linalg.solve(matrix.transpose(2, 0, 1), right.T[:, :, None])
        return np.asarray(answer[:, :, 0].T, dtype=np.float64)
    except np.linalg.LinAlgError:
        return _one_by_one(matrix, right)


def _one_by_one(matrix: Floats, right: Floats) -> Floats:
    answer = np.full_like(right, np.nan)
    for index in range(right.shape[1]):
        try:
            answer[:, index] = np.linalg.solve(matrix[:, :, index], right[:, index])
        except np.linalg.LinAlgError:
            continue
    return answer


def _eliminate(matrix: Floats, right: Floats) -> Floats:
    """Block elimination by 2 x 2 pivots from the highest harmonic down, in place.

    High harmonics are far above resonance, so their pivots are large: no row exchange is needed.
    """
    size = len(right)
    inverses = []
    for low in range(size - 2, 0, -2):
        a, b, c, d = matrix[low, low], matrix[low, low + 1], matrix[low + 1, low], matrix[low + 1, low + 1]
        det = 1.0 / (a * d - b * c)
        left = matrix[:low, low : low + 2]
        first = (left[:, 0] * d - left[:, 1] * c) * det
        second = (left[:, 1] * a - left[:, 0] * b) * det
        matrix[:low, :low] -= first[:, None] * matrix[low, :low] + second[:, None] * matrix[low + 1, :low]
        right[:low] -= first * right[low] + second * right[low + 1]
        inverses.append(det)
    inverses.append(1.0 / (matrix[0, 0] * matrix[1, 1] - matrix[0, 1] * matrix[1, 0]))
    answer = np.empty_like(right)
    for low in range(0, size, 2):
        u = right[low] - (matrix[low, :low] * answer[:low]).sum(axis=0)
        w = right[low + 1] - (matrix[low + 1, :low] * answer[:low]).sum(axis=0)
        det = inverses[-1 - low // 2]
        answer[low] = (u * matrix[low + 1, low + 1] - w * matrix[low, low + 1]) * det
        answer[low + 1] = (w * matrix[low, low] - u * matrix[low + 1, low]) * det
    return answer
