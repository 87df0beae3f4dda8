"""What is wanted of a picture: options, and their defaults for icons and for photographs."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import StrEnum

from .errors import PictureError

__all__ = ["Fit", "Invert", "Output", "PictureOptions", "RegionsBy", "Style", "Threshold"]


# Thinner lines beside solid parts would be lost between the dots of an 8 mm grid.
ICON_STROKE_M = 5e-3


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
class PictureOptions:
    """Options of `encode_picture`; None stands for the default of the style.

    Attributes
    ----------
    style : which defaults. background : ``auto`` (white or black, whichever shows more) or ``#rrggbb``.
    crop : cut to what differs from the ground. fit : how the picture meets the grid.
    contrast : even out the local brightness. edges : take outlines in place of areas.
    threshold : how figure and ground are parted; `threshold_value` is the linear luminance for ``fixed``.
    invert : which side is raised. thicken : actuators by which strokes are widened on each side.
    gap_m, stroke_m : smallest empty space between parts, and smallest stroke, in metres; narrower ones are widened.
    pitch_m : distance of neighbouring rows and of neighbouring columns, in metres.
    output : what a dot can be. levels : number of levels besides off, `level_step_db` (>= 3) apart.
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
    threshold_value: float = 0.2
    invert: Invert = Invert.AUTO
    thicken: float = 0.0
    gap_m: float = 6.4e-3
    stroke_m: float | None = None
    pitch_m: tuple[float, float] = (8.3e-3, 8.3e-3)
    output: Output = Output.ON_OFF
    levels: int = 3
    level_step_db: float = 6.0
    regions: int = 3
    regions_by: RegionsBy = RegionsBy.COLOUR
    zoom: int = 1
    overlap: float = 0.25
    dwell_s: float = 1.0
    candidates: int = 1

    def __post_init__(self) -> None:
        ranges: dict[str, tuple[float, float, float]] = {
            "threshold_value": (self.threshold_value, 0.0, 1.0),
            "thicken": (self.thicken, 0.0, 4.0),
            "gap_m": (self.gap_m, 0.0, 1.0),
            "stroke_m": (self.stroke_m or 0.0, 0.0, 1.0),
            "pitch_m": (min(self.pitch_m), 1e-5, 1.0),
            "levels": (self.levels, 1, 8),
            "level_step_db": (self.level_step_db, 3.0, 40.0),
            "regions": (self.regions, 1, 5),
            "zoom": (self.zoom, 1, 16),
            "overlap": (self.overlap, 0.0, 0.9),
            "dwell_s": (self.dwell_s, 1e-3, 3600.0),
            "candidates": (self.candidates, 1, 256),
        }
        for name, (value, low, high) in ranges.items():
            if not (math.isfinite(value) and low <= value <= high):
                raise PictureError(f"picture.{name}: expected a number from {low:g} to {high:g}, got {value}")
        for name, kind in _CHOICES.items():
            given = getattr(self, name)
            if given is not None and given not in list(kind):
                raise PictureError(f"picture.{name}: expected one of {', '.join(kind)}, got {given!r}")
            object.__setattr__(self, name, None if given is None else kind(given))

    def resolved(self, style: Style) -> PictureOptions:
        """The same options with the defaults of `style` (icon or photo) in place of None."""
        icon = style is not Style.PHOTO
        return replace(
            self,
            style=style,
            crop=icon if self.crop is None else self.crop,
            fit=self.fit or (Fit.CONTAIN if icon else Fit.COVER),
            contrast=not icon if self.contrast is None else self.contrast,
            threshold=self.threshold or Threshold.OTSU,
            stroke_m=(ICON_STROKE_M if icon else 0.0) if self.stroke_m is None else self.stroke_m,
        )


_CHOICES: dict[str, type[StrEnum]] = {
    "style": Style,
    "fit": Fit,
    "threshold": Threshold,
    "invert": Invert,
    "output": Output,
    "regions_by": RegionsBy,
}
