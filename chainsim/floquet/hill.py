"""Floquet multipliers of each oscillator of an open chain, by sixth-order Magnus steps of Hill's equation.

About an orbit z the deviation obeys ``x'' + delta x' + (k + 3 beta z^2) x = 0``. With x = e^{-delta tau/2} u this is
Hill's equation ``u'' + q u = 0``, q = k - delta^2/4 + 3 beta z^2, whose monodromy has determinant 1. A Magnus step is
the exponential of a traceless matrix, so the determinant is kept to rounding however long the step (Blanes, Casas,
Oteo, Ros, Physics Reports 470, 2009, eq. 253 with Gauss-Legendre points).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from ..equations.basis import Basis
from ..equations.scaled_chain import ScaledChain

__all__ = ["chain_multipliers"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

NODES = np.array([0.5 - np.sqrt(0.15), 0.5, 0.5 + np.sqrt(0.15)])
# Agreement of the half-trace between two step sizes. Extrapolating both (the error falls 64 times) leaves about 1/50.
AGREEMENT = 1e-7
MAX_STEPS = 8192
# Swings of an oscillator during half a turn of the drive, from which on the drive counts as slow.
SLOWEST = 1000.0
TALLEST = 300.0
WKB_POINTS = 512
# cosh(r) and sinh(r)/r in powers of r^2; at |r^2| <= 1 the first term left out is under 2e-16.
EVEN = tuple(1 / math.factorial(2 * k) for k in range(9))
ODD = tuple(1 / math.factorial(2 * k + 1) for k in range(9))
# Numbers in a work array at once: a block stays in the processor's cache and below the size (128 kB) from which the C
# library fetches fresh pages for every array.
CHUNK = 8_000


@dataclass(frozen=True)
class _Hill:
    """M Hill equations over one angle: base, sign and omega of shape (M,), x of shape (d, M)."""

    basis: Basis
    span: float
    base: Floats
    sign: Floats
    omega: Floats
    x: Floats

    def pick(self, index: NDArray[np.intp]) -> _Hill:
        return _Hill(self.basis, self.span, self.base[index], self.sign[index], self.omega[index], self.x[:, index])


def chain_multipliers(scaled: ScaledChain, basis: Basis, x: Floats) -> Complexes:
    """The two multipliers of every 2 x 2 block.

    Parameters
    ----------
    x : float64, shape (n, d, N), scaled coordinates of the orbit in `basis`.

    Returns
    -------
    complex128, shape (N, n, 2), each pair with product exp(-delta T); NaN where they could not be resolved.
    """
    n, size = scaled.n, len(scaled)
    flat = np.ascontiguousarray(x.transpose(1, 0, 2)).reshape(basis.size, -1)
    omega = np.broadcast_to(scaled.omega, (n, size)).reshape(-1)
    base = (scaled.k - 0.25 * scaled.delta**2).reshape(-1)
    # An odd series has z^2 of half the period: the monodromy is the square of that of half a turn.
    halves = 1 if basis.mean else 2
    delta, sign = (np.repeat(scaled.of_each(value), size) for value in (scaled.delta, scaled.sign))
    hill = _Hill(basis, 2 * np.pi / halves, base, sign, omega, flat)
    half_trace, slow = _half_trace(hill)
    pair = _pair(half_trace) ** halves
    pair = pair * np.exp(-np.pi * delta / omega)
    if slow.any():
        lanes = np.flatnonzero(slow)
        pair[:, lanes] = _slow_pair(hill.pick(lanes), delta[lanes])
    return pair.T.reshape(n, size, 2).transpose(1, 0, 2)


def _pair(t: Floats) -> Complexes:
    """Eigenvalues of a 2 x 2 matrix with determinant 1 and trace 2 t; complex128, shape (2, M)."""
    root = np.sqrt((t - 1) * (t + 1) + 0j)
    large = np.where(t < 0, t - root, t + root)
    return np.stack([large, 1 / large])


def _half_trace(hill: _Hill) -> tuple[Floats, NDArray[np.bool_]]:
    """Half the trace of every monodromy, NaN where two step sizes never agree; and which oscillators are too fast."""
    answer = np.full(len(hill.base), np.nan)
    turns = np.sqrt(np.abs(hill.base)) / hill.omega
    fastest = np.maximum(turns, max(0.5 * hill.basis.order, 1.0)) * (hill.span / np.pi)
    finite = np.isfinite(hill.x).all(axis=0)
    # Without swings the half trace grows like cosh and would overflow.
    known = finite & (fastest <= SLOWEST) & ~((hill.base < 0) & (turns * hill.span > TALLEST))
    levels = 4 * 2 ** np.ceil(np.log2(np.where(known, fastest, 1.0))).astype(np.intp)
    for steps in np.unique(levels[known]):
        lanes = np.flatnonzero(known & (levels == steps))
        answer[lanes] = _refined(hill.pick(lanes), int(steps))
    return answer, finite & ~known & np.isfinite(fastest)


def _slow_pair(hill: _Hill, delta: Floats) -> Complexes:
    """Multipliers (2, M) of oscillators far faster than the drive: ``exp(int of both momentary exponents)``.

    The first correction is of order 1 over the square of the swings. NaN where an oscillator is now under-, now
    overdamped: there the exponents meet.
    """
    z = hill.basis.evaluate_at(2 * np.pi * (np.arange(WKB_POINTS) + 0.5) / WKB_POINTS) @ hill.x
    q = hill.base + 3 * hill.sign * z * z
    root = np.sqrt(np.abs(q))
    decay = 0.5 * delta + root
    period = 2 * np.pi / hill.omega
    # -delta/2 + root without its cancellation: their product is the stiffness.
    over = np.stack([-((q + 0.25 * delta**2) / decay).mean(axis=0), -decay.mean(axis=0)]) + 0j
    swing = 1j * root.mean(axis=0)
    under = np.stack([swing - 0.5 * delta, -swing - 0.5 * delta])
    exponents = np.where((q < 0).all(axis=0), over, np.where((q > 0).all(axis=0), under, complex(np.nan, np.nan)))
    pair: Complexes = np.exp(exponents * period)
    return pair


def _refined(hill: _Hill, steps: int) -> Floats:
    """Half traces, the steps doubled from `steps` on until they agree."""
    answer = np.full(len(hill.base), np.nan)
    todo = np.arange(len(answer))
    coarse = _traces(hill, steps)
    while len(todo) and steps < MAX_STEPS:
        steps *= 2
        fine = _traces(hill, steps)
        same = np.abs(fine - coarse) <= AGREEMENT * np.maximum(1.0, np.abs(fine))
        answer[todo[same]] = fine[same] + (fine[same] - coarse[same]) / 63
        left = np.flatnonzero(~same & np.isfinite(fine))
        todo, hill, coarse = todo[left], hill.pick(left), fine[left]
    return answer


def _traces(hill: _Hill, steps: int) -> Floats:
    block = max(1, CHUNK // (3 * steps))
    count = len(hill.base)
    if count <= block:
        return _traces_of(hill, steps)
    parts = [np.arange(low, min(low + block, count)) for low in range(0, count, block)]
    return np.concatenate([_traces_of(hill.pick(part), steps) for part in parts])


def _traces_of(hill: _Hill, steps: int) -> Floats:
    z = _nodes(hill.basis, hill.span, steps) @ hill.x
    q = ((3 * hill.sign) * (z * z) + hill.base) / (hill.omega * hill.omega)
    before, middle, after = q.reshape(3, steps, -1)
    exponent = _exponent(hill.span / steps, before, middle, after)
    product = _exponential(exponent)
    while product.shape[1] > 1:
        product = _multiply(product[:, 1::2], product[:, 0::2])
    trace: Floats = 0.5 * (product[0, 0] + product[3, 0])
    return trace


@cache
def _nodes(basis: Basis, span: float, steps: int) -> Floats:
    h = span / steps
    theta = (np.arange(steps) + NODES[:, None]) * h
    return basis.evaluate_at(theta.reshape(-1))


def _exponent(h: float, before: Floats, middle: Floats, after: Floats) -> Floats:
    """Magnus exponent of each step as (a, b, c) of [[a, b], [c, -a]]; shape (3, steps, M).

    alpha_1 = h A(mid), alpha_2 = sqrt(15)/3 h (A_3 - A_1), alpha_3 = 10/3 h (A_3 - 2 A_2 + A_1), of which the last two
    have only the lower left entry.
    """
    s2 = (-np.sqrt(15) / 3 * h) * (after - before)
    s3 = (-10 / 3 * h) * (after - 2 * middle + before)
    hq = h * middle
    # X = -20 alpha_1 - alpha_3 + [alpha_1, alpha_2];  Y = alpha_2 - 1/60 [alpha_1, 2 alpha_3 + [alpha_1, alpha_2]]
    xa, xc, xb = h * s2, 20 * hq - s3, -20 * h
    ya, yb = (-h / 30) * s3, (h * h / 30) * s2
    yc = s2 + (h / 30) * hq * s2
    a = (xb * yc - yb * xc) / 240
    b = h + (xa * yb - xb * ya) / 120
    c = s3 / 12 - hq + (xc * ya - xa * yc) / 120
    return np.stack([a, b, c])


def _exponential(exponent: Floats) -> Floats:
    """exp of traceless 2 x 2 matrices, even 1 + odd E; rows m11, m12, m21, m22 of shape (4, steps, M)."""
    a, b, c = exponent
    square = a * a + b * c
    if float(np.abs(square).max(initial=0.0)) <= 1.0:
        even, odd = _series(square, EVEN), _series(square, ODD)
    else:
        root = np.sqrt(np.abs(square))
        safe = np.where(root > 0, root, 1.0)
        even = np.where(square < 0, np.cos(root), np.cosh(root))
        odd = np.where(root > 0, np.where(square < 0, np.sin(root), np.sinh(root)) / safe, 1.0)
    product = np.empty((4, *square.shape))
    along = odd * a
    np.add(even, along, out=product[0])
    np.subtract(even, along, out=product[3])
    np.multiply(odd, b, out=product[1])
    np.multiply(odd, c, out=product[2])
    return product


def _series(square: Floats, coefficients: tuple[float, ...]) -> Floats:
    total = np.full_like(square, coefficients[-1])
    for coefficient in coefficients[-2::-1]:
        total *= square
        total += coefficient
    return total


def _multiply(left: Floats, right: Floats) -> Floats:
    product = np.empty(left.shape)
    for row in (0, 2):
        for column in (0, 1):
            np.multiply(left[row], right[column], out=product[row + column])
            product[row + column] += left[row + 1] * right[column + 2]
    return product
