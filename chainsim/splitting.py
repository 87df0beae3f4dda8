"""Exact damped linear flow and cubic kicks, composed to order (8, 6, 4): the transient kernel.

``z'' + delta z' + (1 + lam) z`` is solved exactly; ``-beta z^3 + lam z_prev`` and every force are kicks at
frozen position. The composition is ABA(8,6,4) of Blanes, Casas, Farres, Laskar, Makazaga and Murua,
Appl. Numer. Math. 68 (2013) 58-72: with kicks of size eps, an error of eps h^8 + eps^2 h^6 + eps^3 h^4.

The state of an oscillator is (q, p) with q = z and p = v + (delta/2) z, in which the damped flow over t is
``q' = c q + s p, p' = c p - d q``.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .compiled import compiled

__all__ = ["FLOWS", "KICKS", "KICK_TIMES", "WIDTH", "System", "advance_block", "flow", "forcing_table"]

Floats = NDArray[np.float64]

WIDTH = 16
"""Settings advanced side by side: one block of a chain of six stays in the first-level cache."""

# One oscillator's share of the workspace, in runs of WIDTH numbers: q, p, force, lam, four flows of three
# coefficients, and one run of padding against cache-set conflicts.
_ROW = 17 * WIDTH
_FLOWS_AT = 4 * WIDTH

_A = (0.0711334264982231177779387300061549964174, 0.241153427956640098736487795326289649618,
      0.521411761772814789212136078067994229991, -0.333698616227678005726562603400438876027)  # fmt: skip
_B = (0.183083687472197221961703757166430291072, 0.310782859898574869507522291054262796375,
      -0.0265646185119588006972121379164987592663, 0.0653961422823734184559721793911134363710)  # fmt: skip

FLOWS = np.array([_A[0], _A[1], _A[2], _A[3], _A[3], _A[2], _A[1], _A[0]])
"""Lengths of the eight linear flows of one step, in steps."""

KICKS = np.array([_B[0], _B[1], _B[2], _B[3], _B[2], _B[1], _B[0]])
"""Weights of the seven kicks between them."""

KICK_TIMES = np.cumsum(FLOWS)[:7]
"""When the kicks happen, in steps from the start of the step."""

# The flows that follow the kicks, as indices into the four distinct ones (a2, a3, a4, 2 a1); the last flow
# of a step is joined with the first of the next.
_AFTER = _FLOWS_AT + 3 * WIDTH * np.array([0, 1, 2, 2, 1, 0, 3])
_DISTINCT = np.array([_A[1], _A[2], _A[3], 2 * _A[0]])
_FIRST = _A[0]


class System(NamedTuple):
    """N settings of one chain, as the kernels take them.

    Attributes
    ----------
    lam : float64, shape (N, n). constant : float64, shape (N, n), forces that do not change.
    drive : float64, shape (N, 2), factors of cosine and sine of the drive's phase on the first oscillator.
    period : float64, shape (N,). delta, beta : of the chain. ring : whether its ends are joined.
    """

    lam: Floats
    constant: Floats
    drive: Floats
    period: Floats
    delta: float
    beta: float
    ring: bool


def forcing_table(steps: int) -> Floats:
    """Cosine and sine of the drive's phase at every kick of one period.

    Returns
    -------
    float64, shape (steps, 7, 2). The phase comes from the kick's index, so it does not drift.
    """
    phase = 2 * np.pi * (np.arange(steps)[:, None] + KICK_TIMES) / steps
    return np.stack([np.cos(phase), np.sin(phase)], axis=-1)


@compiled
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


@compiled
def _apply(work: Floats, h: Floats, delta: float, length: float) -> None:
    """Flow every oscillator of a block over `length` steps; p is per step."""
    for at in range(_ROW, len(work), _ROW):
        row = work[at : at + _ROW]
        for w in range(WIDTH):
            c, s, d = flow(delta, 1.0 + row[3 * WIDTH + w], length * h[w])
            x, y = row[w], row[WIDTH + w] * h[w]
            row[w] = c * x + s * y
            row[WIDTH + w] = (c * y - d * x) / h[w]


@compiled
def _set_flows(work: Floats, h: Floats, delta: float) -> None:
    """Write the distinct flows of every oscillator, for p per step (so a kick needs no length)."""
    for at in range(_ROW, len(work), _ROW):
        for k in range(4):
            row = work[at + _FLOWS_AT + 3 * k * WIDTH : at + _ROW]
            for w in range(WIDTH):
                c, s, d = flow(delta, 1.0 + work[at + 3 * WIDTH + w], _DISTINCT[k] * h[w])
                row[w], row[WIDTH + w], row[2 * WIDTH + w] = c, s * h[w], d / h[w]


@compiled
def _kick_row(row: Floats, previous: Floats, flows: Floats, b: float, beta: float) -> None:
    # Slices with constant offsets: the only form of several tried that the compiler vectorises fully.
    for w in range(WIDTH):
        x = row[w]
        y = row[WIDTH + w] + b * (row[2 * WIDTH + w] + row[3 * WIDTH + w] * previous[w] - beta * x * x * x)
        c = flows[w]
        row[w] = c * x + flows[WIDTH + w] * y
        row[WIDTH + w] = c * y - flows[2 * WIDTH + w] * x


@compiled
def _kick_and_flow(work: Floats, after: int, b: float, beta: float) -> None:
    """One kick of weight `b` and the flow after it, from the last oscillator to the first.

    In this order every oscillator still finds its predecessor where the kick has to see it.
    """
    for m in range(len(work) // _ROW - 1, 0, -1):
        at = m * _ROW
        _kick_row(
            work[at : at + 4 * WIDTH], work[at - _ROW : at - _ROW + WIDTH],
            work[at + after : at + after + 3 * WIDTH], b, beta,
        )  # fmt: skip


@compiled
def _raise_peak(work: Floats, h: Floats, peak: Floats) -> None:
    """Raise `peak` to the largest z^2 + p^2 of any oscillator; NaN counts as larger than everything."""
    for at in range(_ROW, len(work), _ROW):
        for w in range(WIDTH):
            y = work[at + WIDTH + w] * h[w]
            square = work[at + w] * work[at + w] + y * y
            peak[w] = peak[w] if square <= peak[w] else square


@compiled
def _run(
    work: Floats, h: Floats, drives: Floats, system: System, table: Floats, first: int, count: int, peak: Floats
) -> None:
    """Advance one block by `count` steps from step `first` of the period; `peak` collects max z^2 + p^2."""
    _set_flows(work, h, system.delta)
    _apply(work, h, system.delta, _FIRST)
    base, cosine, sine = drives[0], drives[1], drives[2]
    last = len(work) - _ROW
    force = work[_ROW + 2 * WIDTH : _ROW + 3 * WIDTH]
    for step in range(first, first + count):
        phases = table[step % table.shape[0]]
        for k in range(7):
            x, y = phases[k, 0], phases[k, 1]
            for w in range(WIDTH):
                force[w] = base[w] + cosine[w] * x + sine[w] * y
            if system.ring:
                for w in range(WIDTH):
                    work[w] = work[last + w]
            _kick_and_flow(work, _AFTER[k], KICKS[k], system.beta)
        if step % 8 == 7:
            _raise_peak(work, h, peak)
    _apply(work, h, system.delta, -_FIRST)


@compiled
def advance_block(
    state: Floats, lanes: NDArray[np.int64], system: System, table: Floats, first: int, count: int, peak: Floats
) -> None:
    """Advance the settings `lanes` by `count` steps from step `first` of the drive period, in place.

    Parameters
    ----------
    state : float64, shape (N, 2n), all q then all p (p = v + delta/2 z); changed in place.
    lanes : int64, indices of the settings to advance, WIDTH at a time.
    table : `forcing_table` of the steps per period.
    peak : float64, shape (N,), raised to the largest z^2 + p^2 of any oscillator at every eighth step.
    """
    n, total = system.lam.shape[1], len(lanes)
    constant, drive = system.constant, system.drive
    work = np.zeros((n + 1) * _ROW)
    drives, h, high = np.empty((3, WIDTH)), np.empty(WIDTH), np.empty(WIDTH)
    for start in range(0, total, WIDTH):
        for w in range(WIDTH):
            i = lanes[min(start + w, total - 1)]
            h[w], high[w] = system.period[i] / table.shape[0], peak[i]
            drives[0, w], drives[1, w], drives[2, w] = constant[i, 0], drive[i, 0], drive[i, 1]
            for m in range(n):
                at = (m + 1) * _ROW + w
                work[at], work[at + WIDTH] = state[i, m], state[i, n + m] / h[w]
                work[at + 2 * WIDTH], work[at + 3 * WIDTH] = constant[i, m], system.lam[i, m]
        _run(work, h, drives, system, table, first, count, high)
        for w in range(min(WIDTH, total - start)):
            i = lanes[start + w]
            peak[i] = high[w]
            for m in range(n):
                at = (m + 1) * _ROW + w
                state[i, m], state[i, n + m] = work[at], work[at + WIDTH] * h[w]
