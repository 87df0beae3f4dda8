"""The nearest amplitudes with one lam and one drive: the best geometric profile, by brute force."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from numpy.typing import NDArray

from chainsim import Device, Outcome, load_device
from planner.closed_forms.nearest import nearest_geometric
from planner.families import row_of
from planner.targets import AmplitudeTarget, WaveTarget
from planner.waves.wave_state import wave_state

RING = load_device("paper-6x6-ring")
OPEN = load_device("paper-6x6").model_copy(update={"bias": "none"})
LINKED_RING = load_device("linked-6x6").model_copy(
    update={"coupling": load_device("linked-6x6").coupling.model_copy(update={"closure": "ring"})}
)
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


def free(amplitude: list[float]) -> WaveTarget:
    return WaveTarget(tuple(map(float, amplitude)), phase=(None,) * 6, weight=(1.0,) * 6)


@devices
@pytest.mark.parametrize("target", list(product((0.0, 1.0), repeat=6))[1::5], ids=str)
def test_the_nearest_is_the_best_there_is(device: Device, target: tuple[float, ...]) -> None:
    wanted = np.array(target)
    first, ratio = nearest_geometric(device, wanted, 1.0)
    near = first * ratio ** np.arange(6, dtype=np.float64)
    steepest = device.coupling.lam.max / (device.delta * device.omega.min)
    best = least_misfit(wanted, 1.0 if device is RING else steepest)
    assert best - 1e-2 <= misfit(near, wanted) <= best + 5e-3
    assert np.all(near <= 1 + 1e-12)


def test_such_devices_make_waves_of_amplitudes() -> None:
    assert row_of(AmplitudeTarget, RING).name == "wave"
    assert row_of(AmplitudeTarget, OPEN).name == "wave"


@devices
def test_equal_amplitudes_and_a_single_first_dot_are_made(device: Device) -> None:
    for target in ([0.7] * 6, [0.7, 0, 0, 0, 0, 0]):
        state = wave_state(device, free(target))
        assert state.outcome is Outcome.OK
        np.testing.assert_allclose(np.abs(state.phasor) / device.full_scale, target, atol=1e-4)


@devices
def test_other_patterns_are_unreachable_with_the_nearest(device: Device) -> None:
    state = wave_state(device, free([1, 0, 1, 1, 0, 1]))
    shape = "ring" if device is RING else "chain"
    assert state.outcome is Outcome.UNREACHABLE
    assert f"one lam and one drive per {shape}" in state.lacking or "stable" in state.lacking
    assert "it lacks" in state.lacking
    near = np.abs(state.phasor) / device.full_scale
    assert state.error == pytest.approx(np.abs(near - state.target).max())
    assert near.max() > 0.3


@pytest.mark.slow
def test_a_ring_with_a_lam_per_link_is_not_told_to_get_one() -> None:
    state = wave_state(LINKED_RING, free([0.1, 1, 0.1, 1, 0.1, 1]))
    assert state.outcome is Outcome.UNREACHABLE
    assert "lam per link" not in state.lacking
    assert "one lam" not in state.lacking
