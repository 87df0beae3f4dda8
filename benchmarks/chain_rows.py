"""The chain as rows of numbers, a lane a chain, for integrators: its slope, and how its end depends on its start.

Rows 2m and 2m + 1 are z and v = dz/dtau of oscillator m. With variations follow, for each z_j and v_j at the start,
the derivatives of z_m and v_m by it for m >= j; those before j are 0, since coupling runs one way. The independent
variable is the phase omega tau, so that all lanes have one period, 2 pi, and one drive.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray
from problem import CHAIN

from chainsim import Setting

__all__ = ["STATES", "VARIED", "given_of", "rows_of", "slope", "states_of", "turned"]

Floats = NDArray[np.float64]

N, DELTA = CHAIN.n, CHAIN.delta
STATES = 2 * N
"""Rows of the states alone."""
PAIRS = [(m, j, k) for j in range(N) for k in range(2) for m in range(j, N)]
VARIED = STATES + 2 * len(PAIRS)
"""Rows with variations."""


@njit(fastmath=True)
def slope(phase: float, y: Floats, out: Floats, given: Floats) -> None:
    """Writes dy/dphase into `out`; shapes (rows, lanes), and (3, lanes) of epsilon, lam and 1/omega."""
    lanes, row = y.shape[1], 2 * N
    pull = np.cos(phase)
    for m in range(N):
        for w in range(lanes):
            z, v, rate = y[2 * m, w], y[2 * m + 1, w], given[2, w]
            push = given[1, w] * (y[2 * m - 2, w] - z) if m else given[0, w] * pull
            out[2 * m, w] = rate * v
            out[2 * m + 1, w] = rate * (push - DELTA * v - z + z * z * z)
    if y.shape[0] == row:
        return
    for j in range(N):
        for _ in range(2):
            for m in range(j, N):
                for w in range(lanes):
                    z, u, rate = y[2 * m, w], y[row, w], given[2, w]
                    push = -given[1, w] * u if m else 0.0
                    if m > j:
                        push += given[1, w] * y[row - 2, w]
                    out[row, w] = rate * y[row + 1, w]
                    out[row + 1, w] = rate * (push - DELTA * y[row + 1, w] + (3 * z * z - 1) * u)
                row += 2


def given_of(asked: Setting, part: slice) -> Floats:
    """Epsilon, lam and 1/omega of some settings, shape (3, lanes)."""
    return np.stack([asked.epsilon[part], asked.lam[part, 1], 1 / asked.omega[part]])


def rows_of(states: Floats, rows: int) -> Floats:
    """Rows of states (lanes, 2n: z, then v); variations begin as the identity."""
    made = np.zeros((rows, len(states)))
    made[0:STATES:2], made[1:STATES:2] = states[:, :N].T, states[:, N:].T
    if rows == VARIED:
        for row, (m, j, k) in enumerate(PAIRS):
            made[STATES + 2 * row + k] = m == j
    return made


def states_of(rows: Floats) -> Floats:
    """The states (lanes, 2n) of rows."""
    return np.concatenate([rows[0:STATES:2], rows[1:STATES:2]]).T.copy()


def turned(rows: Floats) -> Floats:
    """Derivatives of the end by the start, shape (lanes, 2n, 2n), in the order of `states_of`."""
    made = np.zeros((rows.shape[1], STATES, STATES))
    for row, (m, j, k) in enumerate(PAIRS):
        made[:, m, j + N * k] = rows[STATES + 2 * row]
        made[:, N + m, j + N * k] = rows[STATES + 2 * row + 1]
    return made
