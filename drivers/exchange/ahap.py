"""Apple AHAP 1.0: one intensity curve; at most 16 points a curve and 30 s an event."""

from __future__ import annotations

from typing import Any

import numpy as np

from planner import Plan

from .curves import DIGITS, HapticCurves, haptic_curves, require, rounded, sharpness_hz, sharpness_of, single_curve

__all__ = ["content_of", "curves_of"]

POINTS, EVENT_S = 16, 30.0


def content_of(plan: Plan, actuator: tuple[int, int] | None) -> dict[str, Any]:
    """The content of a file for one actuator (row, col) of a plan, or (None) the mean over the grid."""
    curves = haptic_curves(plan).of(actuator)
    time_s, level = curves.time_s, curves.level[:, 0, 0]
    sharpness = sharpness_of(curves.frequency_hz[0])
    pattern: list[dict[str, Any]] = []
    starts = np.arange(0.0, time_s[-1], EVENT_S)
    for start in starts:
        pattern.append({"Event": {
            "Time": rounded(start), "EventType": "HapticContinuous",
            "EventDuration": rounded(min(EVENT_S, time_s[-1] - start)),
            "EventParameters": [
                {"ParameterID": "HapticIntensity", "ParameterValue": 1.0},
                {"ParameterID": "HapticSharpness", "ParameterValue": sharpness},
            ],
        }})  # fmt: skip
    # Curves share their end points, so that the level goes on without a jump.
    for first in range(0, max(1, len(time_s) - 1), POINTS - 1):
        part = slice(first, first + POINTS)
        points = [
            {"Time": rounded(t - time_s[first]), "ParameterValue": rounded(v)}
            for t, v in zip(time_s[part], level[part], strict=True)
        ]
        pattern.append({"ParameterCurve": {
            "ParameterID": "HapticIntensityControl", "Time": rounded(time_s[first]),
            "ParameterCurveControlPoints": points,
        }})  # fmt: skip
    return {"Version": 1.0, "Pattern": pattern}


def curves_of(data: Any) -> HapticCurves:
    """The curve of a file, which is checked against the rules of the format; as that of HJIF."""
    require(data["Version"] == 1.0, "Version is 1.0")
    keys: dict[float, float] = {}
    sharpness = 0.0
    for item in data["Pattern"]:
        if "Event" in item:
            event = item["Event"]
            require(event["EventType"] == "HapticContinuous", "EventType is HapticContinuous")
            require(0 < event["EventDuration"] <= EVENT_S, "an event lasts at most 30 s")
            values = {p["ParameterID"]: p["ParameterValue"] for p in event["EventParameters"]}
            require(all(0 <= value <= 1 for value in values.values()), "parameters from 0 to 1")
            sharpness = values["HapticSharpness"]
        else:
            curve = item["ParameterCurve"]
            points = curve["ParameterCurveControlPoints"]
            require(0 < len(points) <= POINTS, "a curve has at most 16 points")
            for point in points:
                require(0 <= point["ParameterValue"] <= 1, "values from 0 to 1")
                keys[round(curve["Time"] + point["Time"], DIGITS)] = point["ParameterValue"]
    return single_curve(keys, sharpness_hz(sharpness))
