"""Must-show 1: random targets of all kinds on all profiles, planned, written, and proven through the file."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np
import pytest

from chainsim import Device, Outcome, load_device
from dotwave.verification import verify
from drivers import write_waveform
from encoders import (
    Frame,
    GridShape,
    Region,
    Scene,
    TargetPattern,
    bars,
    levels,
    plane_wave,
    regions,
    walking_bars,
)  # fmt: skip
from planner import DwellTooShort, FramePlan, Plan, plan_scene
from planner.closed_forms.wave_fit import response_to
from planner.waves.wave_forms import wave_for

NAMES = ["paper-6x6", "paper-6x6-common", "linked-6x6", "independent-6x6", "linked-ultrasonic-6x6", "paper-6x6-ring"]
GRID = GridShape(6, 6)
# Relative to full scale; tones are only known in the slow flow.
EXACT, TONES = 1e-3, 1e-2
Make = Callable[[np.random.Generator, Device], TargetPattern]


def a_wave(rng: np.random.Generator, device: Device) -> TargetPattern:
    row_lag = 0.0 if device.drive == "device" else rng.uniform(-180, 180)
    return plane_wave(GRID, lag_deg=rng.uniform(5, 175), row_lag_deg=row_lag, level=rng.uniform(0.05, 1))


def a_wave_back(rng: np.random.Generator, device: Device) -> TargetPattern:
    return plane_wave(GRID, lag_deg=-rng.uniform(5, 175), level=rng.uniform(0.05, 1))


def dots(rng: np.random.Generator, device: Device) -> TargetPattern:
    return TargetPattern(rng.integers(0, 2, (6, 6)).astype(np.complex128))


def a_map(rng: np.random.Generator, device: Device) -> TargetPattern:
    return levels(rng.integers(0, 5, (6, 6)) / 4)


def lying(rng: np.random.Generator, device: Device) -> TargetPattern:
    return bars(GRID, vertical=False, width=int(rng.integers(1, 3)), gap=1, level=rng.uniform(0.3, 1))


def upright(rng: np.random.Generator, device: Device) -> TargetPattern:
    return bars(GRID, vertical=True, width=int(rng.integers(1, 3)), gap=int(rng.integers(1, 3)))


def walking(rng: np.random.Generator, device: Device) -> TargetPattern:
    return walking_bars(GRID, width=rng.uniform(1.3, 3), level=rng.uniform(0.05, 0.6))


def side_by_side(rng: np.random.Generator, device: Device) -> TargetPattern:
    cut = int(rng.integers(1, 6))
    first = plane_wave(GRID, lag_deg=rng.uniform(30, 150), level=rng.uniform(0.05, 0.6))
    other = plane_wave(GRID, lag_deg=rng.uniform(30, 150), level=rng.uniform(0.05, 0.6))
    below = other if rng.integers(2) else dots(rng, device)
    return regions(GRID, [Region(0, cut, 0, 6, first), Region(cut, 6, 0, 6, below)])


KINDS: list[Make] = [a_wave, a_wave, a_wave, a_wave_back, dots, a_map, lying, upright, walking, side_by_side]


@dataclass(frozen=True)
class Trial:
    """One random target on one device."""

    device: Device
    kind: Make
    pattern: TargetPattern

    def plans(self) -> list[FramePlan]:
        """Shown for two seconds, or where that is too short, longer: some rings take minutes."""
        for dwell_s in (2.0, 25.0, 100.0):
            try:
                return self._shown(dwell_s * self.shorter)
            except DwellTooShort:
                continue
        return self._shown(400.0 * self.shorter)

    def _shown(self, dwell_s: float) -> list[FramePlan]:
        # Bars that walk slowly take long to be told apart.
        dwell_s = max(dwell_s, 25.0 * self.shorter) if self.pattern.walking is not None else dwell_s
        return list(plan_scene(Scene(GRID, [Frame(self.pattern, dwell_s)]), self.device).frames)

    @property
    def shorter(self) -> float:
        """How much quicker than the paper's device this one is."""
        return 133.0 / self.device.f0_hz

    @property
    def reachable(self) -> bool:
        """Whether a closed form alone says that the device makes this pattern."""
        if self.kind is not a_wave or self.device.coupling.closure != "open":
            return False
        if self.device.chain_length == 1:
            return True
        device, row = self.device, self.pattern.amplitude[0] * self.device.full_scale
        lag = float(-np.angle(row[1] / row[0]))
        wave = wave_for(device.chain, amplitude=abs(row[0]), lag=lag)
        inside = device.coupling.lam.min <= wave.lam[0] <= device.coupling.lam.max
        inside &= device.omega.min <= wave.omega <= device.omega.max
        held = response_to(device.chain, wave, row)
        away = np.abs(held.phasor[0] * np.exp(1j * np.angle(row[0])) - row).max() / abs(row[0])
        return bool(inside and held.outcome[0] is Outcome.OK and held.stable[0] and away < EXACT)


def trials(count: int, seed: int) -> Iterator[Trial]:
    rng = np.random.default_rng(seed)
    for _ in range(count):
        device, kind = load_device(str(rng.choice(NAMES))), KINDS[rng.integers(len(KINDS))]
        yield Trial(device, kind, kind(rng, device))


def check(trial: Trial, folder: Path) -> str:
    """What became of it: ok (and proven), or unreachable with a nearest pattern and what is lacking."""
    plans = trial.plans()
    shown = plans[0]
    assert shown.outcome in (Outcome.OK, Outcome.UNREACHABLE)
    if shown.outcome is Outcome.UNREACHABLE:
        assert shown.note.startswith(trial.device.name)
        assert all(np.all(np.isfinite(state.phasor)) and np.isfinite(state.error) for state in shown.states)
        return "unreachable"
    # Not a WAV: rows of six equal dots magnify the rounding to float32 to 0.1 % of full scale.
    path = folder / "shown.npz"
    write_waveform(Plan(trial.device, plans, {}), path)
    (felt,) = verify(path).frames
    limit = TONES if trial.pattern.walking is not None else EXACT
    # Dots and levels on links idle at a floor the plan chose, and that is the target in the file.
    assert felt.amplitude_error <= limit, (trial, felt.amplitude_error)
    return "ok"


def run(some: Iterator[Trial], folder: Path) -> Counter[tuple[str, str, str, bool]]:
    found: Counter[tuple[str, str, str, bool]] = Counter()
    for trial in some:
        found[trial.device.name, trial.kind.__name__, check(trial, folder), trial.reachable] += 1
    return found


def missed(found: Counter[tuple[str, str, str, bool]]) -> tuple[int, int]:
    """How many the closed forms reach, and how many of them were not planned."""
    reached = {key: number for key, number in found.items() if key[3]}
    return sum(reached.values()), sum(number for key, number in reached.items() if key[2] != "ok")


@pytest.mark.parametrize(("number", "reached"), [(3, 1), pytest.param(40, 5, marks=pytest.mark.slow)])
def test_random_targets(number: int, reached: int, tmp_path: Path) -> None:
    total, lost = missed(run(trials(number, 1), tmp_path))
    assert total >= reached
    assert lost == 0


@pytest.mark.slow
@pytest.mark.parametrize("quarter", range(4))
def test_a_thousand_random_targets(quarter: int, tmp_path: Path) -> None:
    some = islice(trials(1000, 2), 250 * quarter, 250 * (quarter + 1))
    total, lost = missed(run(some, tmp_path))
    assert total >= 25
    assert lost == 0
