"""What should be felt: targets, frames and scenes, in plain numbers and free of any hardware."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "SMOOTHNESS",
    "STANDS_FROM",
    "Frame",
    "GoesOn",
    "GridShape",
    "Heading",
    "PageNumber",
    "PatternKind",
    "Scene",
    "TargetPattern",
    "WalkingBars",
]


SMOOTHNESS = 9
"""Derivatives of a level that vanish where what travels passes a place: as many as links need that change with it."""
STANDS_FROM = 0.8
"""From this share of its way on a pattern is within 0.2 % of where it goes; as long it is so after it."""


@dataclass(frozen=True)
class GridShape:
    """Rows and columns of actuators that a scene is laid out for."""

    rows: int
    cols: int


class PatternKind(StrEnum):
    """What sort of pattern a target is."""

    ON_OFF = "on_off"
    SINE = "sine"
    BARS = "bars"


@dataclass(frozen=True)
class WalkingBars:
    """Bars that walk along the rows: two tones that beat.

    Attributes
    ----------
    width : of a bar in actuators, NaN where it may follow from the rate.
    rate_hz : bars that pass an actuator in a second, NaN where the rate may follow from the width.
    """

    width: float
    rate_hz: float = math.nan


@dataclass(frozen=True)
class UnlockedBeats:
    """A motion that never settles, felt as beats.

    Attributes
    ----------
    depth : (loud - soft) / (loud + soft) of the amplitude, 0 to 1.
    period_s : of the beats, seconds.
    """

    depth: float
    period_s: float


@dataclass(frozen=True)
class TargetPattern:
    """A wish for one moment.

    Attributes
    ----------
    amplitude : complex128, shape (rows, cols), read-only, modulus 0..1 (1 = the device's full scale).
    kind : on/off, sine or bars.
    weight : float64, shape (rows, cols), 0 = don't care; None means 1 everywhere.
    phase_matters : whether the arguments of `amplitude` are part of the wish.
    any_phase : bool, shape (rows, cols), where they are not although `phase_matters`; None means nowhere.
    walking : the amplitude is the largest that passes by, in bars that walk; None for what stands.
    unlocked : it never settles, and beats like this, as loud as it comes; None for what settles.
    """

    amplitude: NDArray[np.complex128]
    kind: PatternKind = PatternKind.ON_OFF
    weight: NDArray[np.float64] | None = None
    phase_matters: bool = False
    walking: WalkingBars | None = None
    any_phase: NDArray[np.bool_] | None = None
    unlocked: UnlockedBeats | None = None

    @property
    def plain(self) -> bool:
        """Whether its amplitudes say all of it."""
        moves = self.walking is not None or self.unlocked is not None
        return not (self.phase_matters or moves) and self.weight is None


@dataclass(frozen=True, slots=True)
class GoesOn:
    """A word that goes on after a run (see `encoders.braille.layout`), and what is not of the word there.

    Attributes
    ----------
    run : number of the run on the page, from 0.
    mark : cells that end the run and say that the word goes on, such as a hyphen.
    restated : cells at the start of the next run that the word has not there: its indicators once more.
    ending : cells before the mark that the word has not there, as it is written at the end of a word.
    left_out : cells of the word that stand in neither run, such as a contraction over the place.
    """

    run: int
    mark: str = ""
    restated: str = ""
    ending: str = ""
    left_out: str = ""


@dataclass(frozen=True, slots=True)
class PageNumber:
    """The number of a page where it is shown among its cells: these are not of the text.

    Attributes
    ----------
    at : place of the first of its cells on the page, lines run together, from 0.
    cells : as they stand there.
    """

    at: int
    cells: str


@dataclass(frozen=True, slots=True)
class Heading:
    """A heading of what is shown, to jump to.

    Attributes
    ----------
    level : 1 for the title of a book or a part, 2 below that, and so on to 6.
    text : its words, at most 200 characters.
    """

    level: int
    text: str


@dataclass(frozen=True, slots=True)
class Frame:
    """A pattern and how long it is shown.

    Attributes
    ----------
    pattern : the wish.
    dwell_s : seconds the frame lasts, from the start of its ramp to its end.
    page : which page it belongs to; the parts of one page (`by-row`, `by-dot`) are superposed by a reader.
    text : the span of source text it shows; `span` is its (start, end) in characters.
    cells : the page's cells as Unicode Braille, lines separated by a newline; empty when blank.
    goes_on : where words go on after a run of the page.
    headings : of the source, that begin on the page; of its parts the first has them.
    number : which of the cells show the page's number; None where none do.
    travels : its levels come from those of the frame before on a smooth way that takes the whole frame
        (`encoders.levels_at`), and the pattern is not held; else they are to stand as soon as can be.
    leads : it stands, and what travels follows it.
    """

    pattern: TargetPattern
    dwell_s: float
    page: int = 0
    text: str = ""
    span: tuple[int, int] = (0, 0)
    cells: str = ""
    goes_on: tuple[GoesOn, ...] = ()
    headings: tuple[Heading, ...] = ()
    number: PageNumber | None = None
    travels: bool = False
    leads: bool = False


@dataclass(frozen=True, repr=False)
class Scene:
    """A sequence of frames, made lazily: iterating `frames` again encodes again what is long.

    Attributes
    ----------
    shape : the grid it is laid out for.
    frames : iterable of `Frame`.
    encoding : plain JSON values that let a reader decode the frames (tables, layout, presentation).
    parts : a line on each thing that is shown, for a person.

    Examples
    --------
    >>> from encoders import GridShape, TextOptions, encode_text
    >>> scene = encode_text("Hello", GridShape(6, 6), TextOptions())
    >>> [(frame.text, frame.dwell_s) for frame in scene.frames]
    [('Hello', 1.0)]
    """

    shape: GridShape
    frames: Iterable[Frame]
    encoding: Mapping[str, Any] = field(default_factory=dict)
    parts: tuple[str, ...] = ()

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.shape.rows} x {self.shape.cols}, {', '.join(self.parts)})"
