"""Runge-Kutta steps of a chain with every term; a term that is off has arrays of length 0."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .compiled import compiled

__all__ = ["Plant", "advance"]

Floats = NDArray[np.float64]


class Plant(NamedTuple):
    """One setting of a chain with its terms.

    delta, beta, stiffness, lam, bias : float64, shape (n,). preload : on the first.
    back : 1 for resistor links, 0 for amplifiers.
    tones : float64, shape (T, 3), epsilon, omega, phase. amplifier : (3,) bandwidth, slew, limit, or (0,).
    bouc : (3,) gain, loading, unloading, or (0,). radius, weight : (R,); base : share of e beside the plays.
    creep : (C,) rates 1/T_i. creep_gain : g. modes : float64, shape (J, 3), omega^2, delta, gain.
    """

    delta: Floats
    beta: Floats
    stiffness: Floats
    lam: Floats
    back: float
    bias: Floats
    preload: float
    tones: Floats
    amplifier: Floats
    bouc: Floats
    radius: Floats
    weight: Floats
    base: float
    creep: Floats
    creep_gain: float
    modes: Floats


@compiled
def _tip(row: Floats, plant: Plant, rate: int) -> float:
    """Tip displacement (rate 0) or velocity (rate 1) of one oscillator."""
    total = float(row[rate])
    first = 3 + len(plant.creep) + rate * len(plant.modes)
    for j in range(len(plant.modes)):
        total += row[first + j]
    return total


@compiled
def _drive(tau: float, plant: Plant, u: float, out: Floats) -> None:
    """out = drive, its derivative, u'."""
    wanted, slope = 0.0, 0.0
    for k in range(len(plant.tones)):
        angle = plant.tones[k, 1] * tau + plant.tones[k, 2]
        wanted += plant.tones[k, 0] * np.cos(angle)
        slope -= plant.tones[k, 0] * plant.tones[k, 1] * np.sin(angle)
    out[0], out[1], out[2] = wanted, slope, 0.0
    if len(plant.amplifier):
        rate = min(max(plant.amplifier[0] * (wanted - u), -plant.amplifier[1]), plant.amplifier[1])
        limit = plant.amplifier[2]
        out[0], out[2] = min(max(u, -limit), limit), rate
        out[1] = rate if abs(u) < limit else 0.0


@compiled
def _force(e: float, change: float, row: Floats, play: Floats, plant: Plant, out: Floats) -> float:
    """Force under the electric force `e` that changes at the rate `change`; writes the rates of h and the creep."""
    f = plant.base * e
    for i in range(len(plant.radius)):
        f += plant.weight[i] * min(max(play[i], e - plant.radius[i]), e + plant.radius[i])
    if len(plant.bouc):
        h = row[2]
        f -= h
        out[2] = plant.bouc[0] * change - plant.bouc[1] * abs(change) * h - plant.bouc[2] * change * abs(h)
    whole = f
    for i in range(len(plant.creep)):
        whole += row[3 + i]
        out[3 + i] = plant.creep[i] * (plant.creep_gain * f - row[3 + i])
    return whole


@compiled
def _electric(m: int, state: Floats, drive: Floats, plant: Plant, rate: int) -> float:
    """Electric force on oscillator m (rate 0), or its change (rate 1)."""
    n = len(plant.lam)
    e = drive[rate] if m == 0 else 0.0
    if rate == 0:
        e += plant.bias[m]
    if plant.lam[m] != 0.0:
        e += plant.lam[m] * (_tip(state[m - 1 if m else n - 1], plant, rate) - plant.back * _tip(state[m], plant, rate))
    return e


@compiled
def _slope(tau: float, state: Floats, play: Floats, plant: Plant, drive: Floats, out: Floats) -> None:
    n, modes, first = len(plant.lam), len(plant.modes), 3 + len(plant.creep)
    _drive(tau, plant, state[n, 0], drive)
    out[n, 0] = drive[2]
    for m in range(n):
        row, to = state[m], out[m]
        e, change = _electric(m, state, drive, plant, 0), _electric(m, state, drive, plant, 1)
        f = _force(e, change, row, play[m], plant, to)
        z, v = row[0], row[1]
        to[0] = v
        to[1] = f - plant.delta[m] * v - plant.stiffness[m] * z - plant.beta[m] * z * z * z
        if m == 0:
            to[1] += plant.preload
        for j in range(modes):
            q, w = row[first + j], row[first + modes + j]
            to[first + j] = w
            to[first + modes + j] = plant.modes[j, 2] * f - plant.modes[j, 1] * w - plant.modes[j, 0] * q


@compiled
def advance(
    state: Floats, play: Floats, plant: Plant, begin: float, h: float, every: int, limit: float, seen: Floats
) -> int:
    """Classical Runge-Kutta steps in place; row k of `seen` gets the tips after (k + 1) `every` steps.

    Returns how many rows were written: fewer where a |z| passed `limit`.
    """
    n = len(plant.lam)
    k1, k2, k3, k4 = np.zeros_like(state), np.zeros_like(state), np.zeros_like(state), np.zeros_like(state)
    drive = np.empty(3)
    for k in range(len(seen)):
        for j in range(every):
            tau = begin + (k * every + j) * h
            _slope(tau, state, play, plant, drive, k1)
            _slope(tau + 0.5 * h, state + 0.5 * h * k1, play, plant, drive, k2)
            _slope(tau + 0.5 * h, state + 0.5 * h * k2, play, plant, drive, k3)
            _slope(tau + h, state + h * k3, play, plant, drive, k4)
            state += (h / 6) * (k1 + 2 * k2 + 2 * k3 + k4)
            if len(plant.radius):
                _drive(tau + h, plant, state[n, 0], drive)
                for m in range(n):
                    e = _electric(m, state, drive, plant, 0)
                    for i in range(len(plant.radius)):
                        play[m, i] = min(max(play[m, i], e - plant.radius[i]), e + plant.radius[i])
        for m in range(n):
            if not abs(state[m, 0]) <= limit:
                return k
            seen[k, m] = _tip(state[m], plant, 0)
    return len(seen)
