"""The textures of a job file."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, model_validator

from encoders import (
    GridShape,
    Region,
    Scene,
    TargetPattern,
    bars,
    levels,
    plane_wave,
    regions,
    rings,
    slanted_bars,
    unlocked,
    walking_bars,
)

from ..scenes import still_scene
from .part import AtLeastOne, Finite, Level, Part, Place, Positive, Seconds
from .travel import DotPart, ScrollPart

__all__ = ["TexturePart"]


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


class SlantedBars(Part):
    """Still bars at an angle (`encoders.slanted_bars`)."""

    angle_deg: Finite
    width: Annotated[float, Field(ge=1, allow_inf_nan=False)]
    gap: Annotated[float, Field(ge=1, allow_inf_nan=False)]
    first: Finite = 0.0
    level: Level = 1.0


class Rings(Part):
    """Still rings around a point (`encoders.rings`)."""

    row: Finite
    col: Finite
    width: Annotated[float, Field(ge=1, allow_inf_nan=False)]
    gap: Annotated[float, Field(ge=1, allow_inf_nan=False)]
    first: Finite = 0.0
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
    slanted_bars: SlantedBars | None = None
    rings: Rings | None = None
    walking_bars: Walking | None = None
    unlocked: UnlockedPart | None = None
    levels: tuple[tuple[Annotated[float, Field(ge=0, le=1)], ...], ...] | None = None
    regions: tuple[RegionPart, ...] | None = None
    scroll: ScrollPart | None = None
    dot: DotPart | None = None
    dwell_s: Seconds = 2.0

    @model_validator(mode="after")
    def _one(self) -> TexturePart:
        if sum(value is not None for name, value in self if name != "dwell_s") != 1:
            kinds = ", ".join(name for name in type(self).model_fields if name != "dwell_s")
            raise ValueError(f"give exactly one of {kinds}")
        return self

    @property
    def kind(self) -> str:
        """The key that is given."""
        return next(name for name, value in self if name != "dwell_s" and value is not None)

    def scene(self, shape: GridShape) -> Scene:
        """The texture on a grid.

        Raises
        ------
        encoders.EncodeError
            When it does not fit the grid, or a text has nothing to show.
        """
        moving = self.scroll or self.dot
        if moving is not None:
            return moving.scene(shape, self.dwell_s)
        return still_scene(self._target(shape), self.dwell_s, f"texture: {self.kind}")

    def _target(self, shape: GridShape) -> TargetPattern:
        if self.slanted_bars is not None:
            return slanted_bars(shape, **self.slanted_bars.model_dump())
        if self.rings is not None:
            return rings(shape, **self.rings.model_dump())
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
