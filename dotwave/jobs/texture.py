"""The textures of a job file, and what all parts of a job file have in common."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar

from pydantic import BaseModel, ConfigDict, Field, GetJsonSchemaHandler, model_validator
from pydantic_core import CoreSchema

from encoders import GridShape, Region, TargetPattern, bars, levels, plane_wave, regions, unlocked, walking_bars

__all__ = ["NotNegative", "Part", "Positive", "Seconds", "TexturePart"]

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
Seconds = Annotated[float, Field(gt=0, le=3600)]
Level = Annotated[float, Field(gt=0, le=1)]
AtLeastOne = Annotated[int, Field(ge=1)]
Place = Annotated[int, Field(ge=0)]


class Part(BaseModel):
    """A section of a job file: unknown keys are refused, nothing changes after reading.

    Where `short` names a key, the section may be written as that key's text alone.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")
    short: ClassVar[str] = ""

    @model_validator(mode="before")
    @classmethod
    def _from_text(cls, value: Any) -> Any:
        return {cls.short: value} if cls.short and isinstance(value, str) else value

    @classmethod
    def __get_pydantic_json_schema__(cls, core: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        """The section's schema; text alone fits too where there is a short form."""
        schema = handler(core)
        return {"anyOf": [{"type": "string"}, schema]} if cls.short else schema


class WavePart(Part):
    """A sinusoidal wave (`encoders.plane_wave`)."""

    lag_deg: Finite
    row_lag_deg: Finite = 0.0
    level: Level = 1.0


class Bars(Part):
    """Still bars (`encoders.bars`)."""

    vertical: bool = True
    width: AtLeastOne
    gap: AtLeastOne
    first: int = 0
    level: Level = 1.0


class Walking(Part):
    """Bars that walk (`encoders.walking_bars`)."""

    width: Annotated[float, Field(ge=1.2, allow_inf_nan=False)] | None = None
    rate_hz: Positive | None = None
    level: Level = 1.0

    @model_validator(mode="after")
    def _one(self) -> Walking:
        if self.width is None and self.rate_hz is None:
            raise ValueError("give a width, a rate_hz or both")
        return self


class UnlockedPart(Part):
    """A motion that never settles (`encoders.unlocked`)."""

    depth: Annotated[float, Field(gt=0, le=1)]
    period_s: Positive


class RegionPart(Part):
    """A wave or bars on the rows `top` to `bottom` - 1 and the columns `left` to `right` - 1, counted from 0."""

    top: Place
    bottom: AtLeastOne
    left: Place
    right: AtLeastOne
    wave: WavePart | None = None
    bars: Bars | None = None

    @model_validator(mode="after")
    def _one(self) -> RegionPart:
        if (self.wave is None) == (self.bars is None):
            raise ValueError("give either wave or bars")
        return self


class TexturePart(Part):
    """A texture, exactly one of the kinds, and how long it is felt."""

    wave: WavePart | None = None
    bars: Bars | None = None
    walking_bars: Walking | None = None
    unlocked: UnlockedPart | None = None
    levels: tuple[tuple[Annotated[float, Field(ge=0, le=1)], ...], ...] | None = None
    regions: tuple[RegionPart, ...] | None = None
    dwell_s: Seconds = 2.0

    @model_validator(mode="after")
    def _one(self) -> TexturePart:
        if sum(value is not None for name, value in self if name != "dwell_s") != 1:
            raise ValueError("give exactly one of wave, bars, walking_bars, unlocked, levels, regions")
        return self

    @property
    def kind(self) -> str:
        """The key that is given."""
        return next(name for name, value in self if name != "dwell_s" and value is not None)

    def target(self, shape: GridShape) -> TargetPattern:
        """The texture on a grid.

        Raises
        ------
        encoders.TextureError
            When it does not fit the grid.
        """
        if self.walking_bars is not None:
            return walking_bars(shape, **self.walking_bars.model_dump())
        if self.unlocked is not None:
            return unlocked(shape, **self.unlocked.model_dump())
        if self.levels is not None:
            return levels(self.levels)
        if self.regions is not None:
            parts = [
                Region(one.top, one.bottom, one.left, one.right, _plain(one.wave, one.bars, shape))
                for one in self.regions
            ]
            return regions(shape, parts)
        return _plain(self.wave, self.bars, shape)


def _plain(wave: WavePart | None, still: Bars | None, shape: GridShape) -> TargetPattern:
    if wave is not None:
        return plane_wave(shape, **wave.model_dump())
    assert still is not None
    return bars(shape, **still.model_dump())
