"""The section `terms:` of a chain file, read into `Terms`; a plant file has two of its parts."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

from ..effects.effects import AmplifierDynamics, BoucWen, Creep, Mode, Play, Terms, Tone
from ..equations.chain import Setting

__all__ = ["CreepSection", "HysteresisSection", "TermsSection"]

Finite = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]

MOST_PLAYS = 64
MOST_MODES = 16
MOST_TONES = 3
MOST_DECADES = 12
FIELDS = {"bouc_wen": ("gain", "loading", "unloading"), "play": ("radius", "weight", "base")}


class _Part(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class HysteresisSection(_Part):
    """Hysteresis as a file has it.

    Attributes
    ----------
    kind : bouc_wen (gain, loading, unloading) or play (radius, weight, base).
    """

    kind: Literal["bouc_wen", "play"]
    gain: Finite | None = None
    loading: Finite | None = None
    unloading: Finite | None = None
    radius: Annotated[list[NotNegative], Field(min_length=1, max_length=MOST_PLAYS)] | None = None
    weight: Annotated[list[Finite], Field(max_length=MOST_PLAYS)] | None = None
    base: Finite | None = None

    @model_validator(mode="after")
    def _fits_its_kind(self) -> HysteresisSection:
        wanted, given = set(FIELDS[self.kind]), self.model_fields_set - {"kind"}
        if given != wanted:
            raise ValueError(f"kind {self.kind} takes {', '.join(FIELDS[self.kind])}, got {', '.join(sorted(given))}")
        self.built()
        return self

    def built(self) -> BoucWen | Play:
        """The term."""
        if self.gain is not None and self.loading is not None and self.unloading is not None:
            return BoucWen(self.gain, self.loading, self.unloading)
        return Play(tuple(self.radius or ()), tuple(self.weight or ()), self.base or 0.0)


class CreepSection(_Part):
    """Creep as a file has it: per_decade, first, last (tau), each."""

    per_decade: Finite
    first: Positive
    last: Positive
    each: Annotated[int, Field(ge=1, le=8)] = 2

    @model_validator(mode="after")
    def _in_order(self) -> CreepSection:
        if self.last > self.first * 10.0**MOST_DECADES:
            raise ValueError(f"creep.last: expected at most {MOST_DECADES} decades after first, got {self.last}")
        self.built()
        return self

    def built(self) -> Creep:
        """The term."""
        return Creep(self.per_decade, self.first, self.last, self.each)


class _Mode(_Part):
    omega: Positive
    delta: NotNegative
    gain: Finite


class _Amplifier(_Part):
    bandwidth: Positive
    slew: Positive | None = None
    limit: Positive | None = None

    def built(self) -> AmplifierDynamics:
        ends = {name: value for name in ("slew", "limit") if (value := getattr(self, name)) is not None}
        return AmplifierDynamics(self.bandwidth, **ends)


class _Tone(_Part):
    epsilon: Finite
    omega: Positive
    phase: Finite = 0.0


class TermsSection(_Part):
    """Which terms a chain file turns on; what is not there is off.

    Attributes
    ----------
    hysteresis : kind bouc_wen (gain, loading, unloading) or play (radius, weight, base).
    creep : per_decade, first, last, each.
    modes : omega, delta, gain of each.
    amplifier : bandwidth, and optionally slew and limit.
    tones : epsilon, omega, phase of each tone beside the setting's own.
    """

    hysteresis: HysteresisSection | None = None
    creep: CreepSection | None = None
    modes: Annotated[list[_Mode], Field(min_length=1, max_length=MOST_MODES)] | None = None
    amplifier: _Amplifier | None = None
    tones: Annotated[list[_Tone], Field(min_length=1, max_length=MOST_TONES)] | None = None

    def built(self, setting: Setting) -> Terms:
        """The terms; the tone of the one `setting` stands first among several."""
        own = Tone(float(setting.epsilon[0]), float(setting.omega[0]), float(setting.phase[0]))
        return Terms(
            hysteresis=None if self.hysteresis is None else self.hysteresis.built(),
            creep=None if self.creep is None else self.creep.built(),
            modes=None if self.modes is None else tuple(Mode(m.omega, m.delta, m.gain) for m in self.modes),
            amplifier=None if self.amplifier is None else self.amplifier.built(),
            tones=None if self.tones is None else (own, *(Tone(t.epsilon, t.omega, t.phase) for t in self.tones)),
        )
