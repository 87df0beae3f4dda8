"""What was asked for, beside what was measured."""

from __future__ import annotations

from typing import Any

__all__ = ["goals"]

ERROR = 1.2e-6
"""Median error after 300 periods at which transients are compared."""


def goals(found: dict[str, Any]) -> list[dict[str, Any]]:
    """Every goal with its figure: what, measured, unit, goal, sense (most or least), reached; None where unknown."""
    peers, full = found["peers"], not found["quick"]
    fast = max((each for each in found["transients"] if each["median_error"] <= ERROR), key=_rate, default=None)
    rows = [
        ("100,000 steady states", 1e3 * found["steady"]["wall_s"] if full else None, "ms", 40.0, "most"),
        ("their largest error", found["steady"]["largest_error"], "", 1e-6, "most"),
        ("one chain alone", 1e3 * found["one_alone"]["wall_s"], "ms", 1.0, "most"),
        ("transients", None if fast is None else _rate(fast) / 1e6, "M chain-periods/s", 10.0, "least"),
        ("steady state against heyoka batch", _ratio(peers, "heyoka batch 8", "steady"), "x", 2000.0, "least"),
        ("steady state against scipy DOP853", _ratio(peers, "scipy DOP853", "steady"), "x", 1e6, "least"),
        ("steady state against AUTO-07p, a point", _ratio(peers, "AUTO-07p", "steady"), "x", 3000.0, "least"),
        ("steady state against pyHarm-os, a point", _ratio(peers, "pyHarm-os", "steady"), "x", 3000.0, "least"),
        ("transients against heyoka batch", _ratio(peers, "heyoka batch 8", "transient"), "x", 5.0, "least"),
        ("transients against numbalsoda", _ratio(peers, "numbalsoda dop853", "transient"), "x", 100.0, "least"),
        ("slope of time, chain to 10^6", found["lengths"]["chain"]["slope"] if full else None, "", 1.1, "most"),
        ("slope of time, grid to 1000 x 1000", found["lengths"]["grid"]["slope"] if full else None, "", 1.1, "most"),
        ("slope of memory, chain", found["lengths"]["chain"]["memory_slope"], "", 1.1, "most"),
        ("slope of memory, grid", found["lengths"]["grid"]["memory_slope"], "", 1.1, "most"),
        ("map of 1000 x 1000 to NPZ and PNG", found["map"]["wall_s"] if full else None, "s", 3.0, "most"),
    ]  # fmt: skip
    names = ("what", "measured", "unit", "goal", "sense")
    return [dict(zip(names, row, strict=True)) | {"reached": _met(row[1], row[3], row[4])} for row in rows]


def _rate(each: dict[str, Any]) -> float:
    rate: float = each["chain_periods_per_s"]
    return rate


def _ratio(peers: dict[str, Any], name: str, kind: str) -> float | None:
    found: float | None = peers[name].get(f"{kind}_ratio")
    return found


def _met(value: float | None, goal: float, sense: str) -> bool | None:
    if value is None:
        return None
    return value <= goal if sense == "most" else value >= goal
