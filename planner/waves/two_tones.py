"""Bars that walk: a wave of two tones that stands under one lam, with all it takes in closed equations.

In a chain where every stage does the same, ``A_m(tau) = sum_k c_k e^{i omega_k tau - i (phi + k step) m}``,
omega_k = omega_0 + k spacing: two tones of one amplitude, k = 0 and 1, and beside them the small combinations a
cubic spring makes of them. Each stage asks, in the slow flow,

    (1 - omega_k^2 + i delta omega_k + lam - lam e^{i (phi + k step)}) c_k + (3/4) beta [|A|^2 A]_k = 0,

and the drive is what is left of the same without lam. So a drive of the two tones and a little of their
combinations gives every actuator the same amplitudes exactly (theory.md section 2.5).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from chainsim import Chain, Closure

__all__ = ["MAIN", "ORDERS", "TwoToneWave", "apart", "two_tones"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

# Tones k, those of the wish among them.
ORDERS = np.arange(-2, 4)
MAIN = 2
POINTS = 32
STEPS, MET, DIFFERENCE = 30, 1e-12, 1e-7


@dataclass(frozen=True)
class TwoToneWave:
    """A wave of two tones along a chain.

    Attributes
    ----------
    lam : of every link.
    omega : float64, shape (6,), of the tones k = -2..3, over f0.
    lag : float64, shape (6,), of each tone from actuator to actuator, radians.
    epsilon : complex128, shape (6,), drive phasors.
    phasor : complex128, shape (6,), of the first actuator.
    """

    lam: float
    omega: Floats
    lag: Floats
    epsilon: Complexes
    phasor: Complexes

    @property
    def width(self) -> float:
        """Width of a bar in actuators."""
        return math.pi / float(self.lag[MAIN + 1] - self.lag[MAIN])

    @property
    def spacing(self) -> float:
        """How far apart the two tones are, over f0: the beat rate."""
        return float(self.omega[MAIN + 1] - self.omega[MAIN])


def apart(chain: Chain, *, amplitude: float, width: float, spacing: float) -> TwoToneWave:
    """Two tones of this amplitude each on single actuators, which take any spacing: no combination of them moves.

    Parameters
    ----------
    width : of a bar in actuators.
    spacing : of the tones, over f0; they lie on both sides of resonance.
    """
    step = math.pi / width
    middle = math.sqrt(max(1 + 2.25 * chain.beta * amplitude**2, 0.1)) - spacing / 2
    phasor = np.where((ORDERS == 0) | (ORDERS == 1), amplitude, 0.0).astype(np.complex128)
    parts = _Parts(0.0, np.asarray(middle + spacing * ORDERS), np.asarray((math.pi - step) / 2 + step * ORDERS), phasor)
    return TwoToneWave(parts.lam, parts.omega, parts.lag, _drive(chain, parts), phasor)


def two_tones(chain: Chain, *, amplitude: float, width: float, lam: float | None = None) -> TwoToneWave | None:
    """The wave of two tones of this amplitude each; None where Newton's method finds none.

    Parameters
    ----------
    width : of a bar in actuators, above 1; a first guess only where `lam` is given, which then decides it.
    """
    step = math.pi / width
    lag = (math.pi - step) / 2
    link = chain.delta / math.sin(lag) if lam is None else lam
    bend = 2.25 * chain.beta * amplitude**2
    omega = [math.sqrt(max(1 + bend + link * (1 - math.cos(one)), 0.1)) for one in (lag, lag + step)]
    x = np.concatenate([[lag, step if lam is not None else link, *omega], np.zeros(2 * len(ORDERS) - 4)])
    found = _newton(lambda one: _defect(chain, amplitude, _parts(one, amplitude, step, lam)), x)
    if found is None:
        return None
    parts = _parts(found, amplitude, step, lam)
    if parts.lam < 0 or parts.omega[MAIN + 1] <= parts.omega[MAIN] or np.abs(parts.phasor).max() > 1.5 * amplitude:
        return None
    epsilon = _drive(chain, parts)
    if chain.closure is Closure.RING:
        epsilon = epsilon + parts.lam * (1 - np.exp(-1j * parts.lag * (chain.n - 1))) * parts.phasor
    return TwoToneWave(parts.lam, parts.omega, parts.lag, epsilon, parts.phasor)


@dataclass(frozen=True)
class _Parts:
    lam: float
    omega: Floats
    lag: Floats
    phasor: Complexes


def _parts(x: Floats, amplitude: float, step: float, lam: float | None) -> _Parts:
    """Unknowns: the lag of tone 0, lam (or the step of lags, where lam is given), two frequencies, the side tones."""
    side = amplitude * (x[4::2] + 1j * x[5::2])
    phasor = np.concatenate([side[:MAIN], [amplitude, amplitude], side[MAIN:]])
    step, lam = (step, float(x[1])) if lam is None else (float(x[1]), lam)
    return _Parts(lam, x[2] + (x[3] - x[2]) * ORDERS, x[0] + step * ORDERS, phasor)


_TURNS = np.exp(2j * np.pi * np.outer(np.arange(POINTS), ORDERS) / POINTS)


def _cubic(chain: Chain, phasor: Complexes) -> Complexes:
    motion = _TURNS @ phasor
    return np.asarray(0.75 * chain.beta * (_TURNS.conj().T @ (np.abs(motion) ** 2 * motion)) / POINTS)


def _drive(chain: Chain, parts: _Parts) -> Complexes:
    stage = 1 - parts.omega**2 + 1j * chain.delta * parts.omega
    return np.asarray(stage * parts.phasor + _cubic(chain, parts.phasor))


def _defect(chain: Chain, amplitude: float, parts: _Parts) -> Floats:
    left = _drive(chain, parts) + parts.lam * (1 - np.exp(1j * parts.lag)) * parts.phasor
    return np.concatenate([left.real, left.imag]) / (amplitude * chain.delta)


def _newton(defect: Callable[[Floats], Floats], x: Floats) -> Floats | None:
    for _ in range(STEPS):
        here = defect(x)
        if not np.isfinite(here).all():
            return None
        if np.abs(here).max() < MET:
            return x
        slope = np.stack([(defect(x + DIFFERENCE * row) - here) / DIFFERENCE for row in np.eye(len(x))], axis=1)
        try:
            x = x - np.linalg.solve(slope, here)
        except np.linalg.LinAlgError:
            return None
        if np.abs(here).max() < 1e-7:
            return x
    return None
