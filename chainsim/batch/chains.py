"""Open chains, oscillator by oscillator, a block of settings at a time: the kernel behind `sweep`."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..compiled import compiled
from ..inlined import inlined
from .balance import (
    BRANCH,
    DEAD,
    DECAY,
    DONE,
    ERROR,
    FORCE,
    LAM,
    OM2,
    RATE,
    ROWS,
    SIZE,
    STIFF,
    TRACE,
    WIDTH,
    X,
    correct,
    finish,
    start,
)
from .multipliers import half_traces

__all__ = ["SAFETY", "Found", "Given", "larger", "march_blocks", "solve_block", "store", "write_multipliers"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

_MOST_CORRECTIONS = 12
SAFETY = 2.0
"""One Newton step measures the left-out harmonic to first order; twice it covers the rest."""


class Given(NamedTuple):
    """Settings as the kernels take them, in the chain's own units.

    epsilon, omega, phase : float64, shape (N,). lam : float64, shape (N, n). delta : damping. sign : of beta or 0.
    length : scaled z over z.
    """

    epsilon: Floats
    lam: Floats
    omega: Floats
    phase: Floats
    delta: float
    sign: float
    length: float


class Found(NamedTuple):
    """What the kernels fill in; see `SweepResult`. `estimate` is NaN where nothing was found."""

    phasor: Complexes
    third: Complexes
    multipliers: Complexes
    branch: NDArray[np.int8]
    answers: NDArray[np.int8]
    estimate: Floats
    largest: Floats


@inlined
def write_multipliers(out: Complexes, trace: float, decay: float) -> float:
    """The two multipliers of a turn from half a turn's half-trace; returns the larger modulus."""
    square = (trace - 1.0) * (trace + 1.0)
    root = math.sqrt(abs(square))
    if square < 0:
        u = complex(trace, root)
        u = u * u * decay
        out[0], out[1] = u, u.conjugate()
        return decay
    large = trace + root if trace > 0 else trace - root
    large *= large
    out[0], out[1] = complex(large * decay, 0.0), complex(decay / large, 0.0)
    return large * decay


@inlined
def larger(largest: float, modulus: float) -> float:
    """The larger; not a number stays, for a multiplier that is not known must not read as a stable one."""
    return largest if modulus <= largest or math.isnan(largest) else modulus


@inlined
def _load(block: Floats, given: Given, first: int, last: int) -> None:
    for w in range(WIDTH):
        i = min(first + w, last - 1)
        omega = given.omega[i]
        block[OM2 + w], block[RATE + w] = omega * omega, given.delta * omega
        block[DECAY + w] = math.exp(-math.pi * given.delta / omega)
        block[DEAD + w] = block[SIZE + w] = block[SIZE + WIDTH + w] = 0.0
        for row in range(4):
            block[ERROR + row * WIDTH + w] = 0.0
        strength = given.epsilon[i] * given.length
        for row in range(6):
            block[FORCE + row * WIDTH + w] = 0.0
        block[FORCE + w] = strength * math.cos(given.phase[i])
        block[FORCE + WIDTH + w] = strength * math.sin(given.phase[i])


@inlined
def _next(block: Floats, given: Given, first: int, last: int, m: int) -> None:
    """Stiffness, link and (but for the first) force of oscillator m."""
    for w in range(WIDTH):
        block[LAM + w] = given.lam[min(first + w, last - 1), m]
    if m == 0:
        for w in range(WIDTH):
            block[LAM + w], block[STIFF + w] = 0.0, 1.0 + block[LAM + w]
        return
    for w in range(WIDTH):
        lam = block[LAM + w]
        block[STIFF + w] = 1.0 + lam
        for row in range(6):
            block[FORCE + row * WIDTH + w] = lam * block[X + row * WIDTH + w]


@inlined
def store(block: Floats, w: int, given: Given, found: Found, i: int, m: int) -> None:
    """Write what lane w of a block holds as oscillator m of setting i."""
    back = 1.0 / given.length
    found.phasor[i, m] = complex(block[X + w] * back, block[X + WIDTH + w] * back)
    found.third[i, m] = complex(block[X + 2 * WIDTH + w] * back, block[X + 3 * WIDTH + w] * back)
    found.branch[i, m] = np.int8(block[BRANCH + w])
    found.answers[i, m] = np.int8(block[BRANCH + WIDTH + w])
    modulus = write_multipliers(found.multipliers[i, m], block[TRACE + w], block[DECAY + w])
    found.largest[i] = larger(found.largest[i], modulus)
    if block[DEAD + w] > 0:
        found.estimate[i] = math.nan


@inlined
def solve_block(block: Floats, table: Floats, quarter: float, sign: float) -> None:
    """One oscillator of every lane under the forces in the block; a lane without an answer is marked dead."""
    start(block, sign)
    for _ in range(_MOST_CORRECTIONS):
        if correct(block, sign) == 0:
            break
    for w in range(WIDTH):
        if block[DONE + w] == 0.0:
            block[DEAD + w] = 1.0
    finish(block, sign)
    half_traces(block, table, quarter, sign)


@compiled
def march_blocks(given: Given, found: Found, table: Floats, first: int, last: int) -> None:
    """Solve settings first..last-1 on the lower branch.

    Parameters
    ----------
    table : `multipliers.nodes`.
    found : `largest` has to be 0 and `estimate` is set; NaN marks a setting whose correction did not converge, its
        other entries are meaningless then.
    """
    block = np.zeros(ROWS)
    quarter = 0.25 * given.delta * given.delta
    for at in range(first, last, WIDTH):
        end = min(at + WIDTH, last)
        _load(block, given, at, end)
        found.estimate[at:end] = 0.0
        for m in range(given.lam.shape[1]):
            _next(block, given, at, end, m)
            solve_block(block, table, quarter, given.sign)
            for w in range(end - at):
                store(block, w, given, found, at + w, m)
        for w in range(end - at):
            if block[SIZE + w] > 0:
                found.estimate[at + w] += SAFETY * block[SIZE + WIDTH + w] / block[SIZE + w]
