"""What is wanted of a picture: options, and their defaults for icons and for photographs."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace
from enum import StrEnum
from functools import cache
from typing import Annotated, Any, get_args, get_type_hints

from .errors import PictureError

__all__ = [
    "Fit", "Invert", "Output", "PictureOptions", "PictureRule", "RegionsBy", "Style", "Threshold", "picture_rules",
]  # fmt: skip


# Lines that are closer may be felt as one.
PHOTO_GAP_M = 6.4e-3


class Style(StrEnum):
    """Which set of defaults is used; `auto` decides by the tones of the picture."""

    AUTO = "auto"
    ICON = "icon"
    PHOTO = "photo"


class Fit(StrEnum):
    """How the picture meets the grid: all of it, all of the grid, or both by distortion."""

    CONTAIN = "contain"
    COVER = "cover"
    STRETCH = "stretch"


class Threshold(StrEnum):
    """How figure and ground are parted: one threshold from the histogram, one for each place, or a given one."""

    OTSU = "otsu"
    ADAPTIVE = "adaptive"
    FIXED = "fixed"


class Invert(StrEnum):
    """Whether bright parts are raised (`no`), dark ones (`yes`), or what is not the ground (`auto`)."""

    AUTO = "auto"
    YES = "yes"
    NO = "no"


class Output(StrEnum):
    """What a dot can be: on or off, one of some levels, or part of a textured region."""

    ON_OFF = "on_off"
    LEVELS = "levels"
    TEXTURE = "texture"


class RegionsBy(StrEnum):
    """What parts of a picture are told apart by."""

    COLOUR = "colour"
    LUMINANCE = "luminance"


@dataclass(frozen=True)
class Between:
    """A number from `low` to `high`, both of them included."""

    low: float
    high: float


@dataclass(frozen=True)
class PictureRule:
    """What an option may be, for whoever reads one from a person: a command line, a job file.

    Attributes
    ----------
    type : of the value, None included where it stands for the default of the style.
    default : where nothing is said.
    span : the numbers it may be, None where it is none.
    kind : the words it may be, None where it is none.
    """

    type: Any
    default: Any
    span: Between | None
    kind: type[StrEnum] | None

    @property
    def choices(self) -> tuple[str, ...]:
        """The words it may be, in order; empty where it is none."""
        return () if self.kind is None else tuple(self.kind)


@dataclass(frozen=True)
class PictureOptions:
    """Options of `encode_picture`; None stands for the default of the style.

    Attributes
    ----------
    style : which defaults.
    background : ``auto`` (white or black, whichever shows more) or ``#rrggbb``.
    crop : cut to what differs from the ground.
    fit : how the picture meets the grid.
    contrast : even out the local brightness.
    edges : take outlines in place of areas.
    threshold : how figure and ground are parted; `threshold_value` is the linear luminance for ``fixed``.
    invert : which side is raised.
    thicken : actuators by which strokes are widened on each side.
    gap_m, stroke_m : smallest empty space between parts, and smallest stroke, in metres; narrower ones are widened.
    pitch_m : distance of neighbouring rows and of neighbouring columns, in metres.
    output : what a dot can be.
    levels : number of levels besides off, `level_step_db` (>= 3) apart.
    regions : number of textured regions, told apart by `regions_by`.
    zoom : 1, or n for an overview and then windows of 1/n of the picture, which overlap by `overlap` (0..0.9).
    dwell_s : seconds a frame is shown when the file does not say.
    candidates : how many good patterns of each frame the report lists (on/off only).

    A choice may be given as its word.

    Raises
    ------
    PictureError
        With the field and its value when one is out of range.
    """

    style: Style = Style.AUTO
    background: str = "auto"
    crop: bool | None = None
    fit: Fit | None = None
    contrast: bool | None = None
    edges: bool = False
    threshold: Threshold | None = None
    threshold_value: Annotated[float, Between(0.0, 1.0)] = 0.2
    invert: Invert = Invert.AUTO
    thicken: Annotated[float, Between(0.0, 4.0)] = 0.0
    gap_m: Annotated[float | None, Between(0.0, 1.0)] = None
    stroke_m: Annotated[float, Between(0.0, 1.0)] = 0.0
    pitch_m: Annotated[tuple[float, float], Between(1e-5, 1.0)] = (8.3e-3, 8.3e-3)
    output: Output = Output.ON_OFF
    levels: Annotated[int, Between(1, 8)] = 3
    level_step_db: Annotated[float, Between(3.0, 40.0)] = 6.0
    regions: Annotated[int, Between(1, 5)] = 3
    regions_by: RegionsBy = RegionsBy.COLOUR
    zoom: Annotated[int, Between(1, 16)] = 1
    overlap: Annotated[float, Between(0.0, 0.9)] = 0.25
    dwell_s: Annotated[float, Between(1e-3, 3600.0)] = 1.0
    candidates: Annotated[int, Between(1, 256)] = 1

    def __post_init__(self) -> None:
        for name, rule in picture_rules().items():
            given, span = getattr(self, name), rule.span
            if given is None:
                continue
            least = min(given) if isinstance(given, tuple) else given
            if span is not None and not (math.isfinite(least) and span.low <= least <= span.high):
                raise PictureError(f"picture.{name}: expected a number from {span.low:g} to {span.high:g}, got {least}")
            if rule.kind is not None and given not in rule.choices:
                raise PictureError(f"picture.{name}: expected one of {', '.join(rule.choices)}, got {given!r}")
            if rule.kind is not None:
                object.__setattr__(self, name, rule.kind(given))

    def resolved(self, style: Style) -> PictureOptions:
        """The same options with the defaults of `style` (icon or photo) in place of None."""
        icon = style is not Style.PHOTO
        return replace(
            self,
            style=style,
            crop=icon if self.crop is None else self.crop,
            fit=self.fit or Fit.CONTAIN,
            contrast=not icon if self.contrast is None else self.contrast,
            threshold=self.threshold or Threshold.OTSU,
            gap_m=(0.0 if icon else PHOTO_GAP_M) if self.gap_m is None else self.gap_m,
        )


@cache
def picture_rules() -> dict[str, PictureRule]:
    """What each option of `PictureOptions` may be, by its name."""
    hints = get_type_hints(PictureOptions, include_extras=True)
    return {field.name: _rule(hints[field.name], field.default) for field in fields(PictureOptions)}


def _rule(hint: Any, default: Any) -> PictureRule:
    span = next((one for one in getattr(hint, "__metadata__", ()) if isinstance(one, Between)), None)
    kind = get_args(hint)[0] if span is not None else hint
    enums = [one for one in (kind, *get_args(kind)) if isinstance(one, type) and issubclass(one, StrEnum)]
    return PictureRule(kind, default, span, enums[0] if enums else None)
