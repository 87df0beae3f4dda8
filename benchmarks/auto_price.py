"""What `auto` costs over the cheapest rung that meets the tolerance, on every scene of the README and docs/accuracy.md.

python benchmarks/auto_price.py                 print it beside the goal
python benchmarks/auto_price.py --keep          write benchmarks/results/auto_price.json
"""

from __future__ import annotations

import argparse
import json
import os
import time
from collections.abc import Callable
from pathlib import Path

# Matrices are small here: further threads would only wait for each other.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from chainsim import Device, Response, load_device
from encoders import Frame, GridShape, Scene, TextOptions, TextSource, encode_text, plane_wave
from planner import TradeoffRow, plan_scene, trade_off

HERE = Path(__file__).resolve().parent
KEPT = HERE / "results" / "auto_price.json"
PARAGRAPH = HERE.parent / "samples" / "texts" / "paragraph.txt"
SHAPE = GridShape(6, 6)
GOAL, LEAST_S = 2.0, 0.5


def text(words: str) -> Scene:
    return encode_text(TextSource.of_text(words), SHAPE, TextOptions())


def wave() -> Scene:
    return Scene(SHAPE, (Frame(plane_wave(SHAPE, lag_deg=90, level=0.3), 8.0),))


SCENES: dict[str, tuple[str, Callable[[], Scene]]] = {
    "Hello world": ("linked-6x6", lambda: text("Hello world")),
    "Hello world, deflected": ("paper-6x6", lambda: text("Hello world")),
    "Hello world, uncoupled": ("independent-6x6", lambda: text("Hello world")),
    "the paragraph of the demo": ("linked-6x6", lambda: text(PARAGRAPH.read_text("utf-8"))),
    "Hello": ("linked-6x6", lambda: text("Hello")),
    "Hello, deflected": ("paper-6x6", lambda: text("Hello")),
    "a wave": ("paper-6x6", wave),
}
"""Name -> device and scene."""


def price(run: Callable[[], list[Response]]) -> tuple[list[Response], float]:
    """The processor's time of a run: the best of as many as fit into a moment."""
    seconds, began = float("inf"), time.process_time()
    while time.process_time() - began < LEAST_S:
        before = time.process_time()
        answers = run()
        seconds = min(seconds, time.process_time() - before)
    return answers, seconds


def ratios(scene: Scene, device: Device) -> dict[str, float]:
    """Tolerance -> time of `auto` over that of the cheapest rung whose error meets it."""
    found = trade_off(list(plan_scene(scene, device).frames), device, price=price)
    # No error is known better than the reference.
    met = {tol: max(tol, found.reference_error) for tol in sorted({row.tol for row in found.rows if row.tol})}

    def cheapest(rows: list[TradeoffRow], tol: float) -> float:
        return min(row.seconds for row in rows if row.error <= met[tol] and row.solved == 1)

    autos = [row for row in found.rows if row.rung == "auto"]
    others = [row for row in found.rows if row.rung != "auto"]
    return {f"{tol:g}": cheapest([one for one in autos if one.tol == tol], tol) / cheapest(others, tol) for tol in met}


def main() -> None:
    reading = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    reading.add_argument("--keep", action="store_true", help="write what was measured")
    kept, measured = json.loads(KEPT.read_text()) if KEPT.exists() else {}, {}
    keep = reading.parse_args().keep
    for name, (device, make) in SCENES.items():
        measured[name] = ratios(make(), load_device(device))
        before = max(kept.get(name, {"": float("nan")}).values())
        worst = max(measured[name].values())
        said = ", ".join(f"{tol}: {ratio:.2f}" for tol, ratio in measured[name].items())
        print(f"{name} on {device}: {said}; worst {worst:.2f}, kept {before:.2f} (goal: {GOAL:g})", flush=True)
    if keep:
        KEPT.write_text(json.dumps(measured, indent=1) + "\n", "utf-8")


if __name__ == "__main__":
    main()
