"""Runge-Kutta steps of a chain with every term; a term that is off has arrays of length 0."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..compiled import compiled
from ..inlined import inlined

__all__ = ["Plant", "advance", "beside", "push_plays", "slope"]

Floats = NDArray[np.float64]


class Plant(NamedTuple):
    """One setting of a chain with its terms.

    delta, beta, stiffness, lam, other, bias : float64, shape (n,); `lam` links m - 1 into m (round a ring the last into
        the first), `other` m + stride into m. preload : on the first.
    back : 1 for resistor links, 0 for amplifiers.
    tones : float64, shape (T, 3), epsilon, omega, phase. ramp : tau over which they are raised from 0, 0 for at once.
    amplifier : (3,) bandwidth, slew, limit, or (0,).
    bouc : (3,) gain, loading, unloading, or (0,). radius, weight : (R,); base : share of e beside the plays.
    creep : (C,) rates 1/T_i. creep_gain : g. modes : float64, shape (J, 3), omega^2, delta, gain.
    """

    delta: Floats
    beta: Floats
    stiffness: Floats
    lam: Floats
    other: Floats
    stride: int
    back: float
    bias: Floats
    preload: float
    tones: Floats
    ramp: float
    amplifier: Floats
    bouc: Floats
    radius: Floats
    weight: Floats
    base: float
    creep: Floats
    creep_gain: float
    modes: Floats


@inlined
def _tips(state: Floats, plant: Plant, tips: Floats) -> None:
    """Displacement (row 0) and velocity (row 1) of every tip."""
    modes, first = len(plant.modes), 3 + len(plant.creep)
    for m in range(len(plant.lam)):
        tips[0, m], tips[1, m] = state[m, 0], state[m, 1]
        for j in range(modes):
            tips[0, m] += state[m, first + j]
            tips[1, m] += state[m, first + modes + j]


@inlined
def _drive(tau: float, plant: Plant, u: float, out: Floats) -> None:
    """out = drive, its derivative, u'."""
    wanted, slope, tones = 0.0, 0.0, plant.tones
    for k in range(len(tones)):
        angle = tones[k, 1] * tau + tones[k, 2]
        wanted += tones[k, 0] * np.cos(angle)
        slope -= tones[k, 0] * tones[k, 1] * np.sin(angle)
    if tau < plant.ramp:
        wanted, slope = wanted * tau / plant.ramp, (slope * tau + wanted) / plant.ramp
    out[0], out[1], out[2] = wanted, slope, 0.0
    if len(plant.amplifier):
        rate = min(max(plant.amplifier[0] * (wanted - u), -plant.amplifier[1]), plant.amplifier[1])
        limit = plant.amplifier[2]
        out[0], out[2] = min(max(u, -limit), limit), rate
        out[1] = rate if abs(u) < limit else 0.0


@inlined
def _electric(m: int, tips: Floats, drive: Floats, plant: Plant, rate: int) -> float:
    """Electric force on oscillator m (rate 0), or its change (rate 1)."""
    n, lam, other = len(plant.lam), plant.lam[m], plant.other[m]
    e = float(drive[rate]) if m == 0 else 0.0
    if rate == 0:
        e += plant.bias[m]
    if lam != 0.0:
        e += lam * tips[rate, m - 1 if m else n - 1]
    if other != 0.0:
        e += other * tips[rate, m + plant.stride]
    return float(e - plant.back * (lam + other) * tips[rate, m])


@inlined
def _force(m: int, e: float, change: float, state: Floats, play: Floats, plant: Plant, out: Floats) -> float:
    """Force under the electric force `e` that changes at the rate `change`; writes the rates of h and the creep."""
    f = plant.base * e
    for i in range(len(plant.radius)):
        f += plant.weight[i] * min(max(play[m, i], e - plant.radius[i]), e + plant.radius[i])
    if len(plant.bouc):
        h = state[m, 2]
        f -= h
        out[m, 2] = plant.bouc[0] * change - plant.bouc[1] * abs(change) * h - plant.bouc[2] * change * abs(h)
    whole = f
    for i in range(len(plant.creep)):
        whole += state[m, 3 + i]
        out[m, 3 + i] = plant.creep[i] * (plant.creep_gain * f - state[m, 3 + i])
    return whole


@compiled
def slope(tau: float, state: Floats, play: Floats, plant: Plant, scratch: Floats, out: Floats) -> None:
    """The rates of the whole state.

    `scratch` has two rows for the tips and one, of three or more numbers, for the drive.
    """
    n, modes, first = len(plant.lam), len(plant.modes), 3 + len(plant.creep)
    drive = scratch[2]
    _drive(tau, plant, state[n, 0], drive)
    _tips(state, plant, scratch)
    out[n, 0] = drive[2]
    for m in range(n):
        e = _electric(m, scratch, drive, plant, 0)
        change = _electric(m, scratch, drive, plant, 1) if len(plant.bouc) else 0.0
        f = _force(m, e, change, state, play, plant, out)
        z, v = state[m, 0], state[m, 1]
        out[m, 0] = v
        out[m, 1] = f - plant.delta[m] * v - plant.stiffness[m] * z - plant.beta[m] * z * z * z
        for j in range(modes):
            q, w = state[m, first + j], state[m, first + modes + j]
            out[m, first + j] = w
            out[m, first + modes + j] = plant.modes[j, 2] * f - plant.modes[j, 1] * w - plant.modes[j, 0] * q
    out[0, 1] += plant.preload


@inlined
def beside(state: Floats, h: float, work: Floats, k: int) -> None:
    """work[4] = state + h work[k]."""
    for m in range(state.shape[0]):
        for j in range(state.shape[1]):
            work[4, m, j] = state[m, j] + h * work[k, m, j]


@inlined
def _step(tau: float, h: float, state: Floats, play: Floats, plant: Plant, scratch: Floats, work: Floats) -> None:
    """One step of the classical method in place; `work` has room for four slopes and a state."""
    here = work[4]
    slope(tau, state, play, plant, scratch, work[0])
    beside(state, 0.5 * h, work, 0)
    slope(tau + 0.5 * h, here, play, plant, scratch, work[1])
    beside(state, 0.5 * h, work, 1)
    slope(tau + 0.5 * h, here, play, plant, scratch, work[2])
    beside(state, h, work, 2)
    slope(tau + h, here, play, plant, scratch, work[3])
    for m in range(state.shape[0]):
        for j in range(state.shape[1]):
            state[m, j] += (h / 6) * (work[0, m, j] + 2 * work[1, m, j] + 2 * work[2, m, j] + work[3, m, j])


@inlined
def push_plays(tau: float, state: Floats, play: Floats, plant: Plant, scratch: Floats) -> None:
    """Let the plays follow the electric force that is there."""
    n = len(plant.lam)
    _drive(tau, plant, state[n, 0], scratch[2])
    _tips(state, plant, scratch)
    for m in range(n):
        e = _electric(m, scratch, scratch[2], plant, 0)
        for i in range(len(plant.radius)):
            play[m, i] = min(max(play[m, i], e - plant.radius[i]), e + plant.radius[i])


@compiled
def advance(
    state: Floats, play: Floats, plant: Plant, begin: float, h: float, every: int, limit: float, seen: Floats
) -> int:
    """Classical Runge-Kutta steps in place; row k of `seen` gets the tips after (k + 1) `every` steps.

    Returns how many rows were written: fewer where a |z| passed `limit`.
    """
    n = len(plant.lam)
    work, scratch = np.zeros((5, state.shape[0], state.shape[1])), np.zeros((3, max(n, 3)))
    for k in range(len(seen)):
        for j in range(every):
            tau = begin + (k * every + j) * h
            _step(tau, h, state, play, plant, scratch, work)
            if len(plant.radius):
                push_plays(tau + h, state, play, plant, scratch)
        _tips(state, plant, scratch)
        for m in range(n):
            if not abs(state[m, 0]) <= limit:
                return k
            seen[k, m] = scratch[0, m]
    return len(seen)
