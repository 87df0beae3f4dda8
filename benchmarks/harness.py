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
from continuation import CONTINUATIONS  # noqa: E402
from goals import ERROR, STEADY_ERROR, goals, rate  # noqa: E402
from integrators import INTEGRATORS, Missing, Way  # noqa: E402
from ours import lengths, map_of_settings, one_alone, states_after, steady, transients  # noqa: E402
from problem import PERIODS, SETTLED  # noqa: E402
from shooting import CHAINS, steady_by_shooting, transients_by  # noqa: E402

__all__ = ["measure"]

CORES = os.cpu_count() or 1
# The quickest ways of transients are those that shooting is tried with.
SHOOTING_WAYS = 3
# Periods from rest until nothing but rounding is left of the way in.
STILL = 20_000


def measure(quick: bool) -> dict[str, Any]:
    """Everything, as plain values; `quick` takes fewer settings."""
    found: dict[str, Any] = {
        "schema": "dotwave/bench/3",
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
    """Every peer at its best settings, with ratios to ours on as many cores: theirs on one, ours per core."""
    fast = max((each for each in found["transients"] if each["median_error"] <= ERROR), key=lambda each: rate(each))
    ours_period = fast["cpu_s"] / (rate(fast) * fast["wall_s"])
    ours_steady = found["steady"]["cpu_s"] / found["steady"]["settings"]
    told: dict[str, Any] = {}
    for name, ways in INTEGRATORS.items():
        try:
            told[name] = _integrated(list(ways()), ours_period, ours_steady)
        except Missing as reason:
            told[name] = {"missing": str(reason)}
    for name, follow in CONTINUATIONS.items():
        try:
            point = follow(STEADY_ERROR)
            told[name] = {"steady": point | {"way": "a point of a branch", "ratio": point["s_per_chain"] / ours_steady}}
        except Missing as reason:
            told[name] = {"missing": str(reason)}
    return told


def _integrated(ways: list[Way], ours_period: float, ours_steady: float) -> dict[str, Any]:
    """Transients, steady states by shooting, and what these would take from rest."""
    motion = transients_by(ways, states_after(CHAINS, 64), ERROR)
    motion["ratio"] = motion["s_per_chain"] / PERIODS / ours_period
    quick = sorted(ways, key=lambda way: motion["tried"][way.settings])[:SHOOTING_WAYS]
    still = steady_by_shooting(quick, states_after(CHAINS, 64, STILL), STEADY_ERROR)
    still |= {"way": "shooting", "ratio": still["s_per_chain"] / ours_steady}
    waited = {"periods": SETTLED, "extrapolated": True}
    waited["ratio"] = motion["s_per_chain"] / PERIODS * SETTLED / ours_steady
    return {"transients": motion, "steady": still, "from_rest": waited}


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
