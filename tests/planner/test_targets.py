"""Targets of chains as keys: equal where what is wanted is equal, and only there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from chainsim import load_device
from encoders import GridShape, TargetPattern
from encoders.textures import plane_wave, walking_bars
from planner.targets import AmplitudeTarget, ChainTarget, WalkingTarget, WaveTarget, targets_of

PAPER, LARGE = load_device("paper-6x6"), load_device("linked-40x96")
GRID = GridShape(6, 6)

AMPLITUDE = AmplitudeTarget((1.0, 0.0, 0.5))
WAVE = WaveTarget((1.0, 0.0, 0.5), phase=(0.0, None, 1.0), weight=(1.0, 0.0, 1.0))
WALK = WalkingTarget((1.0, 1.0, 1.0), weight=(1.0, 1.0, 1.0), width=2.0)
OTHERS = [
    AMPLITUDE, AmplitudeTarget((1.0, 0.0, 0.25)), AmplitudeTarget((1.0, 0.0, 0.5, 0.0)), AMPLITUDE.turned(1.0),
    WAVE, replace(WAVE, phase=(0.0, None, 1.1)), replace(WAVE, phase=(0.0, 0.0, 1.0)), replace(WAVE, weight=(1.0,) * 3),
    WAVE.under(0.01), WAVE.under(0.0), WAVE.turned(0.5), WALK, replace(WALK, rate_hz=2.0), replace(WALK, width=2.5),
    replace(WALK, place=6), WALK.under(0.01),
    # All that a wave and amplitudes have in common.
    WaveTarget((1.0, 0.0, 0.5), phase=(None,) * 3, weight=(1.0,) * 3),
]  # fmt: skip


def test_no_two_of_them_are_the_same() -> None:
    assert len(set(OTHERS)) == len({one.key for one in OTHERS}) == len(OTHERS)


@pytest.mark.parametrize("target", [AMPLITUDE, WAVE, WALK], ids=lambda target: type(target).__name__)
def test_the_same_again_is_found(target: ChainTarget) -> None:
    again = replace(target)
    assert again is not target
    assert {target: 1}[again] == 1
    assert again.key == target.key
    assert target.turned(2.0).unturned == target


@pytest.mark.parametrize(
    "pattern",
    [
        TargetPattern(np.full((6, 6), 0.3, dtype=np.complex128)),
        plane_wave(GRID, lag_deg=70, row_lag_deg=11, level=0.3),
        walking_bars(GRID, width=3),
    ],
    ids=["amplitudes", "wave", "bars"],
)
def test_a_pattern_wants_the_same_twice(pattern: TargetPattern) -> None:
    one, other = (list(targets_of(pattern, PAPER)) for _ in range(2))
    assert one == other
    assert len({target.unturned for target in one}) == 1


def test_phases_are_told_apart_to_nine_decimals() -> None:
    def wave(third: float) -> ChainTarget:
        phases = np.array([0.4, 0.4 - np.pi, third, 0.0, 0.0, 0.0])
        pattern = TargetPattern(np.tile(np.exp(1j * phases), (6, 1)), phase_matters=True)
        return next(iter(targets_of(pattern, PAPER)))

    assert wave(1.0) == wave(1.0 + 1e-11)
    assert wave(1.0) != wave(1.0 + 1e-8)
    # Half a turn is half a turn, whichever way.
    assert wave(0.4 + np.pi) == wave(0.4 - np.pi)


def test_rest_has_no_turn() -> None:
    rest = AmplitudeTarget((0.0, 0.0))
    assert rest.turned(1.0) is rest
    assert rest.resting
    assert not AMPLITUDE.resting


def test_bars_know_their_place() -> None:
    shape = GridShape(LARGE.rows, LARGE.cols)
    targets = list(targets_of(walking_bars(shape, width=3), LARGE))
    places = [target.place for target in targets if isinstance(target, WalkingTarget)]
    assert places == list(range(0, 96, 6)) * 40


def test_bars_of_no_width_and_no_rate_are_refused() -> None:
    with pytest.raises(ValueError, match="a width, a rate or both"):
        WalkingTarget((1.0,), weight=(1.0,))
