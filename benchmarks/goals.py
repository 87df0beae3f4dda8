"""What was asked for, beside what was measured."""

from __future__ import annotations

from typing import Any

__all__ = ["ERROR", "STEADY_ERROR", "goals", "rate"]

ERROR = 1.5e-6
"""Median error after 300 periods at which transients are compared; ours is 1.1e-6, heyoka's orders allow 1.4e-6."""
STEADY_ERROR = 1e-6
"""Largest error at which steady states are compared."""

FROM_REST = "set against periods from rest, heyoka in compact mode, SciPy one chain at a time; shooting is its best way"


def goals(found: dict[str, Any]) -> list[dict[str, Any]]:
    """Every goal with its figure: what, measured, unit, goal, sense (most or least), note, reached; None where unknown.

    A goal that was set against a peer at less than its best is kept and says so in its note; beside it stands what is
    asked of it now.
    """
    full, peers = not found["quick"], found["peers"]
    chain, grid = found["lengths"]["chain"], found["lengths"]["grid"]
    fast = max((each for each in found["transients"] if each["median_error"] <= ERROR), key=rate, default=None)
    rows = [
        ("100,000 steady states", 1e3 * found["steady"]["wall_s"] if full else None, "ms", 40.0, "most", ""),
        ("their largest error", found["steady"]["largest_error"], "", STEADY_ERROR, "most", ""),
        ("one chain alone", 1e3 * found["one_alone"]["wall_s"], "ms", 1.0, "most", ""),
        ("transients", None if fast is None else rate(fast) / 1e6, "M chain-periods/s", 10.0, "least", ""),
        ("transients against heyoka", _ratio(peers, "heyoka", "transients"), "x", 5.0, "least", ""),
        ("transients against numbalsoda", _ratio(peers, "numbalsoda", "transients"), "x", 100.0, "least",
         "set against one chain at a time; many as one system are its best"),
        ("transients against the best peer", _least(peers, "transients"), "x", 5.0, "least", "as it is asked now"),
        ("steady state against heyoka", _ratio(peers, "heyoka", "steady"), "x", 2000.0, "least", FROM_REST),
        ("steady state against heyoka from rest", _ratio(peers, "heyoka", "from_rest"), "x", 2000.0, "least",
         "1300 periods, extrapolated; not its best way"),
        ("steady state against SciPy", _ratio(peers, "SciPy", "steady"), "x", 1e6, "least", FROM_REST),
        ("steady state against AUTO-07p, a point", _ratio(peers, "AUTO-07p", "steady"), "x", 3000.0, "least",
         "set against 20 intervals, derivatives by differences; fewer, and given ones, are its best"),
        ("steady state against pyHarm-os, a point", _ratio(peers, "pyHarm-os", "steady"), "x", 3000.0, "least", ""),
        ("steady state against the best peer", _least(peers, "steady"), "x", 25.0, "least", "as it is asked now"),
        ("slope of time, chain to 10^6", chain["slope"] if full else None, "", 1.1, "most", ""),
        ("slope of time, grid to 1000 x 1000", grid["slope"] if full else None, "", 1.1, "most", ""),
        ("slope of memory, chain", chain["memory_slope"], "", 1.1, "most", ""),
        ("slope of memory, grid", grid["memory_slope"], "", 1.1, "most", ""),
        ("map of 1000 x 1000 to NPZ and PNG", found["map"]["wall_s"] if full else None, "s", 3.0, "most", ""),
    ]  # fmt: skip
    names = ("what", "measured", "unit", "goal", "sense", "note")
    return [dict(zip(names, row, strict=True)) | {"reached": _met(row[1], row[3], row[4])} for row in rows]


def rate(each: dict[str, Any]) -> float:
    """Chain-periods a second of a row of transients."""
    found: float = each["chain_periods_per_s"]
    return found


def _ratio(peers: dict[str, Any], name: str, kind: str) -> float | None:
    found: float | None = peers[name].get(kind, {}).get("ratio")
    return found


def _least(peers: dict[str, Any], kind: str) -> float | None:
    """Against the quickest of all peers."""
    return min((each[kind]["ratio"] for each in peers.values() if kind in each), default=None)


def _met(value: float | None, goal: float, sense: str) -> bool | None:
    if value is None:
        return None
    return value <= goal if sense == "most" else value >= goal
