"""What is said of every plan that is carried out, whatever it shows."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from chainsim import Device
from drivers import WrittenWaveform
from planner import FramePlan

from .text import Spreading

__all__ = ["PlanStopped", "Tally", "nearest_lines", "peak_volts"]


class PlanStopped(Exception):
    """A frame cannot be made as asked and there is nothing to write, or no time is left."""


@dataclass
class Tally:
    """Extremes over the frames passed so far; units as in `planner.FramePlan` and `planner.Margins`.

    `spread` is that of the frame with the largest expected error, None where no frame has one.
    """

    duration_s: float = 0.0
    ramp_s: float = 0.0
    error: float = 0.0
    volts: float = 0.0
    well: float = 0.0
    noise_gain: float = 1.0
    slew: float = 0.0
    multiplier: float = 0.0
    spread: Spreading | None = None

    def add(self, frame: FramePlan) -> None:
        """Take a frame into account."""
        margins = [state.margins for state in frame.states]
        self.duration_s = frame.end_s
        self.ramp_s = max(self.ramp_s, frame.settled_s - frame.start_s)
        self.error = max(self.error, *(state.error for state in frame.states))
        self.volts = max(self.volts, *(margin.volts for margin in margins))
        self.well = max(self.well, *(margin.well for margin in margins))
        self.noise_gain = max(self.noise_gain, *(margin.noise_gain for margin in margins))
        self.slew = max(self.slew, *(margin.slew for margin in margins))
        self.multiplier = max(self.multiplier, *(margin.multiplier for margin in margins))
        if frame.spread is not None and (self.spread is None or frame.spread.expected > self.spread.expected):
            self.spread = frame.spread


def peak_volts(written: WrittenWaveform | None, tally: Tally, device: Device) -> float:
    """Largest voltage of any channel: as written, else as planned."""
    if written is not None:
        return float(np.max(np.abs(written.peak_volts)))
    return tally.volts * device.amplifier.volts


def nearest_lines(frame: FramePlan, device: Device) -> Iterator[str]:
    """The nearest pattern of a frame that cannot be made as asked, in words and numbers."""
    yield "The nearest pattern it can make, in percent of full scale, row by row:"
    levels = np.array([np.abs(state.phasor + state.mean) for state in frame.states]) / device.full_scale
    for row in levels.reshape(device.rows, device.cols):
        yield "  " + " ".join(f"{100 * level:3.0f}" for level in row)
