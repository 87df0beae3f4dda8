"""Scenes on devices: the time line, laziness, bounded memory, and what a person is told."""

from __future__ import annotations

import tracemalloc
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from itertools import islice, pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings, strategies as st
from numpy.typing import NDArray

from chainsim import Device, Outcome, load_device
from encoders import Frame, GridShape, Scene, TargetPattern
from planner import DwellTooShort, FramePlan, PlanError, SceneDoesNotFit, plan_scene
from tests.support.known import known

PAPER, LINKED, SINGLE, RING = (
    load_device(name) for name in ("paper-6x6", "linked-6x6", "independent-6x6", "paper-6x6-ring")
)
PLAYABLE = [PAPER, LINKED, SINGLE]
each_playable = pytest.mark.parametrize("device", PLAYABLE, ids=lambda device: device.name)


@pytest.fixture(autouse=True)
def _cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DOTWAVE_CACHE", str(tmp_path))


def frame(dots: object, dwell_s: float = 1.0) -> Frame:
    return Frame(TargetPattern(np.array(dots, dtype=np.complex128)), dwell_s)


def frames_of(count: int, seed: int, dwell_s: float = 1.0) -> list[Frame]:
    return [frame(dots, dwell_s) for dots in np.random.default_rng(seed).integers(0, 2, (count, 6, 6))]


def planned(frames: Iterable[Frame], device: Device = PAPER) -> list[FramePlan]:
    return list(plan_scene(Scene(GridShape(6, 6), frames), device).frames)


def on_grid(seconds: float, device: Device) -> bool:
    samples = seconds * device.amplifier.rate_hz
    return abs(samples - round(samples)) < 1e-6


@each_playable
@settings(max_examples=15, suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow])
@given(dwells=st.lists(st.floats(0.4, 2.0), min_size=1, max_size=6), seed=st.integers(0, 99))
def test_the_time_line(device: Device, dwells: list[float], seed: int) -> None:
    rate = device.amplifier.rate_hz
    frames = [frame(f.pattern.amplitude, dwell) for f, dwell in zip(frames_of(len(dwells), seed), dwells, strict=True)]
    plans = planned(frames, device)
    assert plans[0].start_s == 0.0
    for one, other in pairwise(plans):
        assert one.end_s == other.start_s
    for plan in plans:
        assert on_grid(plan.start_s, device)
        assert on_grid(plan.end_s, device)
        longest = max((ramp.duration_s for ramp in plan.ramps if ramp is not None), default=0.0)
        assert plan.settled_s == plan.start_s + longest
        assert plan.settled_s < plan.end_s
        # Rows of dots alike, soon after others, ring on for too long.
        rings = "what changes leave rings on" in plan.note
        assert (plan.outcome, plan.note) == (Outcome.OK, "") or (plan.outcome is Outcome.UNREACHABLE and rings)
    for plan, wanted in zip(plans, frames, strict=False):
        assert plan.frame is wanted
        assert plan.end_s - plan.start_s == pytest.approx(wanted.dwell_s, abs=0.51 / rate)


@each_playable
def test_a_chain_goes_from_state_to_state(device: Device) -> None:
    """Each ramp starts where the frame before stood; a chain without a ramp stands already."""
    for one, other in pairwise(planned(frames_of(12, seed=1), device)):
        for before, after, ramp in zip(one.states, other.states, other.ramps, strict=True):
            if ramp is None:
                assert before is after
                continue
            assert ramp.lacking == ""
            if ramp.epsilon is not None:
                assert ramp.epsilon[0] == pytest.approx(before.epsilon, rel=1e-12, abs=1e-15)
                assert ramp.epsilon[-1] == pytest.approx(after.epsilon, rel=1e-12, abs=1e-15)
            if ramp.bias is not None:
                np.testing.assert_allclose(ramp.bias[[0, -1]], [before.bias, after.bias], atol=1e-15)


@each_playable
def test_the_way_out_ends_in_silence(device: Device) -> None:
    plans = planned(frames_of(3, seed=2), device)
    assert len(plans) == 4
    assert [plan.frame is None for plan in plans] == [False, False, False, True]
    out = plans[-1]
    assert all(state.epsilon == 0 and not state.bias.any() and not state.target.any() for state in out.states)
    for before, ramp in zip(plans[-2].states, out.ramps, strict=True):
        assert (ramp is None) == (not before.target.any())
        if ramp is not None:
            last = ramp.epsilon if ramp.epsilon is not None else ramp.bias
            np.testing.assert_allclose(known(last)[-1], 0.0, atol=1e-15)
    assert out.end_s > out.settled_s


@each_playable
def test_blank_frames_alone_play_nothing(device: Device) -> None:
    plans = planned([frame(np.zeros((6, 6))), frame(np.zeros((6, 6)), 0.01)], device)
    assert len(plans) == 2
    for plan in plans:
        assert plan.ramps == (None,) * len(plan.ramps)
        assert plan.settled_s == plan.start_s
        assert all(state.epsilon == 0 for state in plan.states)


def test_no_frames() -> None:
    assert planned([]) == []


def test_a_vibrating_chain_idles_between_patterns() -> None:
    """Silence until a row's first dot; from then on a floor, even in blank frames."""
    dots = np.zeros((4, 6, 6))
    dots[1, 2, 3] = 1
    dots[3, 0] = 1
    plans = planned([frame(d) for d in dots], LINKED)
    quiet = [[not state.target.any() for state in plan.states] for plan in plans]
    assert quiet[0] == [True] * 6
    assert quiet[1] == quiet[2] == [True, True, False, True, True, True]
    assert quiet[3] == [False, True, False, True, True, True]
    assert quiet[4] == [True] * 6
    assert np.all(plans[2].states[2].target <= 0.1 * (1 + 1e-12))


@each_playable
def test_equal_rows_share_their_plans(device: Device) -> None:
    dots = np.tile(np.array([1, 0, 1, 1, 0, 0]), (6, 1))
    dots[4] = 1
    plans = planned([frame(np.zeros((6, 6))), frame(dots), frame(1 - dots)], device)
    chains = len(plans[0].states) // 6
    for plan in plans[1:]:
        for row in (1, 2, 3, 5):
            for chain in range(chains):
                assert plan.states[row * chains + chain] is plan.states[chain]
                assert plan.ramps[row * chains + chain] is plan.ramps[chain]


def test_states_follow_the_rows_in_order() -> None:
    """On a device with several chains a row, they go row by row, chain by chain."""
    device = load_device("linked-40x96")
    dots = np.zeros((40, 96))
    dots[3, 6 * 7 + 2] = 1
    (plan, _) = plan_scene(Scene(GridShape(40, 96), [frame(dots)]), device).frames
    moving = [index for index, state in enumerate(plan.states) if state.target.any()]
    assert moving == [3 * 16 + 7]
    assert np.argmax(plan.states[moving[0]].target) == 2
    assert len(plan.states) == len(plan.ramps) == 640


@pytest.mark.parametrize(("device", "least"), [(PAPER, "0.0601"), (LINKED, "0.344"), (SINGLE, "0.0622")])
def test_a_dwell_that_is_too_short(device: Device, least: str) -> None:
    with pytest.raises(DwellTooShort) as caught:
        planned([*frames_of(1, seed=3), *frames_of(1, seed=4, dwell_s=0.05)], device)
    message = str(caught.value)
    assert message.startswith("a frame of 0.05 s")
    assert f"the {least} s" in message
    assert device.name in message
    assert "--dwell" in message
    assert "\n" not in message
    assert isinstance(caught.value, PlanError)
    assert isinstance(caught.value, ValueError)
    # The dwell it asks for is enough.
    asked = float(message.split("show frames for ")[1].split(" s")[0])
    assert planned(frames_of(4, seed=4, dwell_s=asked), device)


@pytest.mark.parametrize("shape", [GridShape(40, 96), GridShape(6, 5), GridShape(3, 12)])
def test_a_scene_for_another_grid(shape: GridShape) -> None:
    with pytest.raises(SceneDoesNotFit) as caught:
        plan_scene(Scene(shape, []), PAPER)
    message = str(caught.value)
    assert f"{shape.rows} x {shape.cols}" in message
    assert "paper-6x6 has 6 x 6" in message
    assert isinstance(caught.value, ValueError)


@dataclass
class Counted:
    """Frames made when asked for, and how many were."""

    make: Callable[[], Iterator[Frame]]
    taken: int = 0

    def __iter__(self) -> Iterator[Frame]:
        for made in self.make():
            self.taken += 1
            yield made


def endless(count: int, seed: int = 5) -> Iterator[Frame]:
    rng = np.random.default_rng(seed)
    for _ in range(count):
        yield frame(rng.integers(0, 2, (6, 6)))


@each_playable
def test_frames_are_planned_as_they_are_taken(device: Device) -> None:
    scene = Counted(lambda: endless(10**6))
    plan = plan_scene(Scene(GridShape(6, 6), scene), device)
    assert scene.taken == 0
    assert len(list(islice(plan.frames, 10))) == 10
    # As many again may be read ahead, up to 64.
    assert scene.taken <= 20


@pytest.mark.slow
def test_memory_does_not_grow_with_frames() -> None:
    plan = plan_scene(Scene(GridShape(6, 6), Counted(lambda: endless(12_000))), PAPER)
    tracemalloc.start()
    try:
        frames = iter(plan.frames)
        for _ in islice(frames, 3000):
            pass
        early, _ = tracemalloc.get_traced_memory()
        tracemalloc.reset_peak()
        assert sum(1 for _ in frames) == 9_001
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    # By then nearly all 64 x 63 changes of a row were met once.
    assert peak < early + 12e6
    assert peak < 60e6


def plain(plan: FramePlan) -> tuple[object, ...]:
    def arrays(thing: object) -> tuple[object, ...]:
        return tuple(value.tobytes() if isinstance(value, np.ndarray) else value for value in vars(thing).values())

    states = tuple(arrays(state) for state in plan.states)
    ramps = tuple(None if ramp is None else arrays(ramp) for ramp in plan.ramps)
    return plan.start_s, plan.settled_s, plan.end_s, states, ramps, plan.outcome, plan.note


@each_playable
def test_reading_again_gives_the_same(device: Device) -> None:
    plan = plan_scene(Scene(GridShape(6, 6), frames_of(6, seed=6)), device)
    first = [plain(p) for p in plan.frames]
    assert first == [plain(p) for p in plan.frames]
    # Two readers at once do not disturb each other.
    both = list(zip(plan.frames, plan.frames, strict=True))
    assert first == [plain(one) for one, _ in both] == [plain(other) for _, other in both]


def test_the_encoding_is_handed_through() -> None:
    encoding = {"tables": ["en-ueb-g2.ctb"]}
    plan = plan_scene(Scene(GridShape(6, 6), [], encoding), PAPER)
    assert plan.encoding == encoding
    assert plan.device is PAPER


def test_unreachable_frames_say_so_and_blank_ones_do_not() -> None:
    plans = planned([frame(np.zeros((6, 6))), frame(np.eye(6))], RING)
    assert [plan.outcome for plan in plans] == [Outcome.OK, Outcome.UNREACHABLE]
    assert plans[0].note == ""
    assert "paper-6x6-ring" in plans[1].note
    assert "it lacks" in plans[1].note
    assert all(np.abs(state.phasor).any() for state in plans[1].states)


def weak(device: Device, volts: float) -> Device:
    return device.model_copy(update={"amplifier": device.amplifier.model_copy(update={"volts": volts})})


@pytest.mark.parametrize("device", [weak(PAPER, 50.0), weak(LINKED, 10.0), weak(SINGLE, 0.1)], ids=lambda d: d.name)
def test_a_frame_names_what_the_device_lacks(device: Device) -> None:
    for plan in planned(frames_of(2, seed=7), device)[:2]:
        assert plan.outcome is Outcome.UNREACHABLE
        assert plan.note.startswith(device.name)
        assert "lacks volts" in plan.note
        assert plan.note.endswith(".")


def test_a_change_out_of_reach_makes_its_frame_unreachable(monkeypatch: pytest.MonkeyPatch) -> None:
    """States that can be held, with a way between them that the device cannot go."""
    from planner.amplitudes.vibration import Vibration

    monkeypatch.setattr(Vibration, "_lacking", lambda self, made, i, epsilon, lam: "it lacks patience")
    rows = np.tile(np.array([1, 0, 1, 1, 0, 0]), (6, 1))
    plans = planned([frame(rows), frame(rows)], LINKED)
    assert [plan.outcome for plan in plans[:2]] == [Outcome.UNREACHABLE, Outcome.OK]
    assert plans[0].note == "linked-6x6 cannot change to this pattern: it lacks patience."


def test_grey_levels() -> None:
    """Any modulus in 0..1 is a target; the argument does not matter to an on/off pattern."""
    grey: NDArray[np.complex128] = np.linspace(0.2, 1.0, 36).reshape(6, 6) * np.exp(1j)
    for device in (PAPER, LINKED, SINGLE):
        plan = planned([frame(grey)], device)[0]
        assert plan.outcome is Outcome.OK
        got = np.concatenate([state.target for state in plan.states]).reshape(6, 6)
        np.testing.assert_allclose(got, np.abs(grey), rtol=1e-12)
