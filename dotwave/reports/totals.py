"""The extremes over the frames of a plan, whatever it shows, and the nearest of a frame that cannot be made."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from chainsim import Device, Outcome
from planner import FramePlan, OperatingPoint

__all__ = ["Spreading", "Totals", "nearest_lines"]

MARGINS = ("volts", "well", "noise_gain", "slew", "multiplier")
# States that are remembered as looked at.
MOST_STATES = 4096


class Spreading(Protocol):
    """What a frame becomes under the device's spread, as `planner.FramePlan.spread` has it."""

    @property
    def expected(self) -> float:
        """Expected error in units of full scale."""

    def as_dict(self) -> dict[str, Any]:
        """Plain JSON types."""

    def lines(self) -> Iterator[str]:
        """Sentences for a person."""


@dataclass
class Totals:
    """Extremes over the frames passed so far; units as in `planner.FramePlan` and `planner.Margins`.

    `outcomes` counts frames by outcome, with the way out after the last where it cannot be made. `pages` counts those
    that were begun. `spread` is that of the frame with the largest expected error, None where no frame has one.
    """

    outcomes: dict[str, int] = field(default_factory=dict)
    pages: int = 0
    duration_s: float = 0.0
    ramp_s: float = 0.0
    error: float = 0.0
    volts: float = 0.0
    well: float = 0.0
    noise_gain: float = 1.0
    slew: float = 0.0
    multiplier: float = 0.0
    spread: Spreading | None = None
    _page: int = -1
    _states: dict[int, OperatingPoint] = field(default_factory=dict)

    def add(self, frame: FramePlan) -> None:
        """Take a frame into account."""
        if frame.frame is not None or frame.outcome is not Outcome.OK:
            self.outcomes[str(frame.outcome)] = self.outcomes.get(str(frame.outcome), 0) + 1
        if frame.frame is not None and frame.frame.page != self._page:
            self._page = frame.frame.page
            self.pages += 1
        self.duration_s = frame.end_s
        self.ramp_s = max(self.ramp_s, frame.settled_s - frame.start_s)
        self.error = max(self.error, frame.error)
        for state in frame.states:
            # Equal rows come from the planner as the same object.
            if id(state) not in self._states:
                if len(self._states) >= MOST_STATES:
                    self._states.clear()
                self._states[id(state)] = state
                for name in MARGINS:
                    setattr(self, name, max(getattr(self, name), getattr(state.margins, name)))
        if frame.spread is not None and (self.spread is None or frame.spread.expected > self.spread.expected):
            self.spread = frame.spread

    def of_report(self) -> dict[str, Any]:
        """The attributes of a `Report` that are known from here."""
        same = ("duration_s", "ramp_s", "error", "well", "noise_gain", "slew", "multiplier", "spread")
        found = {name: getattr(self, name) for name in same}
        return found | {"frames": sum(self.outcomes.values()), "outcomes": dict(self.outcomes)}


def nearest_lines(frame: FramePlan, device: Device) -> Iterator[str]:
    """The nearest pattern of a frame that cannot be made as asked, in words and numbers."""
    yield "The nearest pattern it can make, in percent of full scale, row by row:"
    levels = np.array([np.abs(state.phasor + state.mean) for state in frame.states]) / device.full_scale
    for row in levels.reshape(device.rows, device.cols):
        yield "  " + " ".join(f"{100 * level:3.0f}" for level in row)
    yield from _others(frame, device)


def _others(frame: FramePlan, device: Device) -> Iterator[str]:
    """The built-in devices that make patterns of this kind at will, by their families alone."""
    from chainsim import device_names, load_device
    from planner import made_at_will

    if frame.frame is None:
        return
    pattern = frame.frame.pattern
    names = [name for name in device_names() if name != device.name and made_at_will(pattern, load_device(name))]
    if names:
        yield f"Built-in devices that make such patterns: {', '.join(names)}; `dotwave reach` says how well."
