"""Frames under the device's spread: judged once, by draws of their place, and aimed where the error is least."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from chainsim import Device, Outcome, load_device
from chainsim.model.calibrated import ActuatorSpread
from encoders import Frame, GridShape, Scene, TargetPattern
from planner import FramePlan, FrameWish, Plan, plan_scene
from planner.amplitudes.band import choose_band
from planner.amplitudes.vibration import Vibration
from planner.closed_forms.links import drive_for, links_for
from planner.memory import Memory
from planner.operating_point import OperatingPoint
from planner.outlook import FrameSpread
from planner.robustness import expected as expected_module
from planner.robustness.expected import WANTED, Expectation
from planner.robustness.robust_aim import aim_for
from planner.robustness.robust_search import RobustSearch, Trial
from planner.robustness.spread import (
    THRESHOLD,
    TOLERANCE,
    FrameTarget,
    RelativeSpread,
    drawn_in,
    frame_target,
    judge,
    motion_of,
)
from planner.targets import WalkingTarget
from planner.waves.walking import walking_state

Floats = NDArray[np.float64]

PAPER, LINKED, SINGLE = (load_device(name) for name in ("paper-6x6", "linked-6x6", "independent-6x6"))
PROFILE = np.array([1, 1, 0.1, 0.1, 1, 1.0])


@pytest.fixture(autouse=True)
def _cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DOTWAVE_CACHE", str(tmp_path))


def spread(device: Device, frequency: float = 0.01, **others: Any) -> Device:
    return device.model_copy(update={"spread": ActuatorSpread(frequency=frequency), **others})


def planned(device: Device, *patterns: Any, dwell_s: float = 1.0) -> list[FramePlan]:
    frames = [Frame(TargetPattern(np.asarray(one, dtype=np.complex128)), dwell_s) for one in patterns]
    return list(plan_scene(Scene(GridShape(device.rows, device.cols), frames), device).frames)


def of(frame: FramePlan) -> FrameSpread:
    assert frame.outcome is Outcome.OK, frame.note
    assert frame.spread is not None
    return frame.spread


DOTS = np.random.default_rng(3).integers(0, 2, (6, 6))
WISH = FrameWish(DOTS.astype(np.float64))
LEVELS = np.where(DOTS > 0, 1.0, 0.5)


@pytest.mark.parametrize("device", [PAPER, LINKED, SINGLE], ids=lambda device: device.name)
def test_every_frame_is_judged_and_the_way_out_is_not(device: Device) -> None:
    frames = planned(spread(device), DOTS, np.zeros((6, 6)), 1 - DOTS)
    for frame in (frames[0], frames[2]):
        found = of(frame)
        assert 0 < found.median <= found.quantile_90
        assert found.yield_ >= WANTED
        assert found.dots_right > 0.95
    assert frames[-1].frame is None
    assert frames[-1].spread is None
    assert all(frame.spread is None for frame in planned(device, DOTS))


def test_a_deflection_has_its_quantile_in_closed_form() -> None:
    """One actuator under a constant force: the median of |1/(1 + 0.01 x)^2 - 1| is 0.0135 to first order."""
    one = PAPER.model_copy(update={"rows": 1, "cols": 1, "chain_length": 1, "beta": -1e-9})
    found = of(planned(spread(one), [[1.0]])[0])
    assert found.median == pytest.approx(2 * 0.01 * 0.6745, rel=0.08)
    assert found.expected == pytest.approx(2 * 0.01 * np.sqrt(2 / np.pi), rel=0.08)
    assert found.yield_ == 1.0
    assert found.needed == 1.0
    assert found.aim == 0.0


def test_a_frame_is_as_good_as_its_rows_drawn_together() -> None:
    """Row by row and kept, or all at once: the same draws, the same answer, of dots and of levels."""
    device = spread(LINKED)
    for pattern in (DOTS.astype(np.float64), LEVELS):
        frame = planned(device, pattern)[0]
        memory = Memory(device, 20.0)
        held = memory.hold(TargetPattern(pattern.astype(np.complex128)), memory.at_rest)
        there = [replace(state, target=one.levels) for one, state in zip(held, frame.states, strict=True)]
        motion = motion_of(there, drawn_in(device, RelativeSpread(f0=0.01), range(6), count=1000, seed=0))
        report = judge(frame_target(device, there), motion, tolerance=TOLERANCE, threshold=THRESHOLD)
        assert of(frame).expected == pytest.approx(report.expected, rel=1e-6)
        felt = np.abs(motion.phasor).transpose(2, 1, 0) / device.full_scale
        share = report.yield_ if pattern is LEVELS else FrameWish(pattern).verdict(felt).share
        assert of(frame).yield_ == pytest.approx(share, abs=2e-3)


def test_known_rows_are_not_judged_again(monkeypatch: pytest.MonkeyPatch) -> None:
    counted = 0

    def counting(*arguments: Any, **named: Any) -> Any:
        nonlocal counted
        counted += 1
        return drawn_in(*arguments, **named)

    monkeypatch.setattr(expected_module, "FACTORS", np.ones(1))

    monkeypatch.setattr(expected_module, "drawn_in", counting)
    device = spread(PAPER)
    memory, expectation = Memory(device, 20.0), Expectation(device)
    held = memory.hold(TargetPattern(DOTS.astype(np.complex128)), memory.at_rest)
    states = memory.states(held)
    first = expectation.of(held, states, WISH)
    busy = sum(bool(state.bias.any()) for state in states)
    assert counted == busy
    assert expectation.of(held, states, WISH) is first
    other = [held[1], *held[1:]]
    expectation.of(other, [states[1], *states[1:]], WISH)
    assert counted == busy + 1


@pytest.mark.slow
def test_the_accuracy_needed_is_enough_and_twice_of_it_is_not() -> None:
    for pattern in (DOTS, LEVELS):
        needed = of(planned(spread(LINKED, 0.02), pattern)[0]).needed
        assert 0.2 < needed < 0.9
        # Planned anew it may aim a little worse or better at this yield.
        assert of(planned(spread(LINKED, 0.02 * needed * 0.9), pattern)[0]).yield_ >= WANTED
        assert of(planned(spread(LINKED, min(0.02, 0.04 * needed)), pattern)[0]).yield_ < WANTED


def test_a_wave_over_weak_links_is_told_what_it_needs() -> None:
    wave = 0.1 * np.exp(-0.5j * np.pi * np.arange(6))[None].repeat(6, axis=0)
    device = spread(PAPER, 0.01)
    memory = Memory(device, 20.0)
    held = memory.hold(TargetPattern(wave, phase_matters=True), memory.at_rest)
    states = memory.states(held)
    assert all(state.outcome is Outcome.OK for state in states)
    found = Expectation(device).of(held, states, FrameWish(np.abs(wave)))
    assert found is not None
    assert found.expected > 0.05
    # Levels of 0.1 are within 0.2 of anything below 0.3: what is needed is loose.
    assert 0.005 < found.needed <= 1
    tight = Expectation(spread(PAPER, 1e-5)).of(held, states, FrameWish(np.abs(wave)))
    assert tight is not None
    assert tight.expected < 0.01 * found.expected * 2


def test_bars_that_walk_are_judged_tone_by_tone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(expected_module, "DRAWS", 60)
    device = spread(PAPER, 1e-3)
    n = 6
    target = WalkingTarget((0.1,) * n, weight=(1.0,) * n, width=2.0)
    state = walking_state(device, target)
    assert state.outcome is Outcome.OK, state.lacking
    held, wish = [target] * 6, FrameWish(np.full((6, 6), 0.1))
    loose, tight = (Expectation(spread(PAPER, s)).of(held, [state] * 6, wish) for s in (1e-3, 1e-6))
    assert loose is not None
    assert tight is not None
    assert tight.expected < 2e-3
    assert tight.yield_ == 1.0
    assert loose.expected > 20 * tight.expected


def settings(device: Device, amplitude: Floats, omega: float) -> OperatingPoint:
    chain = device.chain
    return OperatingPoint(float(drive_for(chain, amplitude[:1], omega)[0]), links_for(chain, amplitude, omega), omega)


def test_the_worst_of_several_copies_is_what_it_says() -> None:
    device = spread(LINKED).alone(0)
    trial = Trial(
        device.chain, FrameTarget(PROFILE[None] + 0j, 0.05), RelativeSpread(f0=0.01), TOLERANCE, THRESHOLD, 10, 0
    )
    errors = np.random.default_rng(0).exponential(size=500)
    assert RobustSearch(device, trial, trial.spread).worst_of(errors) == pytest.approx(errors.mean())
    drawn = np.random.default_rng(1).choice(errors, (200_000, 4)).max(axis=1)
    assert RobustSearch(device, trial, trial.spread, 4).worst_of(errors) == pytest.approx(drawn.mean(), rel=0.01)


@pytest.mark.parametrize("seed", range(3))
def test_an_aim_is_never_worse_than_the_wish_on_fresh_draws(seed: int) -> None:
    device, omega = spread(LINKED).alone(0), 1.35
    target = np.random.default_rng(seed).choice([0.1, 1.0], 6)
    aim = aim_for(device, target, omega, 1)
    trial = Trial(
        device.chain,
        FrameTarget(target[None] + 0j, 0.05),
        RelativeSpread(f0=0.01),
        TOLERANCE,
        THRESHOLD,
        2000,
        99 + seed,
    )
    search = RobustSearch(device, trial, trial.spread)
    wished, aimed = (search.row(settings(device, one * 0.05, omega)).report.expected for one in (target, aim))
    assert aimed <= wished * 1.01


@pytest.mark.parametrize("omega", [1.05, 1.15, 1.35])
def test_an_aim_has_the_dots_of_the_wish(omega: float) -> None:
    device, rng = spread(LINKED, 0.02).alone(0), np.random.default_rng(2)
    for _ in range(4):
        target = rng.choice([0.1, 1.0], 6)
        np.testing.assert_array_equal(aim_for(device, target, omega, 6) >= THRESHOLD, target >= THRESHOLD)


def test_without_spread_the_aim_is_the_wish() -> None:
    device = spread(LINKED, 0.0).alone(0)
    np.testing.assert_allclose(aim_for(device, PROFILE, 1.35, 6), PROFILE, atol=1e-4)


@pytest.mark.parametrize("bits", [6, 9])
def test_links_with_bits_are_links_that_can_be_set(bits: int) -> None:
    coupling = LINKED.coupling.model_copy(update={"bits": bits})
    device = spread(LINKED, 1e-3, coupling=coupling)
    state = Vibration(device, 20.0).states(PROFILE[None])[0]
    assert state.outcome is Outcome.OK
    steps = state.lam / coupling.lam_step
    np.testing.assert_allclose(steps, np.rint(steps), atol=1e-6)
    # What rounding costs is in what it aims at: at most some steps over the smallest link.
    assert 0 < np.abs(state.target - PROFILE).max() < 3 * coupling.lam_step / state.lam.min()


def test_the_steps_of_a_converter_are_part_of_the_error() -> None:
    amplifier = LINKED.amplifier.model_copy(update={"bits": 16})
    clean, coarse = (
        of(planned(spread(LINKED, 1e-3, amplifier=one), LEVELS)[0]) for one in (LINKED.amplifier, amplifier)
    )
    assert 1.02 * clean.expected < coarse.expected < clean.expected + 0.2


def test_single_actuators_are_driven_where_they_differ_least() -> None:
    """Below resonance there is more room on this device, and the same volts."""
    omega = SINGLE.omega.model_copy(update={"min": 0.5, "max": 1.08})
    device = SINGLE.model_copy(update={"omega": omega})
    assert choose_band(device, 20.0).omega == 1.08
    band = choose_band(spread(device), 20.0)
    assert not band.lacking
    assert band.omega < 0.7
    above = SINGLE.model_copy(update={"omega": omega.model_copy(update={"min": 1.07})})
    errors = [of(planned(spread(one), LEVELS)[0]).expected for one in (device, above)]
    assert errors[0] < errors[1] / 2


def test_the_same_plan_every_time() -> None:
    plans: list[Plan] = [
        plan_scene(Scene(GridShape(6, 6), [Frame(TargetPattern(DOTS.astype(np.complex128)), 1.0)]), spread(LINKED))
        for _ in range(2)
    ]
    first, second = (next(iter(plan.frames)) for plan in plans)
    assert first.spread == second.spread
    for one, other in zip(first.states, second.states, strict=True):
        np.testing.assert_array_equal(one.lam, other.lam)
