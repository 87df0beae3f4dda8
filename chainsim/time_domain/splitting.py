"""Exact damped linear flow and cubic kicks, composed to order (8, 6, 4): the transient kernel.

``z'' + delta z' + (1 + lam) z`` is solved exactly; ``-beta z^3 + lam z_prev`` and every force are kicks at
frozen position. The composition is ABA(8,6,4) of Blanes, Casas, Farres, Laskar, Makazaga and Murua,
Appl. Numer. Math. 68 (2013) 58-72: with kicks of size eps, an error of eps h^8 + eps^2 h^6 + eps^3 h^4.

The state of an oscillator is (q, p) with q = z and p = v + (delta/2) z, in which the damped flow over t is
``q' = c q + s p, p' = c p - d q``: e^{-delta t/2} times a rotation, and a rotation is three shears, of p by q, of q by
p, of p by q. The outer ones are of the kind of a kick and go with the kicks beside them; the factor goes into the
forces and the cubic term, once a step into the state. So a kick and the flow after it take five multiplying
instructions, and p's shears keep the determinant whatever is rounded.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..compiled import compiled
from ..equations.composition import FLOWS, KICK_TIMES, KICKS
from ..equations.views import PlainNetwork
from ..inlined import inlined

__all__ = ["WIDTH", "advance_block", "flow", "forcing_table"]

Floats = NDArray[np.float64]

WIDTH = 48
"""Settings a caller should hand over together, or a multiple of it."""

# Side by side. The innermost loop takes three vectors of eight, a third apart, which hide each other's latency.
_LANES, _THIRD = WIDTH, WIDTH // 3
# A block's rows that all oscillators share: at every kick the position (or force) that pulls the next oscillator, the
# cubic coefficient, the growth of the forces; then the step, its decay, the last oscillator's position, and the drive's
# constant and factors of cosine and sine.
_CUBIC, _GROWTH, _STEP, _DECAY, _CLOSING, _DRIVE, _SHARED = (_LANES * row for row in (7, 14, 21, 22, 23, 24, 28))
# One oscillator's rows: q, p, link into it, weight of what pulls it, constant force, shears of q by p, shears of p by q
# between flows, the pending shear.
_LINK, _PULL, _CONSTANT, _BY_P, _BY_Q, _PENDING, _ROW = (_LANES * row for row in (2, 3, 4, 5, 9, 13, 14))

# The flows are a2, a3, a4, a4, a3, a2 and, across the end of a step, twice a1.
_FIRST = float(FLOWS[0])
_DISTINCT = np.append(FLOWS[1:4], 2 * _FIRST)
_B0, _B1, _B2, _B3 = (float(weight) for weight in KICKS[:4])


def forcing_table(steps: int) -> Floats:
    """Cosine and sine of the drive's phase at every kick of one period.

    Returns
    -------
    float64, shape (steps, 7, 2). The phase comes from the kick's index, so it does not drift.
    """
    phase = 2 * np.pi * (np.arange(steps)[:, None] + KICK_TIMES) / steps
    return np.stack([np.cos(phase), np.sin(phase)], axis=-1)


@inlined
def flow(delta: float, stiffness: float, t: float) -> tuple[float, float, float]:
    """Coefficients (c, s, d) of the damped linear flow over `t` of ``z'' + delta z' + stiffness z = 0``."""
    half = 0.5 * delta
    square = stiffness - half * half
    decay = math.exp(-half * t)
    if square > 0:
        root = math.sqrt(square)
        s = decay * math.sin(root * t) / root
        return decay * math.cos(root * t), s, square * s
    if square < 0:
        root = math.sqrt(-square)
        s = decay * math.sinh(root * t) / root
        return decay * math.cosh(root * t), s, square * s
    return decay, decay * t, 0.0


@inlined
def _apply(row: Floats, h: Floats, delta: float, length: float) -> None:
    """Flow one oscillator of a block over `length` steps; p is per step."""
    for w in range(_LANES):
        c, s, d = flow(delta, 1.0 + row[_LINK + w], length * h[w])
        x, y = row[w], row[_LANES + w] * h[w]
        row[w] = c * x + s * y
        row[_LANES + w] = (c * y - d * x) / h[w]


@inlined
def _shears(delta: float, stiffness: float, t: float) -> tuple[float, float]:
    """The shears (of q by p, of p by q on either side) that make the undamped part of a flow over `t`."""
    square = stiffness - 0.25 * delta * delta
    root = math.sqrt(abs(square))
    if square > 0:
        return math.sin(root * t) / root, -root * math.tan(0.5 * root * t)
    if square < 0:
        return math.sinh(root * t) / root, root * math.tanh(0.5 * root * t)
    return t, 0.0


@inlined
def _prepare(row: Floats, h: Floats, delta: float) -> None:
    """Write one oscillator's shears for p per step and unit kicks, and bring its state before the first kick."""
    along, across = np.empty(4), np.empty(4)
    for w in range(_LANES):
        for k in range(4):
            along[k], across[k] = _shears(delta, 1.0 + row[_LINK + w], _DISTINCT[k] * h[w])
            row[_BY_P + k * _LANES + w] = along[k] * h[w]
        row[_BY_Q + w] = (across[3] + across[0]) / h[w]
        row[_BY_Q + _LANES + w] = (across[0] + across[1]) / h[w]
        row[_BY_Q + 2 * _LANES + w] = (across[1] + across[2]) / h[w]
        row[_BY_Q + 3 * _LANES + w] = 2 * across[2] / h[w]
        row[_PENDING + w] = across[3] / h[w]
    _apply(row, h, delta, _FIRST)
    for w in range(_LANES):
        row[_LANES + w] -= row[_PENDING + w] * row[w]


@inlined
def _share(shared: Floats, delta: float, beta: float) -> None:
    for w in range(_LANES):
        half = 0.5 * delta * shared[_STEP + w]
        for k in range(7):
            growth = math.exp(half * (KICK_TIMES[k] - KICK_TIMES[0]))
            shared[_GROWTH + k * _LANES + w] = growth
            shared[_CUBIC + k * _LANES + w] = -KICKS[k] * beta / (growth * growth)
        shared[_DECAY + w] = math.exp(-half)


@inlined
def _kick(
    shared: Floats, row: Floats, kick: int, w: int, x: float, y: float, pull: float, bend: int, along: int
) -> tuple[float, float]:
    """A kick and the flow after it; what pulled gives way to the position at which the next oscillator is pulled."""
    at = kick * _LANES + w
    y = (y + pull * shared[at]) + (row[_BY_Q + bend * _LANES + w] + shared[_CUBIC + at] * (x * x)) * x
    shared[at] = x
    return x + row[_BY_P + along * _LANES + w] * y, y


@inlined
def _step_row(row: Floats, shared: Floats) -> None:
    """One step of one oscillator under what pulls in `shared`, which becomes what pulls the next."""
    for w in range(_THIRD):
        s, t = _THIRD + w, 2 * _THIRD + w
        x, y, a = row[w], row[_LANES + w], row[_PULL + w]
        u, v, b = row[s], row[_LANES + s], row[_PULL + s]
        p, q, c = row[t], row[_LANES + t], row[_PULL + t]
        x, y = _kick(shared, row, 0, w, x, y, _B0 * a, 0, 0)
        u, v = _kick(shared, row, 0, s, u, v, _B0 * b, 0, 0)
        p, q = _kick(shared, row, 0, t, p, q, _B0 * c, 0, 0)
        x, y = _kick(shared, row, 1, w, x, y, _B1 * a, 1, 1)
        u, v = _kick(shared, row, 1, s, u, v, _B1 * b, 1, 1)
        p, q = _kick(shared, row, 1, t, p, q, _B1 * c, 1, 1)
        x, y = _kick(shared, row, 2, w, x, y, _B2 * a, 2, 2)
        u, v = _kick(shared, row, 2, s, u, v, _B2 * b, 2, 2)
        p, q = _kick(shared, row, 2, t, p, q, _B2 * c, 2, 2)
        x, y = _kick(shared, row, 3, w, x, y, _B3 * a, 3, 2)
        u, v = _kick(shared, row, 3, s, u, v, _B3 * b, 3, 2)
        p, q = _kick(shared, row, 3, t, p, q, _B3 * c, 3, 2)
        x, y = _kick(shared, row, 4, w, x, y, _B2 * a, 2, 1)
        u, v = _kick(shared, row, 4, s, u, v, _B2 * b, 2, 1)
        p, q = _kick(shared, row, 4, t, p, q, _B2 * c, 2, 1)
        x, y = _kick(shared, row, 5, w, x, y, _B1 * a, 1, 0)
        u, v = _kick(shared, row, 5, s, u, v, _B1 * b, 1, 0)
        p, q = _kick(shared, row, 5, t, p, q, _B1 * c, 1, 0)
        x, y = _kick(shared, row, 6, w, x, y, _B0 * a, 0, 3)
        u, v = _kick(shared, row, 6, s, u, v, _B0 * b, 0, 3)
        p, q = _kick(shared, row, 6, t, p, q, _B0 * c, 0, 3)
        row[w], row[_LANES + w] = shared[_DECAY + w] * x, shared[_DECAY + w] * y
        row[s], row[_LANES + s] = shared[_DECAY + s] * u, shared[_DECAY + s] * v
        row[t], row[_LANES + t] = shared[_DECAY + t] * p, shared[_DECAY + t] * q


@inlined
def _forced(shared: Floats, w: int, phase: Floats) -> float:
    cosine, sine = shared[_DRIVE + _LANES + w], shared[_DRIVE + 2 * _LANES + w]
    return float(shared[_DRIVE + w] + cosine * phase[0] + sine * phase[1])


@inlined
def _force(shared: Floats, phases: Floats) -> None:
    """Forces on the first oscillator at the seven kicks."""
    first, second, third, fourth, fifth, sixth = phases[0], phases[1], phases[2], phases[3], phases[4], phases[5]
    for w in range(_LANES):
        shared[w] = shared[_GROWTH + w] * _forced(shared, w, first)
        shared[_LANES + w] = shared[_GROWTH + _LANES + w] * _forced(shared, w, second)
        shared[2 * _LANES + w] = shared[_GROWTH + 2 * _LANES + w] * _forced(shared, w, third)
        shared[3 * _LANES + w] = shared[_GROWTH + 3 * _LANES + w] * _forced(shared, w, fourth)
        shared[4 * _LANES + w] = shared[_GROWTH + 4 * _LANES + w] * _forced(shared, w, fifth)
        shared[5 * _LANES + w] = shared[_GROWTH + 5 * _LANES + w] * _forced(shared, w, sixth)
        shared[6 * _LANES + w] = shared[_GROWTH + 6 * _LANES + w] * _forced(shared, w, phases[6])


@inlined
def _step_open(shared: Floats, rows: Floats, constants: bool) -> None:
    """An open chain's oscillators one after the other, each through the whole step."""
    for at in range(0, len(rows), _ROW):
        _step_row(rows[at : at + _ROW], shared)
        if constants and at + _ROW < len(rows):
            after = rows[at + _ROW : at + 2 * _ROW]
            for k in range(7):
                for w in range(_LANES):
                    constant = shared[_GROWTH + k * _LANES + w] * after[_CONSTANT + w]
                    shared[k * _LANES + w] = after[_LINK + w] * shared[k * _LANES + w] + constant


@inlined
def _kick_row(
    row: Floats, previous: Floats, growth: Floats, cubic: Floats, by_q: Floats, by_p: Floats, b: float
) -> None:
    for w in range(_LANES):
        x = row[w]
        force = row[_LINK + w] * previous[w] + growth[w] * row[_CONSTANT + w]
        y = row[_LANES + w] + b * force + (by_q[w] + cubic[w] * (x * x)) * x
        row[w], row[_LANES + w] = x + by_p[w] * y, y


@inlined
def _step_ring(shared: Floats, rows: Floats) -> None:
    """A ring's oscillators together, kick by kick, from the last to the first.

    In this order every oscillator still finds its predecessor where the kick has to see it; the last one's position,
    which the first has to see, is put aside.
    """
    last = len(rows) - _ROW
    for k in range(7):
        here, after = min(k, 6 - k), 3 if k == 6 else (k if k < 3 else 5 - k)
        growth = shared[_GROWTH + k * _LANES : _GROWTH + (k + 1) * _LANES]
        cubic = shared[_CUBIC + k * _LANES : _CUBIC + (k + 1) * _LANES]
        closing = shared[_CLOSING : _CLOSING + _LANES]
        for w in range(_LANES):
            closing[w] = rows[last + w]
            rows[_CONSTANT + w] = shared[k * _LANES + w] / growth[w]
        for at in range(last, -1, -_ROW):
            row = rows[at : at + _ROW]
            previous = rows[at - _ROW : at - _ROW + _LANES] if at else closing
            by_q = row[_BY_Q + here * _LANES : _BY_Q + (here + 1) * _LANES]
            by_p = row[_BY_P + after * _LANES : _BY_P + (after + 1) * _LANES]
            _kick_row(row, previous, growth, cubic, by_q, by_p, KICKS[k])
    for at in range(0, len(rows), _ROW):
        for w in range(_LANES):
            rows[at + w] *= shared[_DECAY + w]
            rows[at + _LANES + w] *= shared[_DECAY + w]


@inlined
def _raise_peak(rows: Floats, h: Floats, peak: Floats) -> None:
    """Raise `peak` to the largest z^2 + p^2 of any oscillator; NaN counts as larger than everything."""
    for at in range(0, len(rows), _ROW):
        row = rows[at : at + _ROW]
        for w in range(_LANES):
            y = (row[_LANES + w] + row[_PENDING + w] * row[w]) * h[w]
            square = row[w] * row[w] + y * y
            peak[w] = peak[w] if square <= peak[w] else square


@inlined
def _run(
    shared: Floats, rows: Floats, system: PlainNetwork, table: Floats, first: int, count: int, peak: Floats
) -> None:
    """Advance one block by `count` steps from step `first` of the period; `peak` collects max z^2 + p^2."""
    h = shared[_STEP : _STEP + _LANES]
    _share(shared, system.delta, system.beta)
    for at in range(0, len(rows), _ROW):
        _prepare(rows[at : at + _ROW], h, system.delta)
    constants = False
    for at in range(_ROW, len(rows), _ROW):
        for w in range(_LANES):
            constants = constants or rows[at + _CONSTANT + w] != 0.0
    for at in range(_ROW if constants else len(rows), len(rows), _ROW):
        for w in range(_LANES):
            rows[at + _PULL + w] = 1.0
    for step in range(first, first + count):
        _force(shared, table[step % table.shape[0]])
        if system.ring:
            _step_ring(shared, rows)
        else:
            _step_open(shared, rows, constants)
        if step % 8 == 7:
            _raise_peak(rows, h, peak)
    for at in range(0, len(rows), _ROW):
        row = rows[at : at + _ROW]
        for w in range(_LANES):
            row[_LANES + w] += row[_PENDING + w] * row[w]
        _apply(row, h, system.delta, -_FIRST)


@compiled
def advance_block(
    state: Floats, lanes: NDArray[np.int64], system: PlainNetwork, table: Floats, first: int, count: int, peak: Floats
) -> None:
    """Advance the settings `lanes` by `count` steps from step `first` of the drive period, in place.

    Parameters
    ----------
    state : float64, shape (N, 2n), all q then all p (p = v + delta/2 z); changed in place.
    lanes : int64, indices of the settings to advance, best a multiple of 48.
    table : `forcing_table` of the steps per period.
    peak : float64, shape (N,), raised to the largest z^2 + p^2 of any oscillator at every eighth step.
    """
    n, total = system.lam.shape[1], len(lanes)
    shared, rows, high = np.zeros(_SHARED), np.zeros(n * _ROW), np.empty(_LANES)
    for start in range(0, total, _LANES):
        for w in range(_LANES):
            i = lanes[min(start + w, total - 1)]
            h = system.period[i] / table.shape[0]
            shared[_STEP + w], high[w] = h, peak[i]
            shared[_DRIVE + w] = system.constant[i, 0]
            shared[_DRIVE + _LANES + w], shared[_DRIVE + 2 * _LANES + w] = system.drive[i, 0], system.drive[i, 1]
            for m in range(n):
                at = m * _ROW + w
                rows[at], rows[at + _LANES] = state[i, m], state[i, n + m] / h
                rows[at + _LINK], rows[at + _CONSTANT] = system.lam[i, m], system.constant[i, m] if m else 0.0
                rows[at + _PULL] = system.lam[i, m] if m else 1.0
        _run(shared, rows, system, table, first, count, high)
        for w in range(min(_LANES, total - start)):
            i = lanes[start + w]
            peak[i] = high[w]
            for m in range(n):
                at = m * _ROW + w
                state[i, m], state[i, n + m] = rows[at], rows[at + _LANES] * shared[_STEP + w]
