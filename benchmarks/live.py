"""How long after a window is written its pattern stands on the controller, when dotwave plays live.

python benchmarks/live.py                    print it beside the goals
python benchmarks/live.py --keep             write benchmarks/results/live.json

Time is that of the controller, which plays in virtual time and moves on by a millisecond at a step; the processor's
time that planning the way takes is added, as if the line stood still meanwhile. 200 random windows of six cells come
while nothing moves, once with no way kept from before, and once more with all of them kept, as they are after a while:
a live grid plans its ways ahead when it has nothing else to do. `host` is the processor's time of planning, sampling
and sending, in seconds a second played; the controller's own is not in it.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import sys
import tempfile
import time
from functools import partial
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Any

import numpy as np

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))
if TYPE_CHECKING:
    from tests.support.live_bench import LiveBench

KEPT = ROOT / "benchmarks" / "results" / "live.json"
GOALS_S = {"paper-6x6": 0.13, "linked-6x6": 0.42}
STANDS_S = (0.1, 0.3)


def measured(name: str, windows: int) -> dict[str, Any]:
    """Both rounds on one device; what is kept begins empty."""
    from chainsim import load_device
    from tests.support.live_bench import LiveBench

    class Timed(LiveBench):
        host_s = 0.0

        def step(self) -> None:
            self.host_s += self.stepped_s()

    bench = Timed(load_device(name))
    bench.core.warm_up()
    bench.run(0.2)
    rng = np.random.default_rng(16)
    cells = ["".join(chr(0x2800 + int(code)) for code in rng.integers(0, 64, 6)) for _ in range(windows)]
    found: dict[str, Any] = {"goal_s": GOALS_S[name], "lead_s": 0.06}
    for round_name in ("first", "kept"):
        bench.core.rest()
        bench.run(1.0)
        began, host = bench.now, bench.host_s
        latencies, planning = [], []
        for number, window in enumerate(cells):
            stood = len(bench.latencies_s)
            bench.show(window, f"{round_name} {number}")
            before = time.thread_time()
            bench.core.plan()
            planning.append(time.thread_time() - before)
            bench.run(3.0, partial(_later, bench, stood))
            latencies.append(bench.latencies_s[-1] + planning[-1])
            bench.run(rng.uniform(*STANDS_S))
        found[round_name] = {
            "median_s": median(latencies), "worst_s": max(latencies),
            "planning_median_s": median(planning), "planning_worst_s": max(planning),
            "host": (bench.host_s - host + sum(planning)) / (bench.now - began),
        }  # fmt: skip
    return found | {"windows": windows, "underruns": bench.session.report.underruns}


def _later(bench: LiveBench, stood: int) -> bool:
    return len(bench.latencies_s) > stood


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--keep", action="store_true", help=f"write {KEPT.name}")
    parser.add_argument("--windows", type=int, default=200)
    given = parser.parse_args()
    devices: dict[str, Any] = {}
    found: dict[str, Any] = {"python": platform.python_version(), "devices": devices}
    with tempfile.TemporaryDirectory() as folder:
        os.environ["DOTWAVE_CACHE"] = folder
        for name in GOALS_S:
            devices[name] = one = measured(name, given.windows)
            for round_name in ("first", "kept"):
                of = one[round_name]
                print(
                    f"{name}, ways {round_name}: median {1e3 * of['median_s']:.0f} ms, worst "
                    f"{1e3 * of['worst_s']:.0f} ms (goal: {1e3 * one['goal_s']:.0f}); planning "
                    f"{1e3 * of['planning_median_s']:.1f} ms, worst {1e3 * of['planning_worst_s']:.1f} ms; "
                    f"host {of['host']:.0%} of a core; {one['underruns']} underruns"
                )
    if given.keep:
        found["load"] = os.getloadavg()[0]
        KEPT.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
