"""Running text on grids that are not as their profile, page by page, as planned and corrected while it plays.

python benchmarks/closed_loop.py results/closed_loop.json [--plants 100] [--only dots,deflections,wave,fingertip]

Every plant goes through the whole of it: host, protocol, an emulated controller, the full equations under the samples
that go out, sensors. What is judged is the true motion in the time a page stands, not what sensors say of it.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chainsim import Device, load_device
from drivers import (
    ControllerSpec,
    FeltGrid,
    GateLimits,
    HostSession,
    Manifest,
    PlantFile,
    Timing,
    VirtualController,
    channels_of,
    plan_messages,
)
from drivers.protocol.felt import GridMotion
from drivers.protocol.measured import Measure, turns_of
from drivers.protocol.metering import Meter
from drivers.protocol.plant import Sensors, TruePlant
from drivers.protocol.playout import OutputBlock
from drivers.sinks.controller import LEAD_S
from encoders import Frame, GridShape, Scene, TargetPattern, TextOptions, TextSource, encode_text
from planner import (
    DEFAULT_CONTRAST_DB,
    Adaptation,
    FramePlan,
    Measured,
    Plan,
    SensorNoise,
    choose_pages,
    plan_scene,
)

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

TEXT = "the quick brown fox jumps over a lazy dog and runs on until night"
PAGES = (1, 2, 3, 5, 10)
SENSOR = 0.002
# How long each of the pages stands that tell most of a device.
LEAD_IN_S = 2.0
LINKED = {
    "hysteresis": {"kind": "play", "radius": [2.0e-4, 1.0e-3], "weight": [0.02, 0.02], "base": 0.96},
    "creep": {"per_decade": 0.01, "first": 84, "last": 8.36e5},
    "warming": {"stiffness": -0.002, "time_s": 300},
    "sensors": {"noise": SENSOR, "cross_talk": 0.0},
}
STEP_S = 0.005


class Seen:
    """The true motion of a plant, felt over the standing time of every page."""

    def __init__(self, device: Device, frames: Sequence[FramePlan], motion: GridMotion) -> None:
        self._motion, rate = motion, device.amplifier.rate_hz
        self._meter = Meter(device.rows, device.cols, self, tapered=False)
        self.felt: dict[int, Measured] = {}
        self._z: Floats = np.zeros(0)
        for number, frame in enumerate(frames):
            at, stop = round(frame.settled_s * rate), round(frame.end_s * rate)
            omega = next((state.omega for state in frame.states if state.moving), 0.0)
            turns = turns_of(omega, device.tau_per_s / rate) if omega else 0
            self._meter.ask(Measure(at, stop - at, number, (turns,) * device.rows))

    def move(self, block: OutputBlock) -> Floats:
        """As `GridMotion`."""
        self._z = self._motion.move(block)
        self._meter.take(block)
        self.felt |= {one.frame: one for one in self._meter.finished()}
        return self._z

    def sense(self, block: OutputBlock) -> Floats:
        """What moved."""
        return self._z

    def read(self, measured: Measured) -> Measured:
        """Without noise."""
        return measured


@dataclass(frozen=True)
class Shown:
    """A plan to be shown, with its frames planned once."""

    device: Device
    plan: Plan
    frames: list[FramePlan]
    samples: int
    first: int = 0

    @classmethod
    def of(cls, device: Device, scene: Scene, first: int = 0) -> Shown:
        """Plan it; pages before the `first` are not judged."""
        frames = list(plan_scene(scene, device).frames)
        pages = [frame for frame in frames if frame.frame is not None]
        samples = round(frames[-1].end_s * device.amplifier.rate_hz)
        return cls(device, Plan(device, frames, scene.encoding), pages, samples, first)

    def manifest(self) -> Manifest:
        """As a written waveform would have it, but for what a line does not need."""
        device = self.device
        return Manifest(
            "", device.amplifier.rate_hz, self.samples, "", device, channels_of(device), (), (), self.plan.encoding
        )

    def on(self, plant: PlantFile, adaptation: Adaptation | None) -> tuple[dict[int, Measured], float]:
        """Show it on a plant: what is felt of every page, and the largest volts."""
        device, manifest = self.device, self.manifest()
        rate = manifest.rate_hz
        seen = Seen(device, self.frames, TruePlant(plant, device, rate))
        sensors, peak = Sensors(plant, device, FeltGrid(device, rate, seen)), [0.0]

        def out(block: OutputBlock) -> None:
            peak[0] = max(peak[0], float(np.abs(block.volts).max()))

        controller = VirtualController(ControllerSpec.of(device), now=0.0, senses=sensors, on_output=out)
        frames = self.plan.frames if adaptation is None else adaptation.adapted(self.plan).frames
        limits = GateLimits.of(device, len(manifest.channels))
        session = HostSession(
            lambda found: plan_messages(manifest, frames, found, session=7, prefill_s=LEAD_S / 2, limits=limits),
            session=7, timing=Timing(lead_s=LEAD_S), on_measured=None if adaptation is None else adaptation.learned,
        )  # fmt: skip
        session.connected()
        now = 0.0
        while not session.finished:
            now += STEP_S
            controller.receive(session.poll(now), now)
            session.receive(controller.outgoing(), now)
        assert session.report.underruns == 0
        return seen.felt, peak[0]


def running_text(device: Device, pages: int, *, led_in: bool = False) -> Shown:
    """Pages of running text; `led_in` by those that tell most of the device, as `dotwave tune` chooses them."""
    scene = encode_text(TextSource.of_text(TEXT), GridShape(device.rows, device.cols), TextOptions())
    before: list[Frame] = []
    if led_in:
        noise = SensorNoise(0.01, SENSOR * device.full_scale)
        levels = choose_pages(device, noise, 0.02, contrast_db=DEFAULT_CONTRAST_DB).levels
        whole = (np.tile(one, (device.rows, device.chains_per_row)).astype(np.complex128) for one in levels)
        before = [Frame(TargetPattern(one), LEAD_IN_S) for one in whole]
    frames = [*before, *list(scene.frames)[:pages]]
    return Shown.of(device, Scene(scene.shape, frames, scene.encoding), len(before))


def waves(device: Device, pages: int, phase: float, dwell_s: float) -> Shown:
    """The same wave for many pages."""
    one = np.tile(np.exp(-1j * phase * np.arange(device.cols)), (device.rows, 1))
    frame = Frame(TargetPattern(one, phase_matters=True), dwell_s)
    return Shown.of(device, Scene(GridShape(device.rows, device.cols), (frame,) * pages))


def judged(shown: Shown, felt: dict[int, Measured]) -> tuple[list[bool], list[float]]:
    """Of every page whether its wish is felt, and its error: root mean square of all actuators, of full scale."""
    device, ok, errors = shown.device, [], []
    for number, frame in list(enumerate(shown.frames))[shown.first :]:
        seen, wish = felt[number], frame.wish
        assert wish is not None
        moving = any(state.moving for state in frame.states)
        felt_as = np.abs(seen.harmonic) if moving else seen.mean
        level = (felt_as / device.full_scale).reshape(device.rows, device.cols)
        ok.append(bool(wish.verdict(level).ok))
        target = np.concatenate([state.target for state in frame.states]).reshape(level.shape)
        off = level - target
        if any(state.phase is not None for state in frame.states):
            off = np.abs(_wave(frame, seen, device))
        errors.append(float(np.sqrt(np.mean(off**2))))
    return ok, errors


def _wave(frame: FramePlan, seen: Measured, device: Device) -> Complexes:
    """Deviations of a wave whose rows may be shifted alike, of full scale."""
    wanted = np.concatenate(
        [s.target * np.exp(1j * np.nan_to_num(0.0 if s.phase is None else s.phase)) for s in frame.states]
    )
    real = seen.harmonic / device.full_scale
    turn = np.exp(1j * np.angle(np.vdot(wanted, real)))
    return np.asarray(real - wanted * turn)


def compared(
    ways: dict[str, Shown], plant: Callable[[int], dict[str, Any]], plants: int, told: Callable[[str], None]
) -> dict[str, Any]:
    """Many plants, `planned` without correction, and every other way with it."""
    found: dict[str, Any] = {"plants": plants}
    for name, shown in ways.items():
        adapts = name != "planned"
        ok, errors, peaks = [], [], []
        began = time.perf_counter()
        for seed in range(plants):
            adaptation = Adaptation(shown.device, noise=SENSOR) if adapts else None
            felt, peak = shown.on(PlantFile.model_validate(plant(seed)), adaptation)
            one, off = judged(shown, felt)
            ok.append(one)
            errors.append(off)
            peaks.append(peak)
            told(f"{name} {seed + 1}/{plants}, {(time.perf_counter() - began) / (seed + 1):.1f} s each")
        pages = [page for page in PAGES if page <= len(ok[0])]
        found[name] = {
            "pages": pages,
            "ok": [float(np.mean([one[page - 1] for one in ok])) for page in pages],
            "error": [float(np.median([one[page - 1] for one in errors])) for page in pages],
            "worst": [float(np.max([one[page - 1] for one in errors])) for page in pages],
            "within_2": [float(np.mean([one[page - 1] <= 0.02 for one in errors])) for page in pages],
            "peak_volts": float(max(peaks)),
        }
    return found


def dots(spread: float, plants: int, told: Callable[[str], None], pages: int = 10) -> dict[str, Any]:
    """Text on linked-6x6 whose natural frequencies are off by so much."""
    off = {"frequency": spread, "damping": 0.05, "lam": 0.02, "force": 0.03}
    device = load_device("linked-6x6")
    plain = running_text(device, pages)
    ways = {"planned": plain, "adapted": plain, "led_in": running_text(device, pages, led_in=True)}
    return compared(ways, lambda seed: LINKED | {"seed": seed, "spread": off}, plants, told)


def paper(spread: float, warming: float) -> Callable[[int], dict[str, Any]]:
    """Plants of paper-6x6 with a loop of about 10 % at full scale and 2 % of creep a decade."""

    def plant(seed: int) -> dict[str, Any]:
        return {
            "seed": seed,
            "spread": {"frequency": spread, "damping": 0.05, "lam": 0.0, "force": 0.03 if warming else 0.01},
            "hysteresis": {"kind": "play", "radius": [0.002, 0.006, 0.014], "weight": [0.03, 0.03, 0.04], "base": 0.9},
            "creep": {"per_decade": 0.02, "first": 84, "last": 8.36e5},
            "warming": {"stiffness": warming, "time_s": 300},
            "sensors": {"noise": SENSOR, "cross_talk": 0.0},
        }

    return plant


def deflections(plants: int, told: Callable[[str], None]) -> dict[str, Any]:
    """Text held by biases on paper-6x6."""
    shown = running_text(load_device("paper-6x6"), 10)
    return compared({"planned": shown, "adapted": shown}, paper(0.01, -0.002), plants, told)


def wave(plants: int, told: Callable[[str], None]) -> dict[str, Any]:
    """A wave of 90 degrees on paper-6x6, shown five times."""
    shown = waves(load_device("paper-6x6"), 5, np.pi / 2, 8.0)
    return compared({"planned": shown, "adapted": shown}, paper(0.0002, 0.0), plants, told)


def fingertip(plants: int, told: Callable[[str], None]) -> dict[str, Any]:
    """A finger on two actuators from the fourth page to the seventh, on a grid with 1 % spread."""
    off = {"frequency": 0.01, "damping": 0.05, "lam": 0.02, "force": 0.03}
    touch = {"from_s": 3.1, "to_s": 6.1, "stiffness": 0.01, "damping": 0.003}
    fingers = [{"row": 0, "col": 1} | touch, {"row": 1, "col": 1} | touch]
    device = load_device("linked-6x6")
    shown = running_text(device, 10)
    found = compared(
        {"planned": shown, "adapted": shown},
        lambda seed: LINKED | {"seed": seed, "spread": off, "fingertips": fingers},
        plants,
        told,
    )
    return found | {"amplifier_volts": device.amplifier.volts}


RUNS: dict[str, Callable[[int, Callable[[str], None]], dict[str, Any]]] = {
    "dots_1": lambda plants, told: dots(0.01, plants, told),
    "dots_3": lambda plants, told: dots(0.03, plants, told),
    "deflections": deflections,
    "wave": wave,
    "fingertip": fingertip,
}


WAYS = {"planned": "as planned", "adapted": "`--adapt`", "led_in": "`--adapt`, after three pages of 2 s"}


def table(kept: dict[str, Any]) -> str:
    """What was measured, as the table of docs/playing.md."""
    lines = ["| grid | plants | way | " + " | ".join(f"page {page}" for page in PAGES) + " | peak |"]
    lines.append("|---" * (len(PAGES) + 4) + "|")
    for name, found in kept.items():
        for way, words in WAYS.items():
            if way not in found:
                continue
            one = found[way]
            cells = [f"{ok:.0%}, {error:.1%}" for ok, error in zip(one["ok"], one["error"], strict=True)]
            cells += ["-"] * (len(PAGES) - len(cells))
            row = (name, str(found["plants"]), words, *cells, f"{one['peak_volts']:.0f} V")
            lines.append(f"| {' | '.join(row)} |")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--plants", type=int, default=100)
    parser.add_argument("--only", default=",".join(RUNS))
    given = parser.parse_args()
    kept = json.loads(given.out.read_text(encoding="utf-8")) if given.out.exists() else {}
    for name in given.only.split(","):
        kept[name] = RUNS[name](given.plants, partial(print, name, flush=True))
        given.out.write_text(json.dumps(kept, indent=1) + "\n", encoding="utf-8")
    print(table(kept))


if __name__ == "__main__":
    main()
