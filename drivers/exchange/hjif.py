"""MPEG HJIF (ISO/IEC 23090-31): the only standard that carries the grid and its phases, a channel an actuator."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from planner import Plan

from .curves import HapticCurves, haptic_curves, require, rounded

__all__ = ["content_of", "curves_of"]

TIMESCALE = 1000  # ticks a second


def content_of(plan: Plan, _actuator: tuple[int, int] | None) -> dict[str, Any]:
    """The content of a file for a plan: profile Main, one vectorial-wave band a channel, all actuators."""
    curves = haptic_curves(plan)
    rows, cols = curves.level.shape[1:]
    device = plan.device
    reference = {
        "id": 0, "name": device.name, "type": "Piezo", "resonance_frequency": device.f0_hz,
        "maximum_voltage": device.amplifier.volts, "maximum_displacement": device.full_scale * device.length_m * 1e3,
    }  # fmt: skip
    perception = {
        "id": 0, "avatar_id": 0, "description": f"{rows} x {cols} actuators", "perception_modality": "Vibrotactile",
        "reference_devices": [reference], "effect_library": [],
        "channels": [_hjif_channel(curves, row, col) for row in range(rows) for col in range(cols)],
    }  # fmt: skip
    return {
        "version": "2023", "profile": "Main", "level": 1 if rows * cols <= 127 else 2, "date": "2026-01-01",
        "description": "written by dotwave", "timescale": TIMESCALE, "perceptions": [perception],
        "avatars": [], "syncs": [],
    }  # fmt: skip


def _hjif_channel(curves: HapticCurves, row: int, col: int) -> dict[str, Any]:
    rows, cols = curves.level.shape[1:]
    hertz = float(curves.frequency_hz[row])
    effects = []
    # One effect for each stretch of constant phase; within it the level moves between keyframes.
    starts = [
        0,
        *(k for k in range(1, len(curves.time_s)) if curves.phase[k, row, col] != curves.phase[k - 1, row, col]),
    ]
    for first, stop in zip(starts, [*starts[1:], len(curves.time_s)], strict=True):
        begin = max(0, first - 1)
        position = round(curves.time_s[begin] * TIMESCALE)
        keyframes = [
            {
                "relative_position": round(curves.time_s[k] * TIMESCALE) - position,
                "amplitude_modulation": rounded(curves.level[k, row, col]),
                "frequency_modulation": rounded(hertz),
            }
            for k in range(begin, stop)
        ]
        phase = math.remainder(float(curves.phase[first, row, col]), 2 * math.pi)
        effects.append({
            "effect_type": "Basis", "position": position, "phase": rounded(phase), "base_signal": "Sine",
            "keyframes": keyframes,
        })  # fmt: skip
    band = {
        "band_type": "VectorialWave", "lower_frequency_limit": 0, "upper_frequency_limit": 1000, "effects": effects,
    }  # fmt: skip
    return {
        "id": row * cols + col, "description": f"row {row}, column {col}", "gain": 1.0, "mixing_coefficient": 1.0,
        "body_part_mask": 0, "reference_device_id": 0,
        "actuator_resolution": {"X": cols, "Y": rows, "Z": 1}, "actuator_target": [{"X": col, "Y": row, "Z": 0}],
        "bands": [band],
    }  # fmt: skip


def curves_of(data: Any) -> HapticCurves:
    """The curves of a file, which is checked against the rules of the format.

    Raises
    ------
    ValueError, KeyError, TypeError, IndexError
        When it breaks one.
    """
    require(data["version"] == "2023" and data["profile"] in {"Main", "Simple Parametric"}, "version or profile")
    require(data["level"] in {1, 2} and 0 < data["timescale"] <= 48000, "level is 1 or 2, timescale up to 48000")
    require(
        {"date", "description", "avatars", "syncs"} <= set(data), "date, description, avatars and syncs are required"
    )
    (perception,) = data["perceptions"]
    channels = perception["channels"]
    require(len(channels) <= 127 or data["level"] == 2, "level 1 has at most 127 channels")
    size = channels[0]["actuator_resolution"]
    rows, cols = int(size["Y"]), int(size["X"])
    require(len(channels) == rows * cols, "one channel for each actuator")
    times = sorted({t for channel in channels for t, *_ in _hjif_keys(channel)})
    time_s = np.array(times) / data["timescale"]
    level, phase = np.zeros((2, len(times), rows, cols))
    frequency = np.zeros(rows)
    for channel in channels:
        (target,) = channel["actuator_target"]
        row, col = int(target["Y"]), int(target["X"])
        keys = {t: (amplitude, hertz, angle) for t, amplitude, hertz, angle in _hjif_keys(channel)}
        at = sorted(keys)
        level[:, row, col] = np.interp(times, at, [keys[t][0] for t in at])
        phase[:, row, col] = [keys[max(t for t in at if t <= time)][2] for time in times]
        frequency[row] = keys[at[-1]][1]
    return HapticCurves(time_s, level, phase, frequency)


def _hjif_keys(channel: Any) -> Iterator[tuple[int, float, float, float]]:
    require(len(channel["bands"]) <= 7, "at most 7 bands")
    for band in channel["bands"]:
        require(band["band_type"] == "VectorialWave", "band_type")
        require(band["lower_frequency_limit"] < band["upper_frequency_limit"], "frequency limits")
        for effect in band["effects"]:
            require(effect["effect_type"] == "Basis" and effect["base_signal"] == "Sine", "effect")
            places = [key["relative_position"] for key in effect["keyframes"]]
            require(places == sorted(places) and places[:1] == [0], "keyframes rise from 0")
            for key in effect["keyframes"]:
                require(0 <= key["amplitude_modulation"] <= 1, "amplitude_modulation from 0 to 1")
                yield (
                    effect["position"] + key["relative_position"], key["amplitude_modulation"],
                    key["frequency_modulation"], effect["phase"],
                )  # fmt: skip
