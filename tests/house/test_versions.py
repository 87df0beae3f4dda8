"""What is kept from run to run is kept under versions: whoever changes the numbers has to change the version.

``python tests/house/test_versions.py`` writes the numbers of today into ``data/versions.json``.
"""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from chainsim import load_device
from drivers import WAVEFORMS_VERSION, read_waveform, write_waveform
from encoders import (
    PICTURES_VERSION,
    Frame,
    GridShape,
    PictureOptions,
    Scene,
    TargetPattern,
    encode_picture,
    plane_wave,
)
from planner import PLANS_VERSION, Plan, plan_scene

KEPT = Path(__file__).parents[1] / "data" / "versions.json"
COMMAND = "python tests/house/test_versions.py"
# Another machine rounds otherwise, and an iteration then ends elsewhere within its tolerance.
TOLERANCE = 1e-6
DOTS = np.array([[1, 0, 1, 1, 0, 0], [0, 1, 1, 0, 0, 1], [0, 0, 0, 1, 1, 0]] * 2, dtype=complex)


def summed(values: Any) -> list[float]:
    """A few numbers that change when any of `values` does."""
    flat = np.atleast_1d(np.asarray(values, dtype=complex)).ravel()
    flat = np.nan_to_num(np.concatenate([flat.real, flat.imag]))
    weights = 1 + np.modf(np.sqrt(2) * np.arange(1, flat.size + 1))[0]
    return [float(flat.size), float(flat @ weights), float(np.abs(flat) @ weights)]


def plan_of(name: str, *targets: TargetPattern) -> Plan:
    frames = tuple(Frame(target, 0.8) for target in targets)
    return plan_scene(Scene(GridShape(6, 6), frames, {}), load_device(name))


def dots_and_back(name: str) -> Plan:
    return plan_of(name, TargetPattern(DOTS), TargetPattern(DOTS[::-1]))


def plans() -> Iterator[list[float]]:
    """Of the ways of planning that are quick: deflections, amplitudes on links, single actuators, a wave."""
    wave = plan_of("linked-6x6", plane_wave(GridShape(6, 6), lag_deg=60))
    for plan in (*map(dots_and_back, ("paper-6x6", "linked-6x6", "independent-6x6")), wave):
        for frame in plan.frames:
            yield summed([frame.start_s, frame.settled_s, frame.end_s])
            for state in frame.states:
                for part in (state.epsilon, state.lam, state.bias, state.omega, state.phasor, state.mean, state.error):
                    yield summed(part)
            for ramp in filter(None, frame.ramps):
                for curve in (ramp.t_s, ramp.epsilon, ramp.bias, ramp.lam):
                    yield summed(0.0 if curve is None else curve)


def pictures() -> Iterator[list[float]]:
    from PIL import Image

    y, x = np.mgrid[-1:1:96j, -1:1:96j]
    for grey in (np.hypot(x, y) < 0.7, (x + y + 2) / 4 + 0.2 * np.sin(9 * x)):
        data = BytesIO()
        Image.fromarray(np.uint8(255 * np.clip(grey, 0, 1))).save(data, "PNG")
        report = encode_picture(data.getvalue(), GridShape(6, 6), PictureOptions(candidates=4)).report
        for frame in report.frames:
            yield summed(frame.figure)
            for one in frame.candidates:
                yield summed([one.similarity, *one.dots.ravel()])


def waveforms() -> Iterator[list[float]]:
    with tempfile.TemporaryDirectory() as folder:
        for name in ("paper-6x6", "linked-6x6"):
            manifest, reader = read_waveform(
                write_waveform(dots_and_back(name), Path(folder, f"{name}.wav")).samples_path
            )
            for block in reader.blocks(4096):
                yield summed(block)
            text = Path(folder, f"{name}.json").read_text()
            yield summed([len(manifest.frames), *map(ord, " ".join(sorted(json.loads(text))))])


@dataclass(frozen=True)
class Versioned:
    """Numbers that a version stands for."""

    constant: str
    version: int
    numbers: Callable[[], Iterator[list[float]]]


ALL = {
    "plans": Versioned("planner.PLANS_VERSION", PLANS_VERSION, plans),
    "pictures": Versioned("encoders.PICTURES_VERSION", PICTURES_VERSION, pictures),
    "waveforms": Versioned("drivers.WAVEFORMS_VERSION", WAVEFORMS_VERSION, waveforms),
}


def complaint(kept: dict[str, Any], what: Versioned, numbers: list[list[float]]) -> str:
    """What has to be done, empty when all is as it was kept."""
    if kept["version"] != what.version:
        return f"{what.constant} is new: keep its numbers with `{COMMAND}`"
    same = len(kept["numbers"]) == len(numbers) and np.allclose(kept["numbers"], numbers, TOLERANCE, TOLERANCE)
    return "" if same else f"numbers have changed: add one to {what.constant}, then run `{COMMAND}`"


@pytest.mark.parametrize("name", ALL)
def test_other_numbers_have_another_version(name: str) -> None:
    what = ALL[name]
    wrong = complaint(json.loads(KEPT.read_text())[name], what, list(what.numbers()))
    assert not wrong, wrong


def test_a_change_is_noticed() -> None:
    kept = json.loads(KEPT.read_text())["plans"]
    numbers = [list(row) for row in kept["numbers"]]
    what = Versioned("planner.PLANS_VERSION", kept["version"], plans)
    assert complaint(kept, what, numbers) == ""
    numbers[7][1] += 1e-3
    assert "add one to planner.PLANS_VERSION, then run `python tests/" in complaint(kept, what, numbers)
    assert "is new" in complaint(kept, Versioned("planner.PLANS_VERSION", kept["version"] + 1, plans), numbers)


def renew() -> None:
    kept = {
        name: {"version": what.version, "numbers": [[float(f"{n:.9g}") for n in row] for row in what.numbers()]}
        for name, what in ALL.items()
    }
    rows = ",\n".join(f"{json.dumps(name)}: {json.dumps(what)}" for name, what in kept.items())
    KEPT.write_text("{\n" + rows.replace("], [", "],\n[") + "\n}\n")


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as cache:
        os.environ["DOTWAVE_CACHE"] = cache
        renew()
