"""What came of a scene of pictures, textures and texts: its outcomes and numbers, as JSON and as plain text."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from .report import Report, margin_lines, outcome_lines

__all__ = ["SceneReport"]


@dataclass(frozen=True, kw_only=True, repr=False)
class SceneReport(Report):
    """What was rendered of a scene.

    Attributes
    ----------
    parts : one line on each thing shown.
    tolerance : largest error that is ok, in units of full scale; None for any.
    """

    KEYS = (
        "device", "parts", "frames", "duration_s", "files", "peak_volts", "limit_volts", "ramp_s", "error",
        "tolerance", "outcomes", "notes", "seconds", "slew", "multiplier", "spread",
    )  # fmt: skip

    parts: tuple[str, ...]
    tolerance: float | None = None

    def _lines(self) -> Iterator[str]:
        yield f"Rendered {self.frames} frame{'' if self.frames == 1 else 's'} for {self.device}."
        yield from (f"- {part}" for part in self.parts)
        yield f"Duration: {self.duration_s:.2f} s."
        yield f"Peak: {self.peak_volts:.1f} V of {self.limit_volts:g} V."
        yield from margin_lines(self)
        yield f"Longest ramp: {self.ramp_s:.3f} s."
        limit = "" if self.tolerance is None else f" (at most {100 * self.tolerance:g} % wanted)"
        yield f"Predicted error of the settled patterns: {100 * self.error:.2f} % of full scale{limit}."
        if self.spread is not None:
            yield from self.spread.lines()
        yield from outcome_lines(self)
        yield from self.notes
        yield from (f"Written: {name}" for name in self.files)
        yield f"Time taken: {self.seconds:.2f} s."
