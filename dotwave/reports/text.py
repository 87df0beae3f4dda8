"""What `dotwave text` and `dotwave verify` found, as values, as JSON and as text for any reader.

The plain text is made to be listened to: one fact a line, the sentence before the numbers, nothing
drawn with boxes and nothing said by colour.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planner import AMPLITUDE_ERROR_LIMIT, CONTRAST_LIMIT_DB, FrameWish

from ..plain import one_line
from .report import Report, margin_lines, outcome_lines, plain

__all__ = [
    "FrameCheck",
    "TextReport",
    "VerifyReport",
    "decibels",
]

Floats = NDArray[np.float64]

LISTED = 20


@dataclass(frozen=True, kw_only=True, repr=False)
class TextReport(Report):
    """What was rendered of a text.

    Attributes
    ----------
    tables : liblouis tables.
    text : the first characters of the source.
    pages : how many.
    undefined : characters the table cannot write and what was shown instead.
    split : words cut at a page's end.
    differences : what back-translation does not give again.
    """

    KEYS = (
        "device", "tables", "text", "frames", "pages", "duration_s", "files", "peak_volts", "limit_volts", "ramp_s",
        "error", "outcomes", "undefined", "split", "differences", "notes", "seconds", "well", "noise_gain", "slew",
        "multiplier", "spread",
    )  # fmt: skip

    tables: tuple[str, ...]
    text: str
    pages: int
    undefined: tuple[str, ...] = ()
    split: tuple[str, ...] = ()
    differences: tuple[str, ...] = ()

    def _lines(self) -> Iterator[str]:
        yield f"Rendered {_count(self.frames, 'frame')} on {_count(self.pages, 'page')} for {self.device}."
        yield f"Duration: {self.duration_s:.2f} s."
        yield f"Tables: {', '.join(self.tables)}."
        yield f"Peak: {self.peak_volts:.1f} V of {self.limit_volts:g} V."
        yield f"Deflection: at most {100 * self.well:.0f} % of the softening well's limit."
        if self.noise_gain > 1:
            yield f"Disturbances of the drive: magnified up to {self.noise_gain:.1g} times more than the drive."
        yield from margin_lines(self)
        yield f"Longest ramp: {self.ramp_s:.3f} s."
        yield f"Predicted error of the settled patterns: {100 * self.error:.2f} % of full scale."
        yield from outcome_lines(self)
        if self.spread is not None:
            yield from self.spread.lines()
        yield from _section("Characters the table cannot write", self.undefined)
        yield from _section("Words split over a page's end", self.split)
        yield from _section("Differences after back-translation", self.differences)
        yield from self.notes
        for name in self.files:
            yield f"Written: {name}"
        yield f"Time taken: {self.seconds:.2f} s."


@dataclass(frozen=True, repr=False)
class FrameCheck:
    """What one frame of a written waveform does to the skin, from `settled_s` to `end_s`.

    Attributes
    ----------
    page : page of the frame.
    outcome : what the planner said of it.
    target, felt : float64, shape (rows, cols), what is aimed at and what is felt, in units of full scale.
    wish : what the scene asked for, by which dots and contrast are judged.
    wrong_dots : actuators felt on the wrong side of the threshold.
    contrast_db : weakest wanted dot over the strongest unwanted one; None when the frame lacks either, or has levels.
    amplitude_error : worst deviation from `target`, in units of full scale; of the complex amplitude where phases
        are wanted, and of the worst tone where there are several.
    wanted_cells, felt_cells : Unicode Braille, lines separated by a newline.
    text : the source's span.
    way_error : of what travels the worst deviation from the smooth way of its levels, else None; part of
        `amplitude_error`.
    """

    page: int
    start_s: float
    settled_s: float
    end_s: float
    outcome: str
    target: Floats
    wish: FrameWish
    felt: Floats
    wrong_dots: int
    contrast_db: float | None
    amplitude_error: float
    wanted_cells: str = ""
    felt_cells: str = ""
    text: str = ""
    way_error: float | None = None

    def __repr__(self) -> str:
        error = f"error {100 * self.amplitude_error:.2f} %"
        return f"FrameCheck(from {self.start_s:.2f} s, {_count(self.wrong_dots, 'wrong dot')}, {error})"

    @property
    def amplitude(self) -> Floats:
        """What is felt, in units of full scale; float64, shape (rows, cols)."""
        return self.felt

    @property
    def ramp_s(self) -> float:
        """Length of the way into the frame, seconds."""
        return self.settled_s - self.start_s

    @property
    def wanted_dots(self) -> NDArray[np.bool_]:
        """Which actuators should be felt as raised; bool, shape (rows, cols)."""
        return self.wish.raised

    @property
    def felt_dots(self) -> NDArray[np.bool_]:
        """Which actuators are felt as raised; bool, shape (rows, cols)."""
        return self.felt >= self.wish.threshold

    @property
    def ok(self) -> bool:
        """Right dots, as clear as asked, the amplitudes that are aimed at, and planned as asked."""
        exact = self.amplitude_error <= AMPLITUDE_ERROR_LIMIT
        return self.outcome == "ok" and self.wrong_dots == 0 and self.clear and exact

    @property
    def clear(self) -> bool:
        """Dots stand out as far as the wish needs."""
        return bool(self.wish.clear(self.contrast_db))

    @property
    def aside(self) -> float:
        """How far the plan aims beside the wish where something is to be felt, in units of full scale."""
        wished = self.wish.level > 0
        return float(np.max(np.abs(self.target - self.wish.level)[wished], initial=0.0))

    def as_dict(self) -> dict[str, Any]:
        """The check in plain JSON types."""
        return {name: plain(value) for name, value in vars(self).items()} | {
            "wish": plain(self.wish.level), "least_contrast_db": self.wish.least_db, "ok": self.ok,
        }  # fmt: skip


@dataclass(frozen=True)
class VerifyReport:
    """What is felt when a written waveform is played, by integrating the full equations under its samples.

    Attributes
    ----------
    path : the samples file.
    device : name of the profile in the manifest.
    frames : one `FrameCheck` each, in order.
    samples : how many were integrated.
    source_text, felt_text : what was rendered, and what the felt cells say when translated back.
    text_equal : whether they are the same, case and white space apart; None when it is not text.
    cells_equal : whether the felt cells are those the table writes for the source; decides where a table
        cannot be translated back. None when it is not text.
    differences : where they differ.
    notes : sentences a person should read.
    seconds : time taken.
    """

    path: str
    device: str
    frames: tuple[FrameCheck, ...]
    samples: int
    rate_hz: int
    source_text: str = ""
    felt_text: str = ""
    text_equal: bool | None = None
    cells_equal: bool | None = None
    differences: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    seconds: float = field(default=0.0)

    @property
    def wrong_dots(self) -> int:
        """Wrong dots of all frames together."""
        return sum(frame.wrong_dots for frame in self.frames)

    @property
    def contrast_db(self) -> float | None:
        """The weakest contrast of any frame."""
        return min((f.contrast_db for f in self.frames if f.contrast_db is not None), default=None)

    @property
    def amplitude_error(self) -> float:
        """The worst amplitude error of any frame, in units of full scale (NaN stays NaN)."""
        return float(np.max([frame.amplitude_error for frame in self.frames], initial=0.0))

    @property
    def ramp_s(self) -> float:
        """The longest way into a frame, seconds."""
        return max((frame.ramp_s for frame in self.frames), default=0.0)

    @property
    def ok(self) -> bool:
        """Every frame is right and the text, if any, comes back or is written in the right cells."""
        readable = self.text_equal is None or self.text_equal or bool(self.cells_equal)
        return all(frame.ok for frame in self.frames) and readable

    def as_dict(self) -> dict[str, Any]:
        """The report in plain JSON types, totals first; a number that is not finite becomes null."""
        totals = {name: plain(getattr(self, name)) for name in _TOTALS}
        return totals | {name: plain(value) for name, value in vars(self).items()}

    def as_text(self) -> str:
        """The report as lines of plain text: the verdict, the totals, then only the frames that failed."""
        return "\n".join(map(one_line, self._lines()))

    def _lines(self) -> Iterator[str]:
        verdict = "Verified" if self.ok else "Verification failed"
        yield f"{verdict}: {self.path} on {self.device}, {_count(len(self.frames), 'frame')}."
        yield f"Wrong dots: {self.wrong_dots}."
        yield f"Lowest contrast: {decibels(self.contrast_db)} ({self._contrast_wanted()})."
        worst = f"{100 * self.amplitude_error:.2f} % of full scale"
        yield f"Worst amplitude error: {worst} (at most {100 * AMPLITUDE_ERROR_LIMIT:g} % wanted)."
        ways = [frame.way_error for frame in self.frames if frame.way_error is not None]
        if ways:
            yield f"Travelling patterns are at most {100 * max(ways):.2f} % of full scale beside their way."
        aside = max((frame.aside for frame in self.frames), default=0.0)
        if aside > AMPLITUDE_ERROR_LIMIT:
            yield f"What is to be felt is aimed at up to {100 * aside:.0f} % of full scale beside the wish."
        yield f"Longest ramp: {self.ramp_s:.3f} s."
        if self.text_equal is not None:
            yield f"Text felt: {' '.join(self.felt_text.split())}"
            yield f"Same as the source: {'yes' if self.text_equal else 'no'}."
        yield from _section("Differences", self.differences)
        failed = [self._failure(number) for number, frame in enumerate(self.frames, 1) if not frame.ok]
        yield from _section("Frames that failed", tuple(failed))
        yield from self.notes
        yield f"Integrated {self.samples} samples at {self.rate_hz} Hz in {self.seconds:.2f} s."

    def _contrast_wanted(self) -> str:
        needed = [frame.wish.least_db for frame in self.frames if frame.wish.least_db is not None]
        if not needed and self.contrast_db is not None:
            return "no more is wished for"
        return f"at least {max(needed, default=CONTRAST_LIMIT_DB):g} dB wanted"

    def _failure(self, number: int) -> str:
        frame = self.frames[number - 1]
        error = f"amplitude error {100 * frame.amplitude_error:.2f} %"
        dots = f"{_count(frame.wrong_dots, 'wrong dot')}, contrast {decibels(frame.contrast_db)}, {error}"
        return f"frame {number} at {frame.start_s:.2f} s, outcome {frame.outcome}: {dots}"


_TOTALS = ("ok", "wrong_dots", "contrast_db", "amplitude_error", "ramp_s")


def decibels(value: float | None) -> str:
    """A level for a person; None is a comparison that does not exist; past 100 dB the number means nothing."""
    if value is None:
        return "not defined"
    return "over 100 dB" if value > 100 else f"{value:.1f} dB"


def _count(number: int, name: str) -> str:
    return f"{number} {name}" if number == 1 else f"{number} {name}s"


def _section(title: str, entries: tuple[str, ...]) -> Iterator[str]:
    if not entries:
        return
    yield f"{title}: {len(entries)}."
    yield from (f"- {entry}" for entry in entries[:LISTED])
    if len(entries) > LISTED:
        yield f"- and {len(entries) - LISTED} more; --json lists them all"
