"""Bars that walk over single actuators: each takes two tones at any spacing, and goes any way that is smooth."""

from __future__ import annotations

import math

import numpy as np

from chainsim import Device

from ..operating_point import OperatingPoint
from ..plan import Ramp, ToneRamp
from ..transitions import jets
from ..transitions.joining import as_tone
from .walking import Walks

__all__ = ["SingleWalk"]

# The length of a way in periods, its smoothness, and its nodes.
PERIODS, SMOOTHNESS, NODES = 40, 5, 161


class SingleWalk(Walks):
    """Two tones of an actuator that is alone, each in closed form, and so are the ways."""

    def enter(self, point: OperatingPoint, moves: bool) -> Ramp:
        """Up a smooth step."""
        return _ramp(self.device, point, rises=True)

    def leave(self, point: OperatingPoint, moves: bool) -> Ramp:
        """Down a smooth step."""
        return as_tone(_ramp(self.device, point, rises=False), point.omega)


def _ramp(device: Device, point: OperatingPoint, *, rises: bool) -> Ramp:
    """One actuator follows a smooth step times its motion; the drive is what the equation asks for on the way.

    A tone c s(tau) takes ``(1 - omega^2 + i delta omega) c s + (2 i omega + delta) c s' + c s''`` and, of the cubic
    term, what it takes in the end times s^3.
    """
    duration = 2 * math.pi * PERIODS
    blend = jets.smoothstep(SMOOTHNESS, NODES, 4)
    s0, s1, s2, s3 = (blend[k] * math.factorial(k) * duration**-k for k in range(4))
    if not rises:
        s0, s1, s2, s3 = 1 - s0, -s1, -s2, -s3
    tones = []
    for tone in point.every_tone:
        phasor = complex(tone.phasor[0])
        stage, drag = 1 - tone.omega**2 + 1j * device.delta * tone.omega, 2j * tone.omega + device.delta
        cubic = tone.epsilon - stage * phasor
        envelope = phasor * (stage * s0 + drag * s1 + s2) + cubic * s0**3
        slope = phasor * (stage * s1 + drag * s2 + s3) + 3 * cubic * s0**2 * s1
        tones.append(ToneRamp(tone.omega, envelope, slope * device.tau_per_s))
    first, *others = tones
    t_s = np.linspace(0.0, duration / device.tau_per_s, NODES)
    return Ramp(t_s=t_s, epsilon=first.epsilon, epsilon_slope=first.epsilon_slope, tones=tuple(others))
