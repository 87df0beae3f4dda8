"""Speed against accuracy for a fixed set of scenes, so that a change of the solvers shows.

python benchmarks/front.py                      print it beside what is kept
python benchmarks/front.py --keep               write benchmarks/results/front.json
"""

from __future__ import annotations

import argparse
import json
import os
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

# Matrices are small here: further threads would only wait for each other.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from chainsim import Device, Setting, load_device, surroundings_of
from chainsim.effects.effects import Tone
from chainsim.effects.tones import two_tones
from encoders import (
    Frame,
    GridShape,
    Scene,
    TargetPattern,
    TextOptions,
    TextSource,
    encode_text,
    levels,
    plane_wave,
    walking_bars,
)
from planner import FramePlan, TradeoffError, plan_scene, require, seconds_words, trade_off

KEPT = Path(__file__).resolve().parent / "results" / "front.json"
SHAPE = GridShape(6, 6)
TOL = 1e-2
ORDERS, DEAREST = (1, 3, 5, 7), 9
HEART = ["011011", "111111", "111111", "011110", "001100", "000000"]


def shown(*patterns: TargetPattern, dwell_s: float) -> Scene:
    return Scene(SHAPE, tuple(Frame(pattern, dwell_s) for pattern in patterns))


def page() -> Scene:
    return encode_text(TextSource.of_text("Braille that is felt"), SHAPE, TextOptions(dwell_s=1.5))


def icon() -> TargetPattern:
    return levels(np.array([[float(dot) for dot in row] for row in HEART]))


WAVE = plane_wave(SHAPE, lag_deg=90, level=0.3)

SCENES: dict[str, tuple[str, Callable[[], Scene]]] = {
    "braille page": ("linked-6x6", page),
    "braille page, deflected": ("paper-6x6", page),
    "icon": ("linked-6x6", lambda: shown(icon(), dwell_s=2.0)),
    "wave": ("paper-6x6", lambda: shown(WAVE, dwell_s=8.0)),
    "walking bars": ("paper-6x6", lambda: shown(walking_bars(SHAPE, width=3, level=0.1), dwell_s=15.0)),
    "mixed": ("paper-6x6", lambda: shown(icon(), WAVE, dwell_s=12.0)),
}
"""Name -> device and scene."""


def measured(name: str) -> dict[str, Any]:
    """One scene: how long planning takes, what it requires, and the trade-off of its chains."""
    profile, make = SCENES[name]
    device = load_device(profile)
    began = time.perf_counter()
    frames = list(plan_scene(make(), device).frames)
    planned_s = time.perf_counter() - began
    began = time.perf_counter()
    required = require(frames, device, surroundings_of(device), tol=TOL)
    required_s = time.perf_counter() - began
    found: dict[str, Any] = {
        "device": profile, "frames": len(frames), "outcomes": sorted({frame.outcome.value for frame in frames}),
        "planned_s": planned_s, "required_s": required_s, "included": sorted(required.included),
        "rung": required.rung, "saved": 1 - required.work / required.work_of_all,
    }  # fmt: skip
    return found | _traded(frames, device)


def _traded(frames: list[FramePlan], device: Device) -> dict[str, Any]:
    try:
        traded = trade_off(frames, device)
    except TradeoffError:
        # Of the scenes here only the walking bars have no chain of one tone.
        return _beating(frames, device)
    rows = traded.as_dict()
    return {"front": [row for row in rows.pop("rows") if row["front"]]} | rows


def _beating(frames: list[FramePlan], device: Device) -> dict[str, Any]:
    """Quasi-periodic balance of ever more orders, for the two strongest tones of the first chain."""
    state = frames[0].states[0]
    every = [(state.omega, state.epsilon), *((tone.omega, tone.epsilon) for tone in state.tones)]
    strongest = sorted(every, key=lambda one: -abs(one[1]))[:2]
    one, other = (Tone(abs(epsilon), omega, float(np.angle(epsilon))) for omega, epsilon in strongest)
    tones = one, other
    setting = Setting.of(device.chain, epsilon=0.0, lam=state.lam, omega=1.0)
    truth = two_tones(device.chain, setting, tones, order=DEAREST)
    rows = []
    for order in ORDERS:
        began = time.perf_counter()
        found = two_tones(device.chain, setting, tones, order=order)
        seconds = time.perf_counter() - began
        away = max(float(np.abs(found.line(*k) - truth.line(*k)).max()) for k in ((1, 0), (0, 1)))
        error = away / float(np.abs(truth.line(1, 0)).max())
        rows.append(
            {"rung": f"two tones, order {order}", "error": error, "estimate": found.error_estimate, "seconds": seconds}
        )
    return {
        "front": rows,
        "states": 1,
        "reference": f"two tones, order {DEAREST}",
        "reference_error": truth.error_estimate,
    }


def lines(name: str, found: dict[str, Any], kept: dict[str, Any]) -> list[str]:
    out = [
        f"{name} on {found['device']}: planned in {seconds_words(found['planned_s'])}, requires {found['rung']} with "
        f"{', '.join(found['included']) or 'nothing'}; {100 * found['saved']:.0f} % of the work saved"
    ]
    before = {row["rung"]: row for row in kept.get("front", [])}
    for row in found["front"]:
        old = before.get(row["rung"])
        was = "" if old is None else f"  (kept: {old['error']:.1e} in {seconds_words(old['seconds'])})"
        out.append(f"  {row['rung']:18} {row['error']:.1e} in {seconds_words(row['seconds']):>8}{was}")
    return out


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--keep", action="store_true", help=f"write {KEPT.name}")
    parser.add_argument("--only", choices=SCENES, help="one scene")
    given = parser.parse_args()
    kept = json.loads(KEPT.read_text(encoding="utf-8")) if KEPT.exists() else {}
    found = {}
    with tempfile.TemporaryDirectory() as folder:
        # Nothing that an earlier run planned may be found.
        os.environ["DOTWAVE_CACHE"] = folder
        for name in [given.only] if given.only else SCENES:
            found[name] = measured(name)
            print("\n".join(lines(name, found[name], kept.get(name, {}))), flush=True)
    if given.keep:
        KEPT.parent.mkdir(parents=True, exist_ok=True)
        KEPT.write_text(json.dumps(kept | found, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
