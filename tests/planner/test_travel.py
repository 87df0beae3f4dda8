"""Patterns that travel: how long their ways are, what they start from, how fast they may be, and who cannot."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from chainsim import Outcome, load_device
from encoders import (
    SMOOTHNESS,
    STANDS_FROM,
    Frame,
    GridShape,
    Presentation,
    Scene,
    TextOptions,
    TravelFrames,
    arrow,
    encode_text,
    moving_dot,
    scrolled_bars,
    walking_bars,
)
from planner import CannotTravel, DwellTooShort, FramePlan, plan_scene
from planner.planner import Transition
from planner.targets import AmplitudeTarget, targets_of
from planner.transitions.envelopes import ROUGHEST
from planner.waves.speeds import walking_speeds
from planner.waves.walking import walking_state
from tests.support.known import known

GRID = GridShape(6, 6)
PAPER, LINKED, RING = (load_device(name) for name in ("paper-6x6", "linked-6x6", "paper-6x6-ring"))


def planned(frames: TravelFrames, name: str = "linked-6x6") -> list[FramePlan]:
    return list(plan_scene(Scene(GRID, frames), load_device(name)).frames)


def dot(per_s: float, lasting_s: float = 1.0) -> TravelFrames:
    return moving_dot(GRID, arrow(GRID, "right"), per_s=per_s, lasting_s=lasting_s)  # type: ignore[arg-type]


def test_links_go_along_the_step_that_encoders_state() -> None:
    assert ROUGHEST == SMOOTHNESS


@pytest.mark.parametrize("name", ["paper-6x6", "linked-6x6", "independent-6x6", "paper-6x6-common"])
def test_ways_last_the_whole_frame_and_nothing_rests(name: str) -> None:
    lead, *travelling, out = planned(dot(2.0), name)
    assert lead.settled_s < lead.end_s
    assert len(travelling) == 2
    for frame in travelling:
        assert frame.outcome is Outcome.OK
        length_s = frame.end_s - frame.start_s
        assert frame.settled_s == pytest.approx(frame.start_s + STANDS_FROM * length_s)
        ways = [known(ramp).duration_s for ramp in frame.ramps if ramp is not None]
        assert ways
        assert ways == [pytest.approx(length_s)] * len(ways)
    assert out.frame is None


def test_no_chain_rests_where_links_carry_what_travels() -> None:
    """A rise from rest would follow its own way, not the stated one."""
    plans = planned(dot(2.5, 1.6))
    assert all(state.moving for state in plans[0].states)
    floors = [np.unique(state.target) for state in plans[0].states]
    assert all(level.min() > 0 for level in floors)
    for before, after in pairwise(plans[:-1]):
        assert all(state.moving for state in (*before.states, *after.states))


def test_levels_follow_the_stated_step_on_biases() -> None:
    plans = planned(dot(2.0), "paper-6x6")
    ramp = known(plans[1].ramps[2])
    bias = known(ramp.bias)
    half = bias[len(bias) // 2] / PAPER.full_scale
    # One dot half way from the first to the second actuator.
    z = 0.5 * PAPER.full_scale
    level = (z + PAPER.beta * z**3) / PAPER.full_scale
    np.testing.assert_allclose(half, [level, level, 0, 0, 0, 0], atol=1e-3)


@pytest.mark.parametrize(("device", "most"), [(PAPER, 16.64), (LINKED, 3.63)])
def test_too_quick_is_refused_with_the_quickest(device: object, most: float) -> None:
    name = "paper-6x6" if device is PAPER else "linked-6x6"
    with pytest.raises(DwellTooShort, match=f"let at most {most:g} pass") as found:
        planned(dot(most + 0.02), name)
    assert "\n" not in str(found.value)
    assert planned(dot(most, 1 / most), name)[1].outcome is Outcome.OK


@pytest.mark.parametrize("name", ["ultrasonic-6x6"])
def test_devices_that_cannot_say_what_is_nearest_and_how_fast(name: str) -> None:
    speeds = known(walking_speeds(load_device(name)))
    assert speeds.slowest < speeds.quickest
    nearest = f"bars that walk .* by {speeds.slowest:.3g} to {speeds.quickest:.3g} columns a second"
    with pytest.raises(CannotTravel, match=nearest.replace("+", "[+]")):
        planned(dot(1.0), name)
    scene = encode_text("Hi", GRID, TextOptions(presentation=Presentation.SCROLL))
    with pytest.raises(CannotTravel, match=name):
        list(plan_scene(scene, load_device(name)).frames)


def test_walking_speeds_are_those_of_bars_that_can_be_planned() -> None:
    """Two actuators' width w apart: 2 w f0 delta tan(pi / 2 w) for small amplitudes."""
    speeds = known(walking_speeds(PAPER))
    small = 2 * 1.2 * PAPER.f0_hz * PAPER.delta * np.tan(np.pi / 2.4)
    assert speeds.quickest == pytest.approx(small, rel=0.05)
    assert walking_speeds(load_device("independent-6x6")) is None


def test_slow_walking_bars_name_the_nearest_rate_and_what_does_it() -> None:
    (target, *_) = targets_of(walking_bars(GRID, rate_hz=0.1), PAPER)
    state = walking_state(PAPER, target)  # type: ignore[arg-type]
    assert state.outcome is Outcome.UNREACHABLE
    assert "at this amplitude bars walk at 0.673 Hz, slower bars go by its bias (texture scroll)" in state.lacking
    (there, *_) = targets_of(walking_bars(GRID, rate_hz=0.673), PAPER)
    assert walking_state(PAPER, there).outcome is Outcome.OK  # type: ignore[arg-type]
    # Bars six columns apart at 0.1 Hz.
    plans = planned(scrolled_bars(GRID, width=3, gap=3, columns_per_s=0.6, lasting_s=12.0), "paper-6x6")
    assert all(plan.outcome is Outcome.OK for plan in plans)
    assert plans[7].start_s - plans[1].start_s == pytest.approx(10.0, rel=1e-3)
    np.testing.assert_array_equal(plans[7].states[0].target, plans[1].states[0].target)


def test_dense_patterns_that_ring_on_are_refused() -> None:
    rng = np.random.default_rng(2)
    strip = np.concatenate([np.zeros((6, 6)), rng.random((6, 30)) < 0.85], axis=1)
    plans = planned(TravelFrames(lambda step: strip[:, step : step + 6], 14, 2.5))
    refused = next(plan for plan in plans if plan.outcome is not Outcome.OK)
    assert "rings on" in refused.note
    assert "--dwell" not in refused.note


def test_ways_of_other_lengths_are_other_ways_in_the_cache() -> None:
    one, other = AmplitudeTarget.of(np.zeros(6)), AmplitudeTarget.of(np.ones(6))
    keys = {Transition(one, other, True, length).key for length in (None, 0.5, 1.0)}
    assert len(keys) == 3
    assert Transition(one, other, True).key == Transition(one, other, True, None).key


def test_a_frame_that_travels_needs_no_lead() -> None:
    """Without one a chain rises in the frame; at its end the pattern is right."""
    pattern = next(iter(dot(1.0))).pattern
    plans = list(plan_scene(Scene(GRID, (Frame(pattern, 0.5, travels=True),)), LINKED).frames)
    assert plans[0].outcome is Outcome.OK


@pytest.mark.parametrize(
    ("name", "lacks"),
    [
        ("grid-6x6", "no bias on every actuator and no lam on every link"),
        ("paper-6x6-ring", "no bias on every actuator and no lam on every link"),
        ("linked-ring-6x6", "to rest between two patterns of dots"),
        ("linked-both-ways-6x6", "to rest between two patterns of dots"),
    ],
)
def test_nothing_is_called_near_that_cannot_be_made(name: str, lacks: str) -> None:
    """Bars that walk do not come to stand on any of these either."""
    assert walking_speeds(load_device(name)) is None
    with pytest.raises(CannotTravel, match=rf"it has {lacks}\.$"):
        planned(dot(1.0), name)
