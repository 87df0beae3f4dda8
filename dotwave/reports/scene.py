"""What came of a scene of pictures, textures and texts: its outcomes and numbers, as JSON and as plain text."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from .plan import PlanReport
from .text import Spreading, margin_lines

__all__ = ["SceneReport"]


@dataclass(frozen=True)
class SceneReport(PlanReport):
    """What was rendered and what the planner predicts for it.

    Attributes
    ----------
    device : name of the profile. parts : one line on each thing shown. frames : how many were planned.
    duration_s : seconds. files : what was written; empty when no output was asked for.
    peak_volts, limit_volts : largest voltage of any channel, and what the amplifier can give.
    ramp_s : longest way into a frame. error : predicted worst deviation, and `tolerance` the largest that is ok, both
        in units of full scale. outcomes : outcome -> number of frames. notes : sentences a person should read.
    seconds : time taken. slew, multiplier, spread : as in `TextReport`.
    """

    device: str
    parts: tuple[str, ...]
    frames: int
    duration_s: float
    files: tuple[str, ...]
    peak_volts: float
    limit_volts: float
    ramp_s: float
    error: float
    tolerance: float
    outcomes: Mapping[str, int]
    notes: tuple[str, ...]
    seconds: float
    slew: float = 0.0
    multiplier: float = 0.0
    spread: Spreading | None = None

    def _lines(self) -> Iterator[str]:
        yield f"Rendered {self.frames} frame{'' if self.frames == 1 else 's'} for {self.device}."
        yield from (f"- {part}" for part in self.parts)
        yield f"Duration: {self.duration_s:.2f} s."
        yield f"Peak: {self.peak_volts:.1f} V of {self.limit_volts:g} V."
        yield from margin_lines(self.slew, self.multiplier)
        yield f"Longest ramp: {self.ramp_s:.3f} s."
        worst = f"{100 * self.error:.2f} % of full scale (at most {100 * self.tolerance:g} % wanted)"
        yield f"Predicted error of the settled patterns: {worst}."
        if self.spread is not None:
            yield from self.spread.lines()
        if not self.ok:
            counts = ", ".join(f"{name} {count}" for name, count in self.outcomes.items())
            yield f"Not every frame can be made as asked: {counts}."
        yield from self.notes
        yield from (f"Written: {name}" for name in self.files)
        yield f"Time taken: {self.seconds:.2f} s."
