"""Sections of a profile: ranges, coupling, amplifier, what acts on a device beside its chains, sources of values."""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

from ..equations.coupling import Closure
from .calibrated import ActuatorSpread

__all__ = [
    "Amplifier",
    "Coupling",
    "Finite",
    "HigherMode",
    "NotNegative",
    "Note",
    "Positive",
    "ProfilePart",
    "Span",
    "Surroundings",
]  # fmt: skip

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
Share = Annotated[float, Field(ge=0, lt=1, allow_inf_nan=False)]
Bits = Annotated[int, Field(ge=1, le=32)]


class ProfilePart(BaseModel):
    """A section of a profile: unknown keys are refused, nothing changes after reading."""

    model_config = ConfigDict(frozen=True, extra="forbid", defer_build=True)


class Span(ProfilePart):
    """A closed range of what a device can set."""

    min: NotNegative
    max: NotNegative

    @model_validator(mode="after")
    def _ordered(self) -> Span:
        if self.min > self.max:
            raise ValueError(f"min {self.min} is above max {self.max}; swap them")
        return self


class Coupling(ProfilePart):
    """How actuators of a chain are coupled.

    `scope` is what one lam belongs to: every link has its own (`link`), one for a chain (`chain`), one
    for the whole device (`device`), one that was built in and cannot be set (`fixed`), or the actuators are
    not coupled (`none`). With `bits`, lam can be set to 2^bits values from lam.min to lam.max; None is any.

    With `lam_y` the actuators are coupled in two dimensions: each is also fed from the one above it over such a link,
    and `drives` says which have a drive: the first of all (`corner`), the first column (`column`), or the first row and
    column (`border`).
    """

    closure: Closure = Closure.OPEN
    scope: Literal["none", "fixed", "device", "chain", "link"]
    lam: Span = Span(min=0.0, max=0.0)
    bits: Bits | None = None
    lam_y: Span | None = None
    drives: Literal["corner", "column", "border"] | None = None

    @model_validator(mode="after")
    def _consistent(self) -> Coupling:
        if self.scope == "none" and self.lam.max > 0:
            raise ValueError("scope none has no lam; remove lam or choose scope chain or link")
        if self.scope == "fixed" and self.lam.min != self.lam.max:
            raise ValueError(f"scope fixed has one lam, got {self.lam.min} to {self.lam.max}; make min and max equal")
        if (self.lam_y is None) != (self.drives is None):
            raise ValueError("lam_y and drives: give both for a grid coupled in two dimensions, or neither")
        return self if self.lam_y is None else self._in_two_dimensions()

    def _in_two_dimensions(self) -> Coupling:
        if self.closure is not Closure.OPEN:
            raise ValueError(f"closure: a grid coupled in two dimensions is open, got {self.closure}; remove lam_y")
        if self.scope not in {"chain", "link"}:
            raise ValueError(f"scope: expected chain or link where lam_y is given, got {self.scope}")
        if self.bits is not None:
            raise ValueError("bits: links in two dimensions can be set to any lam; remove bits or lam_y")
        return self

    @property
    def lam_step(self) -> float:
        """From one lam that can be set to the next; 0 where any can."""
        return 0.0 if self.bits is None else (self.lam.max - self.lam.min) / (2**self.bits - 1)


class Amplifier(ProfilePart):
    """What every output channel can do.

    With `bits`, its converter makes 2^bits - 1 voltages from -volts to volts, 0 among them; None is any.
    """

    volts: Positive
    slew_v_per_s: Positive
    rate_hz: Annotated[int, Field(ge=100, le=10_000_000)]
    bits: Annotated[int, Field(ge=2, le=32)] | None = None

    @property
    def volt_step(self) -> float:
        """From one voltage to the next; 0 where any can be made."""
        return 0.0 if self.bits is None else self.volts / (2 ** (self.bits - 1) - 1)


class Modulation(ProfilePart):
    """The beat of a carrier that is too fast to be felt: its envelope goes as ``(1 + depth cos(2 pi hz t))``."""

    hz: Annotated[float, Field(ge=10, le=1000)]
    depth: Annotated[float, Field(gt=0, le=1)] = 1.0


class Note(ProfilePart):
    """Where a value of the profile comes from."""

    assumed: bool
    why: Annotated[str, Field(min_length=1)]


class HigherMode(ProfilePart):
    """A higher bending mode: `omega` its frequency over f0, `delta` its damping, `gain` its share of the force."""

    omega: Positive
    delta: NotNegative
    gain: Finite


class Surroundings(ProfilePart):
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
