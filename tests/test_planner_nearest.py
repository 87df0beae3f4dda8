"""Devices that cannot make patterns at will: the best geometric profile, by brute force."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from numpy.typing import NDArray

from chainsim import Device, Outcome, load_device
from planner.nearest import Nearest
from planner.strategy import strategy_for

RING = load_device("paper-6x6-ring")
OPEN = load_device("paper-6x6").model_copy(update={"bias": "none"})
ROWS = np.array(list(product((0.0, 1.0), repeat=6)))
Floats = NDArray[np.float64]

devices = pytest.mark.parametrize("device", [RING, OPEN], ids=["ring", "open"])


def misfit(profile: Floats, target: Floats) -> float:
    return float(np.sum((profile - target) ** 2))


def least_misfit(target: Floats, steepest: float) -> float:
    """The best a r^m with a and every amplitude in 0..1 and r in 0..steepest, by trying all of them."""
    r = np.linspace(0.0, steepest, 4001)
    shapes = r[:, None] ** np.arange(6)
    heights = np.linspace(0.0, 1.0, 201)[:, None, None] / shapes.max(axis=1)[None, :, None]
    return float(np.min(np.sum((heights * shapes - target) ** 2, axis=2)))


@devices
def test_they_get_the_strategy(device: Device) -> None:
    assert isinstance(strategy_for(device, 20.0), Nearest)


@devices
@pytest.mark.parametrize(
    "target",
    [
        [1, 1, 1, 1, 1, 1],
        [1, 0, 0, 0, 0, 0],
        [0, 0, 0, 0, 0, 1],
        [1, 1, 0, 0, 1, 1],
        [0, 1, 0, 1, 1, 1],
        [1, 1, 1, 0, 0, 0],
    ],
    ids=str,
)
def test_the_nearest_is_the_best_there_is(device: Device, target: list[float]) -> None:
    wanted = np.array(target, dtype=np.float64)
    (state,) = strategy_for(device, 20.0).states(wanted[None])
    near = np.abs(state.phasor) / device.full_scale
    steepest = device.coupling.lam.max / (device.delta * device.omega.min)
    best = least_misfit(wanted, 1.0 if device is RING else steepest)
    assert misfit(near, wanted) <= best + 5e-3
    assert misfit(near, wanted) >= best - 1e-2
    assert state.error == pytest.approx(np.abs(near - wanted).max())


@devices
def test_every_nearest_is_geometric_and_within_reach(device: Device) -> None:
    for target, state in zip(ROWS, strategy_for(device, 20.0).states(ROWS), strict=True):
        near = np.abs(state.phasor) / device.full_scale
        assert np.all(near <= 1 + 1e-12)
        assert misfit(near, target) <= misfit(np.zeros(6), target) + 1e-12
        if near[0] > 0 and near[1] > 0:
            np.testing.assert_allclose(near[1:] * near[0], near[:-1] * near[1], atol=1e-12)
            if device is RING:
                assert near[1] <= near[0]


@devices
def test_any_dot_is_unreachable_and_none_is_not(device: Device) -> None:
    states = strategy_for(device, 20.0).states(ROWS)
    assert states[0].outcome is Outcome.OK
    assert states[0].error == 0
    assert {state.outcome for state in states[1:]} == {Outcome.UNREACHABLE}


@devices
def test_nothing_is_played(device: Device) -> None:
    strategy = strategy_for(device, 20.0)
    states = strategy.states(ROWS)
    assert strategy.ramps(states, states[::-1]) == [None] * 64
    assert strategy.ramp_s == 0.0
    np.testing.assert_array_equal(strategy.held(ROWS[5], True), ROWS[5])


def test_the_note_names_what_is_lacking() -> None:
    for device, shape in ((RING, "ring"), (OPEN, "chain")):
        note = strategy_for(device, 20.0).note()
        assert note.startswith(device.name)
        assert f"one lam and one drive per {shape}" in note
        assert "lacks a bias per actuator or a lam per link" in note
        assert note.endswith(".")
        assert note.count(". ") == 0
