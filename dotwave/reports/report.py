"""What is said of a plan that was carried out, whatever it shows: its totals, a verdict, and what was asked beside."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from ..plain import Printable, one_line
from .totals import Spreading

__all__ = ["Report", "margin_lines", "outcome_lines", "plain"]


@dataclass(frozen=True, kw_only=True, repr=False)
class Report(ABC):
    """What was rendered and what the planner predicts for it.

    Attributes
    ----------
    device : name of the profile.
    frames : how many were planned.
    duration_s : length of the waveform in seconds.
    files : what was written; empty when no output was asked for.
    peak_volts, limit_volts : largest voltage of any channel, and what the amplifier can give.
    ramp_s : longest way into a frame.
    error : predicted worst deviation in units of full scale.
    outcomes : outcome -> number of frames.
    failure : what is lacking for the first frame that cannot be made as asked; empty where all can.
    notes : sentences a person should read; that one is among them.
    seconds : time taken.
    well : largest deflection over the limit of the softening well, noise_gain : largest magnification of disturbances
        of any pattern, slew : fastest change of a steady drive over the amplifier's, multiplier : largest Floquet
        multiplier of a wave (all as in `planner.Margins`).
    spread : of the frame that suffers most.
    reached, met : sentences on a tolerance and a budget, and whether the tolerance was met.
    beside : further reports that were asked for, by their names.
    """

    KEYS: ClassVar[tuple[str, ...]]
    """Names of the attributes that stand in the JSON, in order."""

    device: str
    frames: int
    duration_s: float
    files: tuple[str, ...]
    peak_volts: float
    limit_volts: float
    ramp_s: float
    error: float
    outcomes: Mapping[str, int]
    failure: str = ""
    notes: tuple[str, ...] = ()
    seconds: float = 0.0
    well: float = 0.0
    noise_gain: float = 1.0
    slew: float = 0.0
    multiplier: float = 0.0
    spread: Spreading | None = None
    reached: tuple[str, ...] = ()
    met: bool = True
    beside: Mapping[str, Printable] = field(default_factory=dict)

    @property
    def made(self) -> bool:
        """Every frame can be made as asked."""
        return set(self.outcomes) <= {"ok"}

    @property
    def ok(self) -> bool:
        """Every frame can be made as asked, and a tolerance that was asked for was met."""
        return self.made and self.met

    def __repr__(self) -> str:
        counts = ", ".join(f"{name} {count}" for name, count in self.outcomes.items())
        return f"<{type(self).__name__} on {self.device}: {counts or 'no frame'}, {self.duration_s:.2f} s>"

    def _repr_html_(self) -> str:
        from .html import html_facts

        return html_facts(f"What was rendered for {self.device}", self.as_dict())

    def as_dict(self) -> dict[str, Any]:
        """The report in plain JSON types; a number that is not finite becomes null."""
        found = {"ok": self.ok} | {name: plain(getattr(self, name)) for name in self.KEYS}
        if self.reached:
            found["reached"] = list(self.reached)
        return found | {name: part.as_dict() for name, part in self.beside.items()}

    def as_text(self) -> str:
        """The report as lines of plain text, then the sentences on what was reached, then the further reports."""
        said = [*map(one_line, self._lines()), *self.reached]
        return "\n".join([*said, *(part.as_text() for part in self.beside.values())])

    @abstractmethod
    def _lines(self) -> Iterator[str]: ...


def outcome_lines(report: Report) -> Iterator[str]:
    """A sentence on the frames that cannot be made as asked, where there are any."""
    if not report.made:
        counts = ", ".join(f"{name} {count}" for name, count in report.outcomes.items())
        yield f"Not every frame can be made as asked: {counts}."


def margin_lines(report: Report) -> Iterator[str]:
    """Sentences on margins that are only told where something vibrates."""
    if report.slew > 0:
        yield f"Slew of the steady drive: at most {100 * report.slew:.2g} % of the amplifier's."
    if report.multiplier > 0:
        yield f"Stability: largest Floquet multiplier {report.multiplier:.3f} (below 1 is stable)."


def plain(value: object) -> Any:
    """`value` in plain JSON types: arrays as rounded lists, numbers that are not finite as null."""
    if isinstance(value, np.ndarray):
        return [plain(item) for item in value]
    if isinstance(value, float | np.floating):
        return float(f"{value:.9g}") if math.isfinite(value) else None
    if isinstance(value, np.integer):
        return int(value)
    if hasattr(value, "as_dict"):
        return plain(value.as_dict())
    if isinstance(value, tuple | list):
        return [plain(item) for item in value]
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    return value
