"""The file of a plant: how a grid truly is and what happens to it, of which a host knows only what it measures."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, field_validator, model_validator

from chainsim import ActuatorSpread, CreepSection, Device, HysteresisSection, read_located

from ..errors import DriverError

__all__ = ["PlantError", "PlantFile", "read_plant"]

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Share = Annotated[float, Field(ge=0, le=1, allow_inf_nan=False)]
Factor = Annotated[float, Field(ge=0.1, le=10, allow_inf_nan=False)]
Seconds = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Place = Annotated[int, Field(ge=0, le=1023)]

MOST_FINGERTIPS = 1000


class PlantError(DriverError, ValueError):
    """A plant file does not fit the device it is given with.

    Examples: a fingertip on an actuator that the grid does not have; the same actuator given twice.
    """


class _Part(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class PlantSpread(ActuatorSpread):
    """How far the actuators of a plant lie from the profile: relative standard deviations, drawn with the seed.

    Attributes
    ----------
    frequency, damping, beta, lam : as in a device's spread.
    force : of what a volt does, as drive or bias.
    """

    force: Share = 0.0


class _Placed(_Part):
    row: Place
    col: Place


class TrueActuator(_Placed):
    """What one actuator truly is, each number over that of the profile; it replaces what is drawn."""

    frequency: Factor | None = None
    damping: Factor | None = None
    beta: Factor | None = None
    lam: Factor | None = None
    force: Factor | None = None


class WarmingSection(_Part):
    """Temperature: after t played seconds every stiffness is ``1 + stiffness (1 - exp(-t/time_s))`` times its own."""

    stiffness: Annotated[float, Field(ge=-0.9, le=10, allow_inf_nan=False)]
    time_s: Positive


class Fingertip(_Placed):
    """A finger on one actuator from played second `from_s` to `to_s` (none: for good).

    Attributes
    ----------
    stiffness, damping : what it adds to the actuator's, in units of the profile (1 and delta).
    """

    from_s: Seconds = 0.0
    to_s: Seconds | None = None
    stiffness: Annotated[float, Field(ge=0, le=10, allow_inf_nan=False)] = 0.0
    damping: Annotated[float, Field(ge=0, le=10, allow_inf_nan=False)] = 0.0

    @model_validator(mode="after")
    def _in_order(self) -> Fingertip:
        if self.to_s is not None and self.to_s < self.from_s:
            raise ValueError(f"to_s: expected at least from_s = {self.from_s:g}, got {self.to_s:g}")
        return self


class SensorsSection(_Part):
    """How well actuators sense themselves.

    Attributes
    ----------
    noise : standard deviation of each number that is measured (mean, real and imaginary part), over full scale.
    cross_talk : share of each neighbour's motion (above, below, left, right) in what an actuator senses.
    """

    noise: NotNegative = 0.0
    cross_talk: Share = 0.0


class PlantFile(_Part):
    """A plant file; what is not there is as the device's profile says.

    Attributes
    ----------
    seed : of all that is drawn.
    spread, actuators : how actuators differ from the profile.
    hysteresis, creep : of the electric force, as in chain files; of hysteresis only kind play.
    warming : a slow change with temperature.
    fingertips : what touches actuators, and when.
    sensors : how well they sense.
    """

    schema_: Literal["dotwave/plant/1"] = Field("dotwave/plant/1", alias="schema")
    seed: Annotated[int, Field(ge=0, le=2**32 - 1)] = 0
    spread: PlantSpread = PlantSpread()
    actuators: tuple[TrueActuator, ...] = ()
    hysteresis: HysteresisSection | None = None
    creep: CreepSection | None = None
    warming: WarmingSection | None = None
    fingertips: Annotated[tuple[Fingertip, ...], Field(max_length=MOST_FINGERTIPS)] = ()
    sensors: SensorsSection = SensorsSection()

    @field_validator("hysteresis")
    @classmethod
    def _of_plays(cls, value: HysteresisSection | None) -> HysteresisSection | None:
        if value is not None and value.kind != "play":
            raise ValueError(f"a plant has hysteresis of kind play, got {value.kind}")
        return value

    @field_validator("creep")
    @classmethod
    def _slow(cls, value: CreepSection | None) -> CreepSection | None:
        if value is not None and value.first < 1:
            raise ValueError(f"first: expected at least 1 (tau, a sixth of a period), got {value.first:g}")
        return value


def read_plant(path: Path, device: Device) -> PlantFile:
    """The plant in the file `path`, for `device`.

    Raises
    ------
    ProfileError
        When the file cannot be read, is not YAML, or does not fit the schema.
    PlantError
        When it does not fit the device; the message says where.
    """
    located = read_located(path, PlantFile)
    plant = located.model
    seen: set[tuple[int, int]] = set()
    placed: tuple[tuple[str, Sequence[_Placed]], ...] = (
        ("actuators", plant.actuators),
        ("fingertips", plant.fingertips),
    )
    for key, items in placed:
        for index, one in enumerate(items):
            place = f"{located.at(key, index)}: row {one.row}, col {one.col}"
            if one.row >= device.rows or one.col >= device.cols:
                raise PlantError(f"{place} is outside the grid of {device.rows} x {device.cols}")
            if key == "actuators" and (one.row, one.col) in seen:
                raise PlantError(f"{place} is given twice; keep one")
            seen.add((one.row, one.col))
    return plant
