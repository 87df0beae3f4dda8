"""What deflections held by biases can be bought for: the length of their ramp against volts and ringing.

Bias and motion on the way are closed forms. A softer or stiffer actuator rings after the way by what the way has at
its resonance; a smoother or longer one has less of it, and takes no more than the steady volts.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from chainsim import Device, Outcome

from ..amplitudes.deflection import QUICK, Deflection
from ..operating_point import OperatingPoint
from ..transitions import jets
from .effects import Linearisation
from .pareto_point import SIGMA, ParetoPoint

__all__ = ["ways_of_deflections"]

Floats = NDArray[np.float64]

# Lengths of the way in periods of the resonance.
PERIODS = (1, 1.5, 2, 3, 4, 6, 8, 12)
NODES = 1025


def ways_of_deflections(wishes: Floats, device: Device) -> tuple[list[ParetoPoint], int]:
    """Ways of different lengths to deflections, those that the amplifier allows, and how many were tried.

    Parameters
    ----------
    wishes : float64, shape (P, n), in units of full scale.
    """
    family = Deflection(device)
    rest = family.states(np.zeros_like(wishes))
    states = family.states(wishes)
    if any(state.outcome is not Outcome.OK for state in states):
        return [], len(PERIODS)
    still = max(_scatter(device, state) for state in states)
    error = max(state.error for state in states)
    points = []
    for periods in PERIODS:
        way = _Timed(device, periods / device.f0_hz)
        ramps = [ramp for ramp in way.ramps(rest, states) if ramp is not None]
        drive = max(_peak(ramp.bias) for ramp in ramps) / device.bias_max
        slew = max(_peak(ramp.bias_slope) for ramp in ramps) / device.bias_per_volt / device.amplifier.slew_v_per_s
        if drive <= 1 and slew <= 1:
            ringing = 2 * SIGMA.frequency * float(wishes.max()) * _at_resonance(periods)
            spread = math.hypot(still, ringing)
            points.append(ParetoPoint(0.0, way.ramp_s, math.inf, error, error, drive, 1.0, spread))
    return points, len(PERIODS)


class _Timed(Deflection):
    """Deflections whose ramps have a given length."""

    def __init__(self, device: Device, ramp_s: float) -> None:
        super().__init__(device)
        self._ramp_s = ramp_s

    @property
    def ramp_s(self) -> float:
        """Length of every ramp in seconds."""
        return self._ramp_s


def _peak(bias: Floats | None) -> float:
    return 0.0 if bias is None else float(np.abs(bias).max())


def _scatter(device: Device, state: OperatingPoint) -> float:
    """Standard deviation of the worst actuator while the deflection stands, in units of full scale."""
    scattered = Linearisation(device.chain, state).scattered(SIGMA, np.zeros(device.chain_length, np.bool_))
    return float(scattered.max()) / device.full_scale


def _at_resonance(periods: float) -> float:
    """How much of a smooth step of that length is at the resonance: |integral of its slope times e^{i tau}|."""
    x = np.linspace(0.0, 1.0, NODES)
    slope = jets.smoothstep(QUICK, NODES, 2)[1]
    return float(abs(np.trapezoid(slope * np.exp(2j * np.pi * periods * x), x)))
