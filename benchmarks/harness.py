"""All measurements in one run: ``python benchmarks/harness.py OUT [--quick]`` writes bench.json and bench.svg."""

from __future__ import annotations

import argparse
import json
import os
import platform
import sys
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent)]

from chart import draw  # noqa: E402
from goals import ERROR, goals  # noqa: E402
from ours import lengths, map_of_settings, one_alone, states_after, steady, transients  # noqa: E402
from peers import PEERS, Missing  # noqa: E402
from problem import PERIODS, SETTLED  # noqa: E402

__all__ = ["measure"]

CORES = os.cpu_count() or 1


def measure(quick: bool) -> dict[str, Any]:
    """Everything, as plain values; `quick` takes fewer settings."""
    found: dict[str, Any] = {
        "schema": "dotwave/bench/2",
        "quick": quick,
        "machine": {"processor": _processor(), "cores": CORES, "python": platform.python_version()},
        "load_before": os.getloadavg()[0],
        "steady": steady(10_000 if quick else 100_000, 15),
        "one_alone": one_alone(),
        "transients": transients(1024 if quick else 10_000, 5),
        "lengths": lengths(100_000 if quick else 1_000_000),
        "map": map_of_settings(100 if quick else 1000, 3),
    }
    found["peers"] = _peers(found)
    found["load_after"] = os.getloadavg()[0]
    found["goals"] = goals(found)
    return found


def _peers(found: dict[str, Any]) -> dict[str, Any]:
    """Every peer at an error of `ERROR`, with ratios to ours on as many cores: theirs on one, ours per core."""
    wanted = states_after(64, 64)
    best = max(
        (each for each in found["transients"] if each["median_error"] <= ERROR),
        key=lambda each: each["chain_periods_per_s"],
    )
    ours_period = best["cpu_s"] / (best["chain_periods_per_s"] * best["wall_s"])
    ours_steady = found["steady"]["cpu_s"] / found["steady"]["settings"]
    told: dict[str, Any] = {}
    for name, peer in PEERS.items():
        try:
            told[name] = peer(wanted, ERROR)
        except Missing as reason:
            told[name] = {"missing": str(reason)}
            continue
        if "s_per_point_one_core" in told[name]:
            told[name] |= {"steady_ratio": told[name]["s_per_point_one_core"] / ours_steady, "extrapolated": False}
            continue
        seconds = told[name]["s_per_chain_one_core"] / PERIODS
        # From rest the steady state takes SETTLED periods; the time for them is scaled up from PERIODS.
        told[name] |= {
            "transient_ratio": seconds / ours_period,
            "steady_ratio": seconds * SETTLED / ours_steady,
            "extrapolated": True,
        }
    return told


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor()
    return next(
        (line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")), platform.processor()
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--quick", action="store_true")
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    found = measure(given.quick)
    (given.out / "bench.json").write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    (given.out / "bench.svg").write_text(draw(found), encoding="utf-8")


if __name__ == "__main__":
    main()
