"""Meta .haptic 1.0: one amplitude envelope and one of frequency."""

from __future__ import annotations

from typing import Any

from planner import Plan

from .curves import HapticCurves, haptic_curves, require, rounded, sharpness_hz, sharpness_of, single_curve

__all__ = ["content_of", "curves_of"]


def content_of(plan: Plan, actuator: tuple[int, int] | None) -> dict[str, Any]:
    """The content of a file for one actuator (row, col) of a plan, or (None) the mean over the grid."""
    curves = haptic_curves(plan).of(actuator)
    time_s, level = curves.time_s, curves.level[:, 0, 0]
    pitch = sharpness_of(curves.frequency_hz[0])
    amplitude = [{"time": rounded(t), "amplitude": rounded(v)} for t, v in zip(time_s, level, strict=True)]
    ends = (float(time_s[0]), float(time_s[-1]))
    return {
        "version": {"major": 1, "minor": 0, "patch": 0},
        "metadata": {"editor": "dotwave", "source": "", "project": "", "tags": [], "description": ""},
        "signals": {"continuous": {"envelopes": {
            "amplitude": amplitude, "frequency": [{"time": rounded(t), "frequency": pitch} for t in ends],
        }}},
    }  # fmt: skip


def curves_of(data: Any) -> HapticCurves:
    """The curve of a file, which is checked against the rules of the format; as that of HJIF."""
    require(data["version"]["major"] == 1 and "metadata" in data, "version 1 and metadata are required")
    envelopes = data["signals"]["continuous"]["envelopes"]
    amplitude, frequency = envelopes["amplitude"], envelopes["frequency"]
    times = [point["time"] for point in amplitude]
    require(len(amplitude) >= 2 and len(frequency) >= 2, "an envelope has at least two points")
    require(times == sorted(times) and times[0] >= 0, "times do not fall")
    require(frequency[-1]["time"] <= times[-1], "frequency does not go past the last amplitude")
    values = [point["amplitude"] for point in amplitude] + [point["frequency"] for point in frequency]
    require(all(0 <= value <= 1 for value in values), "values from 0 to 1")
    keys = {point["time"]: point["amplitude"] for point in amplitude}
    return single_curve(keys, sharpness_hz(frequency[0]["frequency"]))
