"""A plan as amplitude over time, actuator by actuator: what haptic exchange formats can say of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planner import Plan

from ..errors import WaveformError

__all__ = [
    "DIGITS", "HapticCurves", "haptic_curves", "require", "rounded", "sharpness_hz", "sharpness_of", "single_curve",
]  # fmt: skip

Floats = NDArray[np.float64]

DIGITS = 6
SHARPNESS_HZ = (65.0, 300.0)  # sharpness 0 and 1, as MPEG maps Apple's


@dataclass(frozen=True)
class HapticCurves:
    """Levels of a grid at key times, straight lines between.

    Attributes
    ----------
    time_s : float64, shape (K,), rising, first 0.
    level : float64, shape (K, rows, cols), 0..1 of full scale.
    phase : float64, shape (K, rows, cols), radians of each actuator's vibration against the carrier.
    frequency_hz : float64, shape (rows,), of each row's drive.
    """

    time_s: Floats
    level: Floats
    phase: Floats
    frequency_hz: Floats

    def of(self, actuator: tuple[int, int] | None) -> HapticCurves:
        """One actuator as a grid of 1 x 1, or (None) the mean over the grid."""
        if actuator is None:
            level = self.level.mean(axis=(1, 2), keepdims=True)
            return HapticCurves(self.time_s, level, np.zeros_like(level), self.frequency_hz.mean(keepdims=True))
        row, col = actuator
        if not (0 <= row < self.level.shape[1] and 0 <= col < self.level.shape[2]):
            raise WaveformError(
                f"actuator {row},{col}: the grid has rows 0 to {self.level.shape[1] - 1} and "
                f"columns 0 to {self.level.shape[2] - 1}"
            )
        window = (slice(None), slice(row, row + 1), slice(col, col + 1))
        return HapticCurves(self.time_s, self.level[window], self.phase[window], self.frequency_hz[row : row + 1])


def haptic_curves(plan: Plan) -> HapticCurves:
    """Key times of a plan: where each frame starts, has settled and ends.

    Raises
    ------
    WaveformError
        When a pattern is held still by a bias: these formats carry vibrations.
    """
    device = plan.device
    if device.bias == "actuator":
        raise WaveformError(
            f"{device.name} holds patterns still, and haptic files carry vibrations; choose a device without bias"
        )
    shape = (device.rows, device.cols)
    times, levels, phases = [0.0], [np.zeros(shape)], [np.zeros(shape)]
    frequency = np.full(device.rows, device.f0_hz)
    for frame in plan.frames:
        phasor = np.array([state.phasor for state in frame.states]).reshape(shape) / device.full_scale
        level = np.minimum(np.abs(phasor), 1.0)
        phase = np.where(level > 0, np.angle(phasor), phases[-1])
        firsts = frame.states[:: device.chains_per_row]
        for row, state in enumerate(firsts * device.rows if device.grid else firsts):
            if level[row].any():
                frequency[row] = state.omega * device.f0_hz
        for time_s in (frame.settled_s, frame.end_s):
            if time_s > times[-1]:
                times.append(time_s)
                levels.append(level)
                phases.append(phase)
    return HapticCurves(np.array(times), np.array(levels), np.array(phases), frequency)


def rounded(value: float) -> float:
    """A number as it stands in a file."""
    return round(float(value), DIGITS)


def require(rule: bool, sentence: str) -> None:
    """Hold a file to a rule of its format.

    Raises
    ------
    ValueError
        With the rule, when it is broken.
    """
    if not rule:
        raise ValueError(sentence)


def sharpness_of(hertz: float) -> float:
    """A frequency on the scale 0..1 of the formats for phones."""
    low, high = SHARPNESS_HZ
    return rounded(min(1.0, max(0.0, (hertz - low) / (high - low))))


def sharpness_hz(sharpness: float) -> float:
    """The frequency of a sharpness 0..1."""
    low, high = SHARPNESS_HZ
    return low + sharpness * (high - low)


def single_curve(keys: dict[float, float], hertz: float) -> HapticCurves:
    """Curves of one actuator from level by time in seconds."""
    require(len(keys) >= 2, "a curve has at least two points")
    times = sorted(keys)
    level = np.array([keys[t] for t in times])[:, None, None]
    return HapticCurves(np.array(times), level, np.zeros_like(level), np.array([hertz]))
