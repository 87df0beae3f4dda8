"""The textures of a job file that travel: text and bars that scroll, a dot on its way."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, model_validator

from encoders import (
    ArrowDirection,
    GridShape,
    Presentation,
    Scene,
    TextOptions,
    TextSource,
    TravelFrames,
    arrow,
    circle,
    moving_dot,
    path,
    scrolled_bars,
)

from ..scenes import text_scene
from .part import AtLeastOne, Level, Part, Place

__all__ = ["DotPart", "ScrollPart"]

Speed = Annotated[float, Field(ge=0.1, le=100)]


class _ScrolledBars(Part):
    """Vertical bars that scroll (`encoders.scrolled_bars`)."""

    width: AtLeastOne
    gap: AtLeastOne
    level: Level = 1.0


class ScrollPart(Part):
    """A text, or bars, that move to the left under a finger that is still.

    A text takes as long as it is; bars move for the texture's `dwell_s`.
    """

    text: str | None = None
    bars: _ScrolledBars | None = None
    columns_per_s: Speed
    table: str = "en-ueb-g2.ctb"
    cell_gap: AtLeastOne = 1

    @model_validator(mode="after")
    def _one(self) -> ScrollPart:
        if (self.text is None) == (self.bars is None):
            raise ValueError("give either text or bars")
        return self

    def scene(self, shape: GridShape, lasting_s: float) -> Scene:
        """The scene on a grid; raises encoders.EncodeError where it does not fit."""
        if self.text is None:
            assert self.bars is not None
            given = self.bars.model_dump()
            frames = scrolled_bars(shape, columns_per_s=self.columns_per_s, lasting_s=lasting_s, **given)
            return _moving(shape, frames, "scroll")
        rate = self.columns_per_s / (2 + self.cell_gap)
        options = TextOptions(
            table=self.table, cell_gap=self.cell_gap, rate=rate, presentation=Presentation.SCROLL
        )  # fmt: skip
        return text_scene(TextSource.of_text(self.text), shape, options)


class CirclePart(Part):
    """A circle around the middle of the grid, in actuators."""

    radius: Annotated[float, Field(ge=0.5, allow_inf_nan=False)]


class DotPart(Part):
    """A dot that goes around a circle, along a path of corners (row, column; `closed`: and back) or as an arrow."""

    circle: CirclePart | None = None
    path: Annotated[tuple[tuple[Place, Place], ...], Field(min_length=2)] | None = None
    arrow: ArrowDirection | None = None
    closed: bool = False
    actuators_per_s: Speed

    @model_validator(mode="after")
    def _one(self) -> DotPart:
        if sum(one is not None for one in (self.circle, self.path, self.arrow)) != 1:
            raise ValueError("give exactly one of circle, path, arrow")
        if self.closed and self.path is None:
            raise ValueError("closed is for a path")
        return self

    def scene(self, shape: GridShape, lasting_s: float) -> Scene:
        """The scene on a grid; raises encoders.EncodeError where it does not fit."""
        closed = self.circle is not None
        if self.circle is not None:
            places = circle(shape, self.circle.radius)
        elif self.path is not None:
            closed = self.closed
            places = path(shape, [*self.path, self.path[0]])[:-1] if closed else path(shape, self.path)
        else:
            assert self.arrow is not None
            places = arrow(shape, self.arrow)
        frames = moving_dot(shape, places, per_s=self.actuators_per_s, lasting_s=lasting_s, closed=closed)
        return _moving(shape, frames, "dot")


def _moving(shape: GridShape, frames: TravelFrames, kind: str) -> Scene:
    return Scene(shape, frames, {"kind": "texture"}, (f"texture: {kind}",))
