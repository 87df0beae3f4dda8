"""What acts on a device beside what its profile says."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from chainsim import Device

from .robustness.spread import RelativeSpread, known_spread

__all__ = ["HigherMode", "Surroundings", "assumed"]

# The paper's finite elements: frequencies of the second and third bending mode over the first.
MODES_HZ, FIRST_HZ = (661.03, 1258.3), 133.13
# Shares of the force of a uniform cantilever bent by a moment along its length (Euler and Bernoulli).
MODE_GAINS = (3.4731, 5.7019)


@dataclass(frozen=True)
class HigherMode:
    """A higher bending mode: `omega` its frequency over f0, `delta` its damping, `gain` its share of the force."""

    omega: float
    delta: float
    gain: float


@dataclass(frozen=True)
class Surroundings:
    """What acts on a device beside what its profile says; 0 or empty is nothing.

    Attributes
    ----------
    preload : constant force of a fingertip on the first actuator of every chain, dimensionless.
    hysteresis, saturation : of the piezo: a force e acts as e - h, where h follows `hysteresis` times e for small
        forces and never exceeds `saturation` (dimensionless force).
    creep_per_decade, creep_first_s : growth of a constant force's effect in every decade of time, for three decades
        from the first time on.
    modes : higher bending modes.
    row_lam : coupling from the actuator above, which no profile has.
    bandwidth_hz : -3 dB of the amplifier.
    spread : from actuator to actuator.
    """

    preload: float = 0.0
    hysteresis: float = 0.0
    saturation: float = math.inf
    creep_per_decade: float = 0.0
    creep_first_s: float = 0.1
    modes: tuple[HigherMode, ...] = ()
    row_lam: float = 0.0
    bandwidth_hz: float = math.inf
    spread: RelativeSpread = field(default_factory=RelativeSpread)


def assumed(device: Device) -> Surroundings:
    """What is assumed of a device beyond its profile.

    PZT-5A: a loop of 10 % and 2 % creep per decade from 0.1 s on; the paper's higher modes with the shares of a
    uniform beam; an amplifier of half its sample rate; 1 % spread of the natural frequencies. No fingertip, no coupling
    of rows.
    """
    modes = tuple(
        HigherMode(hz / FIRST_HZ, device.delta * hz / FIRST_HZ, gain)
        for hz, gain in zip(MODES_HZ, MODE_GAINS, strict=True)
    )
    return Surroundings(
        hysteresis=0.1, saturation=0.1 * device.epsilon_max, creep_per_decade=0.02, creep_first_s=0.1, modes=modes,
        bandwidth_hz=device.amplifier.rate_hz / 2,
        spread=known_spread(device) if device.spread else RelativeSpread(f0=0.01),
    )  # fmt: skip
