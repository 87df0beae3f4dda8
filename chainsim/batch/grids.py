"""Open 2-D grids, diagonal by diagonal: oscillators on one do not feed each other and are solved side by side."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..compiled import compiled
from ..inlined import inlined
from .balance import DEAD, DECAY, ERROR, FORCE, LAM, OM2, RATE, ROWS, SIZE, STIFF, WIDTH, X
from .chains import SAFETY, Found, Given, solve_block, store

__all__ = ["march_grids"]

Floats = NDArray[np.float64]

# What the next diagonal has to know of each oscillator: harmonics 1, 3, 5 and the bounds of four errors.
_SERIES, _KEPT = 6, 10


@inlined
def _load(block: Floats, given: Given, i: int) -> None:
    omega = given.omega[i]
    for w in range(WIDTH):
        block[OM2 + w], block[RATE + w] = omega * omega, given.delta * omega
        block[DECAY + w] = math.exp(-math.pi * given.delta / omega)
        block[SIZE + w] = block[SIZE + WIDTH + w] = 0.0
        # `finish` multiplies the errors it is handed by this; they come with their links here.
        block[LAM + w] = 1.0


@inlined
def _feed(
    block: Floats, before: Floats, given: Given, downs: Floats, cols: int, i: int, top: int, last: int, diagonal: int
) -> None:
    """Stiffness, force and inherited errors of the oscillators of `diagonal` from row `top` on.

    Column r + 1 of `before` holds the oscillator of row r on the diagonal before; column 0 stays 0. Lanes beyond row
    `last` repeat it.
    """
    for w in range(WIDTH):
        r = min(top + w, last)
        m = r * cols + diagonal - r
        lam, down = given.lam[i, m], downs[i, m]
        block[STIFF + w], block[DEAD + w] = 1.0 + lam + down, 0.0
        for row in range(_SERIES):
            block[FORCE + row * WIDTH + w] = lam * before[row, r + 1] + down * before[row, r]
        for row in range(_KEPT - _SERIES):
            left, above = before[_SERIES + row, r + 1], before[_SERIES + row, r]
            block[ERROR + row * WIDTH + w] = abs(lam) * left + abs(down) * above


@inlined
def _drive(block: Floats, given: Given, i: int) -> None:
    """The first oscillator's force, in every lane."""
    strength = given.epsilon[i] * given.length
    for w in range(WIDTH):
        block[FORCE + w] = strength * math.cos(given.phase[i])
        block[FORCE + WIDTH + w] = strength * math.sin(given.phase[i])


@inlined
def _keep(block: Floats, here: Floats, top: int, count: int) -> None:
    for w in range(count):
        for row in range(_SERIES):
            here[row, top + w + 1] = block[X + row * WIDTH + w]
        for row in range(_KEPT - _SERIES):
            here[_SERIES + row, top + w + 1] = block[ERROR + row * WIDTH + w]


@compiled
def march_grids(given: Given, downs: Floats, cols: int, found: Found, table: Floats, first: int, last: int) -> None:
    """Solve settings first..last-1 of a grid of `cols` columns on the lower branch.

    Parameters
    ----------
    downs : float64, shape (N, n), links from above, as `Setting.lam_y`. The rest as in `chains.march_blocks`.
    """
    rows = given.lam.shape[1] // cols
    block = np.zeros(ROWS)
    quarter = 0.25 * given.delta * given.delta
    before, here = np.zeros((_KEPT, rows + 1)), np.zeros((_KEPT, rows + 1))
    for i in range(first, last):
        found.estimate[i] = 0.0
        # A link of 0 must not multiply what an earlier setting without an answer left.
        before[:], here[:] = 0.0, 0.0
        _load(block, given, i)
        for diagonal in range(rows + cols - 1):
            # Links from beyond the grid are 0, and so is what they hand on.
            top, bottom = max(0, diagonal - cols + 1), min(rows - 1, diagonal)
            for start in range(top, bottom + 1, WIDTH):
                _feed(block, before, given, downs, cols, i, start, bottom, diagonal)
                if diagonal == 0:
                    _drive(block, given, i)
                solve_block(block, table, quarter, given.sign)
                count = min(WIDTH, bottom + 1 - start)
                _keep(block, here, start, count)
                for w in range(count):
                    r = start + w
                    store(block, w, given, found, i, r * cols + diagonal - r)
            before, here = here, before
        size, error = 0.0, 0.0
        for w in range(WIDTH):
            size, error = max(size, block[SIZE + w]), max(error, block[SIZE + WIDTH + w])
        if size > 0:
            found.estimate[i] += SAFETY * error / size
