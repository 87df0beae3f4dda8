"""What acts on a device beside the equation of its chains: the piezo's own ways, its amplifier, a fingertip, spread."""

from __future__ import annotations

import math
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from .calibrated import ActuatorSpread

__all__ = ["HigherMode", "Surroundings"]

Finite = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Share = Annotated[float, Field(ge=0, lt=1, allow_inf_nan=False)]


class _Part(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", defer_build=True)


class HigherMode(_Part):
    """A higher bending mode: `omega` its frequency over f0, `delta` its damping, `gain` its share of the force."""

    omega: Positive
    delta: NotNegative
    gain: Finite


class Surroundings(_Part):
    """What acts on a device beside what its profile says; what is left out is not there.

    Attributes
    ----------
    preload : constant force of a fingertip on the first actuator of every chain, dimensionless.
    touch_stiffness : what a fingertip adds to the stiffness of every actuator, in units of its own.
    touch_damping : what a fingertip adds to every delta.
    hysteresis : of the piezo: a force e acts as e - h, where h follows `hysteresis` times e for small forces.
    saturation : what h never exceeds, dimensionless force; None is no end.
    creep_per_decade : growth of a constant force's effect in every decade of time, for three decades.
    creep_first_s : where the first of them begins, seconds.
    modes : higher bending modes, at most two.
    row_lam : coupling from the actuator above, which no profile has.
    bandwidth_hz : -3 dB of the amplifier; None is no end.
    amplifier_noise : of every amplifier channel, rms at all frequencies up to half of its rate, relative to its volts.
    converter_bits : the converter makes 2^bits - 1 voltages; None is as the amplifier says.
    spread : from actuator to actuator, where the profile's own `spread` says nothing. Plans do not count on it.
    """

    preload: Finite = 0.0
    touch_stiffness: NotNegative = 0.0
    touch_damping: NotNegative = 0.0
    hysteresis: Share = 0.0
    saturation: Positive | None = None
    creep_per_decade: NotNegative = 0.0
    creep_first_s: Positive = 0.1
    modes: Annotated[tuple[HigherMode, ...], Field(max_length=2)] = ()
    row_lam: NotNegative = 0.0
    bandwidth_hz: Positive | None = None
    amplifier_noise: Share = 0.0
    converter_bits: Annotated[int, Field(ge=2, le=32)] | None = None
    spread: ActuatorSpread = ActuatorSpread()

    @property
    def largest_loop(self) -> float:
        """The most that hysteresis takes from a force; infinite where it has no end."""
        return math.inf if self.saturation is None else self.saturation

    @property
    def bandwidth(self) -> float:
        """`bandwidth_hz`, infinite where it has no end."""
        return math.inf if self.bandwidth_hz is None else self.bandwidth_hz
