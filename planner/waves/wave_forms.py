"""Closed forms of waves: the settings under which each actuator lags its neighbour by one angle, at one ratio."""

from __future__ import annotations

import cmath
import math

import numpy as np
from numpy.typing import NDArray

from chainsim import Chain, Closure

from ..operating_point import OperatingPoint

__all__ = ["lag_and_ratio", "wave_for", "wave_on"]

Complexes = NDArray[np.complex128]


def wave_for(chain: Chain, *, amplitude: float, lag: float, ratio: float = 1.0) -> OperatingPoint:
    """The point with ``A_m = amplitude ratio^m e^{-i m lag}``, in one harmonic.

    ``lam = r delta omega / sin lag`` and ``omega^2 = 1 + (3/4) beta a^2 + lam (1 - cos(lag) / r)`` (docs/theory.md
    section 2.2), with a^2 the mean over the actuators behind the first; exact where r = 1 or beta = 0.

    Parameters
    ----------
    lag : radians, in (0, pi).
    ratio : > 0.
    """
    steps = np.arange(chain.n)
    bend = 0.75 * chain.beta * amplitude**2
    behind = ratio ** (2 * steps[1:])
    stiff = 1.0 + bend * float(behind.mean() if chain.n > 1 else 1.0)
    # omega^2 - pull omega - stiff = 0.
    pull = chain.delta * (ratio - math.cos(lag)) / math.sin(lag)
    omega = (pull + math.sqrt(pull**2 + 4 * max(stiff, 0.0))) / 2
    lam = ratio * chain.delta * omega / math.sin(lag)
    epsilon = _drive(chain, amplitude * ratio**steps * np.exp(-1j * lag * steps), lam, omega)
    return OperatingPoint(epsilon, np.full(chain.n - 1, lam), omega)


def wave_on(chain: Chain, *, amplitude: float, lam: float, long: bool) -> OperatingPoint | None:
    """Settings for a wave of equal amplitudes under a given lam: of the two lags, pi apart together, the shorter or
    the longer; None where lam is too small for a gain of 1.
    """
    lag = math.pi / 2
    for _ in range(20):
        wave = wave_for(chain, amplitude=amplitude, lag=lag)
        sine = chain.delta * wave.omega / lam if lam > 0 else math.inf
        if sine > 1:
            return None
        lag = math.pi - math.asin(sine) if long else math.asin(sine)
    return wave_for(chain, amplitude=amplitude, lag=lag)


def lag_and_ratio(phasor: Complexes) -> tuple[float, float]:
    """The lag (radians, in (-pi, pi]) and ratio from actuator to actuator that fit phasors best, in least squares."""
    size = float(np.sum(np.abs(phasor[:-1]) ** 2))
    step = complex(np.vdot(phasor[:-1], phasor[1:])) / size if size else 0j
    return -cmath.phase(step), abs(step)


def _drive(chain: Chain, phasor: Complexes, lam: float, omega: float) -> complex:
    stage = 1.0 - omega**2 + 0.75 * chain.beta * abs(phasor[0]) ** 2 + 1j * chain.delta * omega
    if chain.closure is Closure.RING:
        return complex((stage + lam) * phasor[0] - lam * phasor[-1])
    return complex(stage * phasor[0])
