"""Ways from what stands to what comes: those of a scene, and what must not be begun."""

from __future__ import annotations

import numpy as np
import pytest

from chainsim import Outcome, load_device
from dotwave import device
from encoders import Frame, GridShape, Scene, TargetPattern
from planner import LivePlan, LiveWay, plan_scene
from planner.planner import Planner

SHAPE = GridShape(6, 6)


def frames(count: int) -> list[Frame]:
    rng = np.random.default_rng(4)
    return [Frame(TargetPattern((rng.random((6, 6)) < 0.5).astype(complex)), 1.0) for _ in range(count)]


def gone(plan: LivePlan, frame: Frame) -> LiveWay:
    way = plan.show(frame)
    plan.begin(way)
    return way


@pytest.mark.parametrize("name", ["paper-6x6", "independent-6x6"])
def test_ways_are_those_of_a_scene(name: str) -> None:
    device, shown = load_device(name), frames(3)
    *planned, out = plan_scene(Scene(SHAPE, tuple(shown)), device).frames
    live = LivePlan(device)
    for frame, wanted in zip(shown, planned, strict=True):
        way = gone(live, frame)
        assert way.plan.frame is frame
        assert way.plan.settled_s == pytest.approx(wanted.settled_s - wanted.start_s, abs=1e-12)
        for mine, theirs in zip(way.plan.ramps, wanted.ramps, strict=True):
            assert (mine is None) == (theirs is None)
            if mine is not None and theirs is not None:
                np.testing.assert_array_equal(mine.t_s, theirs.t_s)
                if theirs.bias is not None:
                    np.testing.assert_array_equal(mine.bias, theirs.bias)
                if theirs.epsilon is not None:
                    np.testing.assert_array_equal(mine.epsilon, theirs.epsilon)
    assert not live.resting
    rest = live.rest()
    assert rest.plan.frame is None
    assert rest.plan.settled_s == pytest.approx(max(ramp.duration_s for ramp in out.ramps if ramp is not None))
    live.begin(rest)
    assert live.resting


def test_what_leads_from_elsewhere_is_not_begun() -> None:
    live, (first, second, _) = LivePlan(load_device("paper-6x6")), frames(3)
    early, late = live.show(first), live.show(second)
    assert live.leads_on(early)
    live.begin(late)
    assert not live.leads_on(early)
    with pytest.raises(ValueError, match="expected one from what is held"):
        live.begin(early)
    # What stands already is no way, but it may say something else.
    assert live.show(second).still
    assert not live.show(first).still


def test_what_cannot_be_made_is_not_begun() -> None:
    live = LivePlan(load_device("paper-6x6-ring"))
    way = live.show(frames(1)[0])
    assert way.plan.outcome is not Outcome.OK
    assert "cannot make this pattern" in way.plan.note
    with pytest.raises(ValueError, match="with the outcome ok"):
        live.begin(way)
    assert live.resting


def test_ways_planned_ahead_are_not_planned_again(monkeypatch: pytest.MonkeyPatch) -> None:
    live = LivePlan(load_device("paper-6x6"))
    ahead = 0
    while live.ahead():
        ahead += 1
    assert ahead == 64 * 64

    def no(*_: object) -> None:
        raise AssertionError("planned again")

    monkeypatch.setattr(Planner, "points", no)
    monkeypatch.setattr(Planner, "ramps", no)
    for frame in frames(5):
        assert gone(live, frame).plan.outcome is Outcome.OK


def test_long_chains_are_not_planned_ahead() -> None:
    assert not LivePlan(device({"base": "paper-6x6", "grid": {"cols": 8}})).ahead()
