"""How long ``dotwave text Hello -o x.wav`` takes, in units of ``python -c "import numpy"``.

python benchmarks/startup.py                    print it beside the goal
python benchmarks/startup.py --keep             write benchmarks/results/startup.json

The two run in turn, and what counts is the median of the ratios of each pair: whatever else the machine does meets
both. Modules are compiled and the text is planned before, as at any call but the first after an installation.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from statistics import median
from typing import NamedTuple

ROOT = Path(__file__).resolve().parent.parent
KEPT = ROOT / "benchmarks" / "results" / "startup.json"
GOAL = 2.5


class Taken(NamedTuple):
    """Seconds of one run: by the clock, and of the processor."""

    wall: float
    processor: float


def taken(arguments: list[str], folder: str) -> Taken:
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "PYTHONPYCACHEPREFIX": folder, "DOTWAVE_CACHE": folder}
    environment.pop("PYTHONDONTWRITEBYTECODE", None)
    before, began = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    subprocess.run([sys.executable, *arguments], cwd=folder, env=environment, stdout=subprocess.DEVNULL, check=True)
    wall, after = time.perf_counter() - began, resource.getrusage(resource.RUSAGE_CHILDREN)
    return Taken(wall, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)


def measured(pairs: int) -> dict[str, object]:
    numpy, text = ["-c", "import numpy"], ["-m", "dotwave", "text", "Hello", "-o", "x.wav"]
    with tempfile.TemporaryDirectory() as folder:
        # The first of each compiles, and plans.
        runs = [(taken(numpy, folder), taken(text, folder)) for _ in range(pairs + 1)][1:]
    found: dict[str, object] = {"python": platform.python_version(), "pairs": pairs, "goal": GOAL}
    for kind in Taken._fields:
        alone, ours = ([getattr(run[which], kind) for run in runs] for which in (0, 1))
        ratio = median(b / a for a, b in zip(alone, ours, strict=True))
        found[kind] = {"numpy_s": median(alone), "text_s": median(ours), "ratio": ratio}
    return found | {"load": os.getloadavg()[0]}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--keep", action="store_true", help=f"write {KEPT.name}")
    parser.add_argument("--pairs", type=int, default=15)
    given = parser.parse_args()
    found = measured(given.pairs)
    for kind in Taken._fields:
        seconds = found[kind]
        assert isinstance(seconds, dict)
        print(
            f"{kind}: import numpy {seconds['numpy_s']:.3f} s, dotwave text {seconds['text_s']:.3f} s, "
            f"{seconds['ratio']:.2f} times as long (goal: {GOAL:g})"
        )
    if given.keep:
        KEPT.parent.mkdir(parents=True, exist_ok=True)
        KEPT.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
