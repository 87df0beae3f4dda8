"""Changes put together from what chains did before are those that are worked out anew."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from chainsim import Device, load_device
from encoders import Frame, GridShape, Scene, TargetPattern
from planner import frame_change, plan_scene
from planner.cache_file import CacheFile
from planner.frame_change import ChainSteps, Change, change_to
from planner.packed import packed
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


@pytest.mark.parametrize(
    "name",
    ["paper-6x6", "linked-6x6", "paper-6x6-common", pytest.param("paper-6x6-ring", marks=pytest.mark.slow)],
)
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
        assert sum(map(len, remembered._known.values())) < 12 + 6


def test_where_one_drive_is_common_nothing_is_remembered() -> None:
    memory = memory_of(load_device("paper-6x6-common"), 20.0)
    remembered = ChainSteps(memory)
    remembered.change(memory.at_rest, dots(1))
    assert not any(remembered._known.values())


@pytest.mark.parametrize(
    "device",
    [PAPER, UNEQUAL, *map(load_device, ("linked-6x6", "paper-6x6-common"))],
    ids=["paper", "unequal", "linked", "common"],
)
def test_what_is_planned_ahead_is_what_one_change_after_another_gives(
    device: Device, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    frames = [Frame(dots(seed), 1.0) for seed in (*range(7), 3, 4, 5)]
    # Caches of their own, so that it is all planned, and planned again.
    monkeypatch.setenv("DOTWAVE_CACHE", str(tmp_path / "one"))
    ahead = [change for _, change in ChainSteps(memory_of(device, 20.0)).through(frames)]
    monkeypatch.setenv("DOTWAVE_CACHE", str(tmp_path / "other"))
    memory = memory_of(device, 20.0)
    one_by_one, held = ChainSteps(memory), memory.at_rest
    for frame, change in zip(frames, ahead, strict=True):
        alone = one_by_one.change(held, frame.pattern)
        assert replace(change, states=(), ramps=()) == replace(alone, states=(), ramps=())
        assert [packed(state) for state in change.states] == [packed(state) for state in alone.states]
        for ramp, same in zip(change.ramps, alone.ramps, strict=True):
            if ramp is None or same is None:
                assert ramp is same
                continue
            # What rings on is a difference of two large numbers.
            assert packed(replace(ramp, residue=None)) == packed(replace(same, residue=None))
            assert ramp.residue is None or ramp.residue == pytest.approx(same.residue, abs=1e-12)
        held = alone.targets if alone.held else memory.at_rest


def test_what_many_frames_bring_is_kept_in_few_transactions(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[int] = []

    def find(_: CacheFile, keys: Sequence[bytes]) -> dict[bytes, bytes]:
        asked.append(len(keys))
        return {}

    monkeypatch.setattr(CacheFile, "find", find)
    monkeypatch.setattr(CacheFile, "keep", lambda _, rows: asked.append(sum(1 for _ in rows)))
    frames = tuple(Frame(dots(seed), 1.0) for seed in range(256))
    plan = plan_scene(Scene(GridShape(6, 6), frames), PAPER)
    assert sum(1 for _ in plan.frames) == 257
    # Frame by frame there would be several hundred; so for 10 blocks, the way out, and while rows are met first.
    assert sum(asked) > 2000
    assert len(asked) <= 100


def test_few_frames_are_read_ahead() -> None:
    read: list[int] = []

    def frames() -> Iterator[Frame]:
        for seed in range(300):
            read.append(seed)
            yield Frame(dots(seed % 3), 1.0)

    steps = ChainSteps(memory_of(PAPER, 20.0)).through(frames())
    next(steps)
    assert len(read) == 1
    most = max(len(read) - place for place, _ in enumerate(steps, 1))
    assert most <= 384 // 6
