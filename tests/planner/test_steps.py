"""Changes put together from what chains did before are those that are worked out anew."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from chainsim import load_device
from encoders import Frame, GridShape, Scene, TargetPattern
from planner import frame_change, plan_scene
from planner.frame_change import ChainSteps, Change, change_to
from planner.unequal import memory_of
from tests.planner.test_unequal import measured

PAPER = load_device("paper-6x6")
UNEQUAL = measured(PAPER, 1e-3, rows=(2, 4))


def dots(seed: int) -> TargetPattern:
    return TargetPattern(np.random.default_rng(seed).integers(0, 2, (6, 6)).astype(np.complex128))


class CountedChanges:
    """Counts the changes that are worked out."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.times = 0
        monkeypatch.setattr(frame_change, "change_to", self)

    def __call__(self, *given: object) -> Change:
        self.times += 1
        return change_to(*given)  # type: ignore[arg-type]


@pytest.mark.parametrize("name", ["paper-6x6", "linked-6x6", "paper-6x6-common", "paper-6x6-ring"])
def test_remembered_changes_are_those_worked_out(name: str) -> None:
    device = load_device(name)
    memory = memory_of(device, 20.0)
    remembered, held = ChainSteps(memory), memory.at_rest
    for seed in (0, 1, 2, 0, 1, 2, 0):
        pattern = dots(seed)
        anew = change_to(memory, held, memory.hold(pattern, held))
        change = remembered.change(held, pattern)
        assert replace(change, states=(), ramps=()) == replace(anew, states=(), ramps=())
        if change.made:
            assert list(map(id, change.ramps)) == list(map(id, anew.ramps))
            assert [state.bias.tolist() for state in change.states] == [state.bias.tolist() for state in anew.states]
        held = change.targets if change.held else memory.at_rest


def test_a_change_is_worked_out_once(monkeypatch: pytest.MonkeyPatch) -> None:
    counted = CountedChanges(monkeypatch)
    patterns = [dots(seed) for seed in range(8)]
    frames = tuple(Frame(patterns[at % 8], 1.0) for at in range(800))
    plan = plan_scene(Scene(GridShape(6, 6), frames), PAPER)
    assert sum(1 for _ in plan.frames) == 801
    # The first from rest, then eight; from then on no row changes in a way that is new.
    assert counted.times <= 9


def test_chains_of_several_kinds_are_told_apart() -> None:
    memory = memory_of(UNEQUAL, 20.0)
    remembered = ChainSteps(memory)
    for seed in (0, 1, 0, 1):
        pattern = TargetPattern(np.tile(dots(seed).amplitude[:1], (6, 1)))
        change = remembered.change(memory.at_rest, pattern)
        anew = change_to(memory, memory.at_rest, memory.hold(pattern, memory.at_rest))
        assert list(map(id, change.states)) == list(map(id, anew.states))
        assert len(set(map(id, change.states))) > 1


def test_what_is_remembered_is_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(frame_change, "MOST_STEPS", 12)
    memory = memory_of(PAPER, 20.0)
    remembered = ChainSteps(memory)
    for seed in range(30):
        remembered.change(memory.at_rest, dots(seed))
        assert len(remembered._known) < 12 + 6


def test_where_one_drive_is_common_nothing_is_remembered() -> None:
    memory = memory_of(load_device("paper-6x6-common"), 20.0)
    remembered = ChainSteps(memory)
    remembered.change(memory.at_rest, dots(1))
    assert not remembered._known
