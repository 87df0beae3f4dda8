"""Chains with numbers of their own: each planned with them, as the device is set to them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from chainsim import Device, Outcome, Setting, balance_near, load_device, solve
from chainsim.model.calibrated import Actuator
from encoders import Frame, GridShape, Scene, TargetPattern
from planner import plan_scene
from planner.amplitudes import vibration as vibration_module
from planner.amplitudes.refine import refine
from planner.cache import PlanCache
from planner.memory import Memory
from planner.operating_point import OperatingPoint
from planner.unequal import UnequalMemory
from tests.support.known import known

Floats = NDArray[np.float64]

LINKED, PAPER, SINGLE = (load_device(name) for name in ("linked-6x6", "paper-6x6", "independent-6x6"))
DOTS = np.random.default_rng(3).integers(0, 2, (6, 6))


@pytest.fixture(autouse=True)
def _cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DOTWAVE_CACHE", str(tmp_path))


def measured(device: Device, sigma: float, *, gain: float = 0.0, rows: tuple[int, ...] = tuple(range(6))) -> Device:
    """Every actuator of some rows measured: frequency, damping, cubic term; links; drives."""
    rng, n = np.random.default_rng(11), device.chain_length
    actuators = []
    for row in rows:
        for col in range(device.cols):
            x = rng.standard_normal(5)
            first = col % n == 0
            actuators.append(
                Actuator(
                    row=row, col=col, f0_hz=device.f0_hz * (1 + sigma * x[0]), delta=device.delta * (1 + sigma * x[1]),
                    beta=device.beta * (1 + sigma * x[2]), lam=None if first else 0.006 * (1 + gain * x[3]),
                    lam_set=None if first else 0.006, epsilon_per_volt=2e-3 * (1 + 0.05 * x[4]) if first else None,
                )
            )  # fmt: skip
    return device.model_copy(update={"actuators": tuple(actuators)})


def truth(device: Device, place: int, state: OperatingPoint) -> NDArray[np.complex128]:
    """What a chain of the device does when it is set to a state, in units of full scale."""
    row, index = divmod(place, device.chains_per_row)
    chain = device.chain_at(row, index)
    epsilon = state.epsilon * device.drive_per_volt(row, index) / device.epsilon_per_volt
    lam = state.lam * device.lam_gain(row, index)
    setting = Setting.of(
        chain, epsilon=abs(epsilon), phase=np.angle(epsilon), lam=lam[None] if len(lam) else 0.0, omega=state.omega,
        bias=state.bias,
    )  # fmt: skip
    if np.any(state.bias):
        answer = solve(chain, setting, tol=1e-12, rung="static", start="rest")
        return np.asarray(answer.mean[0] / device.full_scale, dtype=np.complex128)
    answer = balance_near(chain, setting, state.phasor[None], tol=1e-9)
    return np.asarray(answer.phasor[0] / device.full_scale)


def held(device: Device, pattern: Any, phase_matters: bool = False) -> list[OperatingPoint]:
    memory = UnequalMemory(device, 20.0)
    target = TargetPattern(np.asarray(pattern, dtype=np.complex128), phase_matters=phase_matters)
    return memory.states(memory.hold(target, memory.at_rest))


@pytest.mark.parametrize("base", [LINKED, PAPER, SINGLE], ids=lambda device: device.name)
def test_every_chain_holds_its_target_as_it_really_is(base: Device) -> None:
    device = measured(base, 0.01, gain=0.03)
    blind = Memory(base, 20.0)
    nominal = blind.states(blind.hold(TargetPattern(DOTS.astype(np.complex128)), blind.at_rest))
    for place, (state, other) in enumerate(zip(held(device, DOTS), nominal, strict=True)):
        assert state.outcome is Outcome.OK
        if state.target.any():
            np.testing.assert_allclose(np.abs(truth(device, place, state)), state.target, atol=2e-7)
            assert np.abs(np.abs(truth(device, place, other)) - state.target).max() > 1e-3


def test_rows_of_the_same_numbers_are_planned_once(monkeypatch: pytest.MonkeyPatch) -> None:
    planned = []

    def counted(chain: Any, amplitude: Floats, omega: float) -> Any:
        planned.append(len(amplitude))
        return refine(chain, amplitude, omega)

    monkeypatch.setattr(vibration_module, "refine", counted)
    same = np.tile([1, 0, 1, 0, 1, 1], (6, 1))
    held(LINKED.model_copy(update={"actuators": ()}), same)
    assert planned == [1]
    planned.clear()
    # Rows 1 and 4 are measured, the others are what the profile says: three kinds.
    states = held(measured(LINKED, 0.01, rows=(1, 4)), same)
    assert planned == [1, 1, 1]
    assert states[0] is states[2] is states[3] is states[5]
    assert states[0] is not states[1] is not states[4]


def test_all_chains_share_one_band() -> None:
    states = held(measured(LINKED, 0.01, rows=(1, 4)), np.ones((6, 6)))
    assert len({state.omega for state in states}) == 1


def test_the_cache_knows_whose_plan_it_keeps() -> None:
    one, other = measured(LINKED, 0.01), measured(LINKED, 0.02)
    whole = [PlanCache(device, 20.0) for device in (one, other)]
    parts = [PlanCache(device.alone(0), 20.0, at) for device, at in ((one, whole[0]), (other, whole[1]))]
    again = PlanCache(one.alone(1), 20.0, whole[0])
    state = held(one, DOTS)[0]
    parts[0].keep([(b"state", state)])
    assert parts[0].find([b"state"])[0] is not None
    assert parts[1].find([b"state"]) == [None]
    assert again.find([b"state"]) == [None]
    assert whole[0].find([b"state"]) == [None]


def test_a_second_run_plans_the_same(tmp_path: Path) -> None:
    device = measured(LINKED, 0.01, gain=0.03)
    scene = Scene(GridShape(6, 6), [Frame(TargetPattern(dots.astype(np.complex128)), 1.0) for dots in (DOTS, 1 - DOTS)])
    first, second = (list(plan_scene(scene, device).frames) for _ in range(2))
    for one, other in zip(first, second, strict=True):
        assert one.outcome is Outcome.OK
        for a, b in zip(one.ramps, other.ramps, strict=True):
            assert (a is None) == (b is None)
            if a is not None and b is not None:
                np.testing.assert_array_equal(a.lam, b.lam)
                np.testing.assert_array_equal(a.epsilon, b.epsilon)
        for before, after, ramp in zip(first[0].states, first[1].states, first[1].ramps, strict=True):
            assert ramp is not None
            np.testing.assert_allclose(known(ramp.epsilon)[[0, -1]], [before.epsilon, after.epsilon], rtol=1e-12)
            np.testing.assert_allclose(known(ramp.lam)[[0, -1]], [before.lam, after.lam], rtol=1e-9)


WAVE = 0.1 * np.exp(-0.5j * np.pi * np.arange(6))[None].repeat(6, axis=0)


def test_a_wave_under_links_that_were_measured_alike() -> None:
    """A lam of 1 that makes 1.05, and a drive that makes 1.1: settings change, the wave does not."""
    n = range(6)
    device = PAPER.model_copy(
        update={
            "actuators": tuple(
                Actuator(
                    row=0, col=col, lam=0.0063 if col else None, lam_set=0.006 if col else None,
                    epsilon_per_volt=None if col else 2.2e-3,
                )
                for col in n
            )
        }
    )  # fmt: skip
    states = held(device, WAVE, phase_matters=True)
    assert all(state.outcome is Outcome.OK for state in states)
    assert states[0].lam[0] == pytest.approx(states[1].lam[0] / 1.05, rel=1e-6)
    assert abs(states[0].epsilon) == pytest.approx(abs(states[1].epsilon) / 1.1, rel=1e-6)
    felt = truth(device, 0, states[0])
    turn = np.exp(-1j * np.angle(np.vdot(WAVE[0], felt)))
    np.testing.assert_allclose(felt * turn, WAVE[0], atol=5e-4 * 0.1)


def test_a_wave_over_actuators_that_differ_a_little_is_made_and_over_others_refused() -> None:
    """One lam and one drive cannot make up for six frequencies; the nearest and the reason are told."""
    near = held(measured(PAPER, 2e-7), WAVE, phase_matters=True)
    assert all(state.outcome is Outcome.OK for state in near)
    for state in held(measured(PAPER, 5e-3), WAVE, phase_matters=True):
        assert state.outcome is Outcome.UNREACHABLE
        assert state.lacking


def test_links_that_differ_under_one_lam_are_told() -> None:
    for place, state in enumerate(held(measured(PAPER, 0.0, gain=0.03), WAVE, phase_matters=True)):
        assert state.outcome is Outcome.UNREACHABLE
        assert "its links differ by up to" in state.lacking
        assert "it lacks a lam per link" in state.lacking
        away = np.abs(truth(measured(PAPER, 0.0, gain=0.03), place, state) - state.phasor / PAPER.full_scale).max()
        assert away < 1e-6


def test_links_that_cannot_be_set_far_enough_are_told() -> None:
    coupling = LINKED.coupling.model_copy(update={"lam": LINKED.coupling.lam.model_copy(update={"max": 0.8})})
    tight = LINKED.model_copy(update={"coupling": coupling})
    weak = tuple(Actuator(row=0, col=col, lam=0.003, lam_set=0.006) for col in range(1, 6))
    states = held(tight.model_copy(update={"actuators": weak}), np.tile([1, 1, 0, 0, 1, 1], (6, 1)))
    assert states[0].outcome is Outcome.UNREACHABLE
    assert states[0].lam.max() <= 0.8
