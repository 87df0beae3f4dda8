"""How long a chain has to rest between two motions, so that what is left of the first does not spoil the second.

Every stage magnifies what is left in the stages before it, and a way that is planned from rest knows nothing of it:
the whole way is followed in the full equations, from the first motion, with ever longer rests.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from chainsim import Device

from ..drive import FirstOrderHold, felt, play
from ..operating_point import OperatingPoint
from ..plan import Ramp
from .check import SAMPLES_PER_PERIOD as SAMPLES, Orbit
from .rise import orbit_of

__all__ = ["rested"]

Floats = NDArray[np.float64]

# Rests tried, in e-folds of a single actuator, and for how many of them the motion is watched afterwards.
RESTS, WATCHED = (0.0, 0.5, 1.0, 2.0, 3.5, 5.0, 7.0, 9.0, 14.0, 20.0, 30.0), 2.0
# Largest deviation, relative to the largest amplitude; deviations that differ by no more than a factor are alike.
GOOD, LIKE = 7e-4, 1.2


def rested(device: Device, before: OperatingPoint, after: OperatingPoint, way: Callable[[float], Ramp]) -> Ramp:
    """The way with the shortest rest after which `after` stands, or stands as well as after any.

    Parameters
    ----------
    before, after : motions of one tone.
    way : the whole way for a rest of so many seconds.
    """
    tried: list[tuple[float, Ramp]] = []
    for rest in RESTS:
        ramp = way(rest * 2 / device.delta / device.tau_per_s)
        tried.append((_missed(device, before, after, ramp), ramp))
        if tried[-1][0] <= GOOD:
            return ramp
    # What no rest betters is not what the first motion left.
    least = min(missed for missed, _ in tried)
    return next(ramp for missed, ramp in tried if missed <= LIKE * least)


def _missed(device: Device, before: OperatingPoint, after: OperatingPoint, ramp: Ramp) -> float:
    """Worst deviation after the way, relative to the largest amplitude of `after`."""
    dtau = 2 * math.pi / after.omega / SAMPLES
    steps = math.ceil(ramp.duration_s * device.tau_per_s / dtau)
    watched = math.ceil(WATCHED * 2 / device.delta / dtau / SAMPLES)
    tau = np.arange(steps + watched * SAMPLES, dtype=np.float64) * dtau
    ahead = _prelude(device, before, dtau), before.lam
    z = play(device, after, ramp, tau, ahead=ahead)[steps:]
    carrier = np.exp(1j * after.omega * tau[steps:, None])
    away = np.abs(felt(z, carrier, SAMPLES) - after.phasor).max() / np.abs(after.phasor).max()
    return float(away) if np.isfinite(away) else math.inf


def _prelude(device: Device, held: OperatingPoint, dtau: float) -> Floats:
    """Forces on every actuator that lead from rest to a motion at tau = 0, up to the sample before it."""
    orbit = orbit_of(device.chain, held)[0] or Orbit(held.phasor[None, :], held.lam, held.omega)
    return orbit.prelude(device.chain, dtau, 0.0) / FirstOrderHold.of(held.omega, dtau).passed
