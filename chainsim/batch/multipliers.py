"""Floquet multipliers of one oscillator for a block of settings: Hill's equation as a three-term recurrence.

With x = e^{-delta tau/2} u and theta = omega tau the deviation from an orbit obeys ``u'' + (q + V(theta)) u = 0``,
q the mean and V the oscillating part of (k - delta^2/4 + 3 sign z^2)/omega^2, both of period pi for an odd series.
Kicks by V between exact flows by q give ``u_{j+1} = (2 cos(h sqrt q) - sin(h sqrt q)/sqrt q W_j) u_j - u_{j-1}`` with
``W = h (V - h^2 V^2/12)`` (Takahashi and Imada, J. Phys. Soc. Japan 53, 1984, 3765): on evenly spaced points the error
linear in V is that of the trapezoidal rule for a periodic function, and half the trace, which no change of variables
alters, errs by O(V^2 h^4). One extrapolation step takes that away. The determinant is 1 by construction.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np
from numpy.typing import NDArray

from ..inlined import inlined
from .balance import OM2, STIFF, TRACE, WIDTH, WORK, X

__all__ = ["FEWEST", "MOST", "half_traces", "nodes", "trace_of"]

Floats = NDArray[np.float64]

FEWEST, MOST = 16, 1024
"""Points per half turn at first, and when a setting is given up."""

# Difference of the half-traces on N and N/2 points, over the sine of the angle, that leaves 1e-8 in the multipliers.
_AGREE = 1.5e-6
# Nearer to coalescence than this the multipliers depend on the trace like a square root, and no method sees more.
_COALESCE = 1e-3
_COS = tuple((-1) ** k / math.factorial(2 * k) for k in range(9))
_SIN = tuple((-1) ** k / math.factorial(2 * k + 1) for k in range(9))
# Rows of WORK: u and its predecessor for two starts, on N points (0-3) and on N/2 (4-7); coefficients on both (8-11).
_COARSE, _FACTORS, _PENDING = WORK + 4 * WIDTH, WORK + 8 * WIDTH, WORK + 12 * WIDTH


@cache
def nodes() -> Floats:
    """Cosine and minus sine of harmonics 1, 3, 5 at the finest points of half a turn; float64, shape (MOST, 6)."""
    angle = (np.arange(MOST) * (np.pi / MOST))[:, None] * np.array([1.0, 3.0, 5.0])
    table = np.stack([np.cos(angle), -np.sin(angle)], axis=2).reshape(MOST, 6)
    table.flags.writeable = False
    return table


@inlined
def _begin(block: Floats, quarter: float, sign: float, h: float) -> None:
    """Coefficients and initial values; `quarter` is delta^2/4. A flow too long for its series leaves NaN."""
    work = block[WORK : WORK + 12 * WIDTH]
    for w in range(WIDTH):
        squares = 0.0
        for row in range(6):
            squares += block[X + row * WIDTH + w] ** 2
        y = (block[STIFF + w] - quarter + 1.5 * sign * squares) / block[OM2 + w] * (h * h)
        c, s = _COS[8], _SIN[8]
        for k in (7, 6, 5, 4, 3, 2, 1, 0):
            c, s = c * y + _COS[k], s * y + _SIN[k]
        c = 2 * c if abs(y) <= 1.0 else math.nan
        s = s * h * h
        work[8 * WIDTH + w], work[9 * WIDTH + w] = c, s
        work[10 * WIDTH + w], work[11 * WIDTH + w] = c * c - 2, 2 * s * c
        for k in (0, 3, 4, 7):
            work[k * WIDTH + w] = 1.0
        for k in (1, 2, 5, 6):
            work[k * WIDTH + w] = 0.0


@inlined
def _two_points(x: Floats, om2: Floats, work: Floats, even: Floats, odd: Floats, sign: float, h: float) -> None:
    """Two steps on N points, one on N/2."""
    third, coarse_third = h * h / 12, h * h / 3
    for w in range(WIDTH):
        a, b, c = x[w], x[2 * WIDTH + w], x[4 * WIDTH + w]
        d, e, f = x[WIDTH + w], x[3 * WIDTH + w], x[5 * WIDTH + w]
        mean = 0.5 * (a * a + b * b + c * c + d * d + e * e + f * f)
        scale = 3 * sign / om2[w]
        z = even[0] * a + even[1] * d + even[2] * b + even[3] * e + even[4] * c + even[5] * f
        v = scale * (z * z - mean)
        first = work[8 * WIDTH + w] - work[9 * WIDTH + w] * (v - third * v * v)
        coarse = work[10 * WIDTH + w] - work[11 * WIDTH + w] * (v - coarse_third * v * v)
        z = odd[0] * a + odd[1] * d + odd[2] * b + odd[3] * e + odd[4] * c + odd[5] * f
        v = scale * (z * z - mean)
        second = work[8 * WIDTH + w] - work[9 * WIDTH + w] * (v - third * v * v)
        middle = first * work[w] - work[WIDTH + w]
        work[WIDTH + w], work[w] = middle, second * middle - work[w]
        middle = first * work[2 * WIDTH + w] - work[3 * WIDTH + w]
        work[3 * WIDTH + w], work[2 * WIDTH + w] = middle, second * middle - work[2 * WIDTH + w]
        middle = work[4 * WIDTH + w]
        work[4 * WIDTH + w] = coarse * middle - work[5 * WIDTH + w]
        work[5 * WIDTH + w] = middle
        middle = work[6 * WIDTH + w]
        work[6 * WIDTH + w] = coarse * middle - work[7 * WIDTH + w]
        work[7 * WIDTH + w] = middle


@inlined
def _accept(block: Floats) -> int:
    """Keep the extrapolated trace of every pending setting whose two traces agree; returns how many are left."""
    left = 0
    for w in range(WIDTH):
        fine = 0.5 * (block[WORK + w] + block[WORK + 3 * WIDTH + w])
        coarse = 0.5 * (block[_COARSE + w] + block[_COARSE + 3 * WIDTH + w])
        t = fine + (fine - coarse) / 15
        sine = math.sqrt(abs((t - 1) * (t + 1)))
        good = abs(fine - coarse) <= _AGREE * max(sine, _COALESCE)
        pending = block[_PENDING + w]
        block[TRACE + w] = t if pending > 0 and good else block[TRACE + w]
        still = pending > 0 and not good
        block[_PENDING + w] = 1.0 if still else 0.0
        left += 1 if still else 0
    return left


@inlined
def half_traces(block: Floats, table: Floats, quarter: float, sign: float) -> None:
    """Half the trace of half a turn's monodromy of every setting, into row TRACE; NaN where points never suffice.

    Parameters
    ----------
    block : with X, STIFF, OM2 filled; rows WORK are overwritten.
    table : `nodes`.
    quarter : delta^2/4.
    """
    for w in range(WIDTH):
        block[TRACE + w] = math.nan
        # A setting without an answer would be refined for nothing.
        x = block[X + w] - block[X + w] + block[X + WIDTH + w] - block[X + WIDTH + w]
        block[_PENDING + w] = 1.0 if x == 0.0 else 0.0
    points = FEWEST
    while points <= MOST:
        h, apart = math.pi / points, MOST // points
        _begin(block, quarter, sign, h)
        for j in range(0, MOST, 2 * apart):
            _two_points(
                block[X : X + 6 * WIDTH], block[OM2 : OM2 + WIDTH], block[WORK : WORK + 12 * WIDTH],
                table[j], table[j + apart], sign, h,
            )  # fmt: skip
        if _accept(block) == 0:
            return
        points *= 2


@inlined
def trace_of(points: Floats, stiffness: float, sign: float, om2: float) -> float:
    """The same for one setting, from z at MOST or more even points of half a turn (a power of two); NaN: too few.

    `stiffness` is k - delta^2/4.
    """
    total, mean = len(points), np.mean(points * points)
    q = (stiffness + 3 * sign * mean) / om2
    before = math.nan
    steps = FEWEST // 2
    while steps <= total:
        h = math.pi / steps
        root = math.sqrt(abs(q))
        c = 2 * (math.cos(h * root) if q >= 0 else math.cosh(h * root))
        s = h if root == 0 else (math.sin(h * root) if q >= 0 else math.sinh(h * root)) / root
        x, y, u, v = 1.0, 0.0, 0.0, 1.0
        for j in range(0, total, total // steps):
            w = 3 * sign * (points[j] * points[j] - mean) / om2
            factor = c - s * h * (w - h * h / 12 * w * w)
            x, y = factor * x - y, x
            u, v = factor * u - v, u
        t = 0.5 * (x + v)
        better = t + (t - before) / 15
        if abs(t - before) <= _AGREE * max(math.sqrt(abs((better - 1) * (better + 1))), _COALESCE):
            return better
        before = t
        steps *= 2
    return math.nan
