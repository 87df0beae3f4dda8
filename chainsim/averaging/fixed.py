"""Where the slow flow rests: its fixed points by Newton, and whether they hold."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .flow import SlowFlow
from .linear import times

__all__ = ["NEWTON_STEPS", "fixed_point", "rates_at"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

NEWTON_STEPS = 30  # What a start that may be far away needs.


def fixed_point(
    flow: SlowFlow, drive: Complexes, start: Complexes, *, most: int
) -> tuple[Complexes, NDArray[np.bool_]]:
    """Amplitudes (N, n) at rest in the slow flow near `start`, by at most `most` steps of Newton, and where
    they were found.
    """
    found = start.copy()
    ok = np.zeros(len(start), dtype=bool)
    todo = np.flatnonzero(np.isfinite(start).all(axis=1))
    for _ in range(most):
        if not len(todo):
            break
        part, here = flow.pick(todo), found[todo]
        residual = times(part.stiff, here) + part.cubic(here)
        residual[:, 0] -= drive[todo]
        step = _solve(_real(part.stiff) + _bend(part, here), residual)
        found[todo] = here - step
        size = np.abs(step).max(axis=1) / np.maximum(np.abs(found[todo]).max(axis=1), 1e-300)
        still = ~(size <= 1e-13)
        ok[todo[~still | (size <= 1e-11)]] = True
        todo = todo[still & np.isfinite(size)]
    return found, ok


def rates_at(flow: SlowFlow, amplitude: Complexes) -> Complexes:
    """Eigenvalues of the slow flow about `amplitude`, shape (N, 2n), per unit of tau; two of each oscillator in turn.

    With dA = da - slave dN the flow is da' = S da - W dN; where no oscillator acts on one before it, 2 x 2 blocks
    decide.
    """
    size, n = amplitude.shape
    values = np.full((size, 2 * n), np.nan, dtype=np.complex128)
    known = np.flatnonzero(np.isfinite(amplitude).all(axis=1) & np.isfinite(flow.weight).all(axis=(1, 2)))
    if not len(known):
        return values
    here = flow.pick(known)
    bend, each = _bend(here, amplitude[known]), np.arange(n)
    parts = [_real(here.rate), _real(here.weight), _real(here.slave), bend]
    if flow.law.feed_forward:
        pair = np.stack([each, n + each], axis=1)
        rate, weight, slave, bend = (part[:, pair[:, :, None], pair[:, None, :]] for part in parts)
    else:
        rate, weight, slave, bend = parts
    one = np.eye(rate.shape[-1])
    slope = rate - weight @ bend @ np.linalg.inv(one + slave @ bend)
    values[known] = _pairs(slope).reshape(len(known), -1) if flow.law.feed_forward else np.linalg.eigvals(slope)
    return values


def _pairs(matrix: Floats) -> Complexes:
    """Eigenvalues of 2 x 2 matrices, shape (..., 2)."""
    mean = 0.5 * (matrix[..., 0, 0] + matrix[..., 1, 1])
    half = 0.5 * (matrix[..., 0, 0] - matrix[..., 1, 1])
    root = np.sqrt(half**2 + matrix[..., 0, 1] * matrix[..., 1, 0] + 0j)
    return np.stack([mean + root, mean - root], axis=-1)


def _bend(flow: SlowFlow, amplitude: Complexes) -> Floats:
    """Of N by (Re A, Im A), shape (N, 2n, 2n): dN = P dA + Q conj(dA)."""
    square = amplitude.real**2 + amplitude.imag**2
    # The way back of the third harmonic, 3/16 beta^2 third |A|^4 A.
    back = 0.1875 * flow.beta**2 * flow.third * square
    by = _diagonal(1.5 * flow.beta * square + 3 * back * square)
    against = _diagonal((0.75 * flow.beta + 2 * back) * amplitude**2)
    if flow.lean is not None:
        kappa = flow.lean.kappa
        mean, second, _ = flow.harmonics(amplitude)
        left, right = (kappa * amplitude)[:, :, None], (kappa * amplitude)[:, None, :]
        by = by + _diagonal(2 * kappa * mean) - left * flow.lean.mean * right.conj()
        by = by - left.conj() * flow.lean.second * right
        against = against + _diagonal(kappa * second) - left * flow.lean.mean * right
    n = amplitude.shape[1]
    matrix = np.empty((len(amplitude), 2 * n, 2 * n))
    matrix[:, :n, :n], matrix[:, :n, n:] = (by + against).real, -(by - against).imag
    matrix[:, n:, :n], matrix[:, n:, n:] = (by + against).imag, (by - against).real
    return matrix


def _diagonal(entries: Complexes | Floats) -> Complexes:
    matrix = np.zeros((*entries.shape, entries.shape[1]), dtype=np.complex128)
    each = np.arange(entries.shape[1])
    matrix[:, each, each] = entries
    return matrix


def _real(factor: Complexes) -> Floats:
    """Multiplication by `factor` (N, n, n) as matrices on (Re, Im), shape (N, 2n, 2n)."""
    n = factor.shape[1]
    matrix = np.empty((len(factor), 2 * n, 2 * n))
    matrix[:, :n, :n] = matrix[:, n:, n:] = factor.real
    matrix[:, :n, n:], matrix[:, n:, :n] = -factor.imag, factor.imag
    return matrix


def _solve(matrix: Floats, right: Complexes) -> Complexes:
    n = right.shape[1]
    both = np.concatenate([right.real, right.imag], axis=1)[..., None]
    wild = ~(np.isfinite(matrix).all(axis=(1, 2)) & np.isfinite(both).all(axis=(1, 2)))
    if wild.any():
        matrix, both = matrix.copy(), both.copy()
        matrix[wild], both[wild] = np.eye(2 * n), np.nan
    try:
        step = np.linalg.solve(matrix, both)[..., 0]
    except np.linalg.LinAlgError:
        # One setting exactly at a fold must not stop the others.
        step = (np.linalg.pinv(matrix) @ both)[..., 0]
    answer: Complexes = step[:, :n] + 1j * step[:, n:]
    return answer
