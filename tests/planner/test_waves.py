"""Waves: closed forms against the equations, refinement, steps of lam and converter, what is lacking, and the ways."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, strategies as st

from chainsim import Amplifier, Chain, Closure, Coupling, Device, Outcome, Setting, Span, load_device, solve
from encoders import GridShape, PatternKind, Region, TargetPattern, bars, levels, plane_wave, regions, walking_bars
from planner import OperatingPoint
from planner.closed_forms.wave_fit import Freedom, MotionTarget, fit, response_to
from planner.margins import noise_error
from planner.targets import AmplitudeTarget, WalkingTarget, WaveTarget, targets_of
from planner.transitions.waves import enter_wave, leave_wave
from planner.waves.two_tones import MAIN, ORDERS, two_tones
from planner.waves.wave_fit import GOOD
from planner.waves.wave_forms import lag_and_ratio, wave_for, wave_on
from planner.waves.wave_state import wave_state

PAPER, LINKED, COMMON, SINGLE = (
    load_device(name) for name in ("paper-6x6", "linked-6x6", "paper-6x6-common", "independent-6x6")
)
CHAIN = PAPER.chain
GRID = GridShape(6, 6)


def wave(device: Device, lag_deg: float, level: float = 0.3) -> OperatingPoint:
    (first, *_) = targets_of(plane_wave(GRID, lag_deg=lag_deg, level=level), device)
    assert isinstance(first, WaveTarget)
    return wave_state(device, first)


@given(st.floats(5, 175), st.floats(0.3, 1.2), st.floats(0.001, 0.02))
def test_the_closed_form_solves_the_stage(lag_deg: float, ratio: float, amplitude: float) -> None:
    """A_m / A_{m-1} of a linear chain is r e^{-i lag}, and so is what the linear rung finds."""
    linear = Chain(n=4, delta=CHAIN.delta, beta=0.0)
    made = wave_for(linear, amplitude=amplitude, lag=math.radians(lag_deg), ratio=ratio)
    setting = Setting.of(
        linear, epsilon=abs(made.epsilon), phase=float(np.angle(made.epsilon)), lam=made.lam, omega=made.omega
    )
    phasor = solve(linear, setting, tol=1e-9, rung="linear", start="rest").phasor[0]
    wanted = amplitude * (ratio * np.exp(-1j * math.radians(lag_deg))) ** np.arange(4)
    np.testing.assert_allclose(phasor, wanted, rtol=1e-7)
    lag, found = lag_and_ratio(phasor)
    assert math.degrees(lag) == pytest.approx(lag_deg)
    assert found == pytest.approx(ratio)


@pytest.mark.parametrize("closure", [Closure.OPEN, Closure.RING])
def test_the_closed_form_of_a_ring_too(closure: Closure) -> None:
    chain = Chain(n=6, delta=CHAIN.delta, beta=-1.0, closure=closure)
    made = wave_for(chain, amplitude=0.02, lag=math.radians(80))
    wanted = 0.02 * np.exp(-1j * math.radians(80) * np.arange(6))
    held = response_to(chain, made, wanted)
    np.testing.assert_allclose(held.phasor[0], wanted, atol=1e-5 * 0.02)


@pytest.mark.parametrize("long", [True, False])
def test_a_given_lam_carries_two_lags(long: bool) -> None:
    made = wave_on(CHAIN, amplitude=0.02, lam=7e-3, long=long)
    assert made is not None
    assert made.lam == pytest.approx(7e-3, rel=1e-6)
    assert wave_on(CHAIN, amplitude=0.02, lam=5e-3, long=long) is None


def test_refinement_finds_settings_that_were_hidden() -> None:
    """From a wave of another lag and amplitude back to that of known settings, whatever the start."""
    hidden = wave_for(CHAIN, amplitude=0.05, lag=math.radians(100))
    shape = 0.05 * np.exp(-1j * math.radians(100) * np.arange(6))
    target = response_to(CHAIN, hidden, shape).phasor[0]
    start = wave_for(CHAIN, amplitude=0.045, lag=math.radians(95))
    found = fit(
        CHAIN, MotionTarget(target, np.ones(6, dtype=np.bool_), np.ones(6)),
        start, Freedom(1, 0.0, 0.05, 0.9, 1.1),
    )  # fmt: skip
    assert found.error < 1e-8
    assert found.point.omega == pytest.approx(hidden.omega, rel=1e-6)
    assert found.point.lam[0] == pytest.approx(hidden.lam[0], rel=1e-5)
    assert found.point.epsilon == pytest.approx(hidden.epsilon, rel=1e-5)


@pytest.mark.parametrize("lag_deg", [15, 60, 90, 120, 165])
@pytest.mark.parametrize("device", [PAPER, LINKED, COMMON], ids=lambda device: device.name)
def test_waves_are_held(device: Device, lag_deg: float) -> None:
    state = wave(device, lag_deg)
    assert state.outcome is Outcome.OK
    wanted = 0.3 * np.exp(-1j * math.radians(lag_deg) * np.arange(6))
    np.testing.assert_allclose(state.phasor / device.full_scale, wanted, atol=1e-3 * 0.3)
    assert state.phase is not None
    assert 0 < state.margins.multiplier < 1
    assert 0 < state.margins.volts < 1
    assert 0 < state.margins.slew < 1
    assert 0 < state.margins.well < 0.8


def test_lam_takes_steps_and_the_error_says_so() -> None:
    coarse = COMMON.model_copy(update={"coupling": COMMON.coupling.model_copy(update={"bits": 10})})
    rough, fine = wave(coarse, 90), wave(COMMON, 90)
    for device, state in ((coarse, rough), (COMMON, fine)):
        step = device.coupling.lam_step
        steps = state.lam / step
        np.testing.assert_allclose(steps, np.rint(steps), atol=1e-6)
    assert fine.error < 1e-3 * 0.3 < rough.error
    assert rough.outcome is Outcome.UNREACHABLE
    assert "bits of lam" in rough.lacking


def test_a_coarse_converter_is_said_to_be_one() -> None:
    coarse = COMMON.model_copy(update={"amplifier": COMMON.amplifier.model_copy(update={"bits": 10})})
    state = wave(coarse, 150)
    assert state.outcome is Outcome.UNREACHABLE
    assert state.lacking.endswith("it lacks bits")


def test_the_noise_error_is_that_of_shaped_noise() -> None:
    """One actuator: the variance of a resonator under a one-sided density S of noise there is pi S / (2 delta)."""
    amplifier = Amplifier(volts=100.0, slew_v_per_s=3e5, rate_hz=8000, bits=12)
    device = SINGLE.model_copy(update={"amplifier": amplifier})
    step = amplifier.volt_step * device.epsilon_per_volt
    rate = amplifier.rate_hz / device.tau_per_s
    density = step**2 / 12 / (math.pi * rate) * (2 * math.sin(1 / rate / 2)) ** 4
    expected = math.sqrt(density * math.pi / (2 * device.delta))
    found = noise_error(device, OperatingPoint(0.01 + 0j, np.zeros(0), 1.0))
    assert found == pytest.approx(expected, rel=0.05)
    assert noise_error(SINGLE, OperatingPoint(0.01 + 0j, np.zeros(0), 1.0)) == 0


def narrowed(**changes: object) -> Device:
    return PAPER.model_copy(update=changes)


LACKING = {
    "backwards": (PAPER, -60, 0.3, "drive for every actuator"),
    "lam": (PAPER, 4, 0.3, "range of lam"),
    "omega": (narrowed(omega=Span(min=0.99, max=1.002)), 150, 0.3, "range of omega"),
    "linearity": (PAPER, 45, 1.0, "linearity"),
    "volts": (narrowed(epsilon_per_volt=1e-6), 150, 0.3, "volts"),
    "slew": (narrowed(amplifier=PAPER.amplifier.model_copy(update={"slew_v_per_s": 100.0})), 150, 0.3, "slew"),
    "fixed": (
        narrowed(coupling=Coupling(scope="fixed", lam=Span(min=7e-3, max=7e-3))), 90, 0.3, "lam per link",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", LACKING)
def test_what_is_lacking_is_named_and_the_nearest_given(case: str) -> None:
    device, lag_deg, level, cure = LACKING[case]
    state = wave(device, lag_deg, level)
    assert state.outcome is Outcome.UNREACHABLE
    assert cure in state.lacking.split("it lacks", 1)[1]
    assert np.all(np.isfinite(state.phasor))
    assert state.phasor.any()


def test_the_largest_part_that_stands_is_the_nearest() -> None:
    state = wave(PAPER, 45, 1.0)
    part = float(np.abs(state.phasor[0])) / PAPER.full_scale
    assert 0 < part < 1
    assert wave(PAPER, 45, part).outcome is Outcome.OK
    assert wave(PAPER, 45, min(1.0, part + 1 / 32 + 1e-3)).outcome is Outcome.UNREACHABLE


def test_a_fixed_lam_has_its_own_waves() -> None:
    device = narrowed(coupling=Coupling(scope="fixed", lam=Span(min=7e-3, max=7e-3)))
    made = wave_on(device.chain, amplitude=0.3 * device.full_scale, lam=7e-3, long=True)
    assert made is not None
    stiff = 1 - made.omega**2 + 0.75 * device.beta * (0.3 * device.full_scale) ** 2 + made.lam[0]
    lag = math.degrees(math.atan2(device.delta * made.omega, stiff))
    assert wave(device, lag).outcome is Outcome.OK


def test_links_stop_a_wave_half_way() -> None:
    part = regions(GRID, [Region(0, 6, 0, 4, plane_wave(GRID, lag_deg=60))])
    (first, *_) = targets_of(part, LINKED)
    assert isinstance(first, WaveTarget)
    state = wave_state(LINKED, first)
    assert state.outcome is Outcome.OK
    np.testing.assert_allclose(np.abs(state.phasor) / LINKED.full_scale, [1, 1, 1, 1, 0, 0], atol=1e-3)


def test_no_formula_a_search_and_the_same_answer_twice() -> None:
    """Phasors that some links do hold, found without knowing them."""
    lam = np.array([0.006, 0.008, 0.005, 0.007, 0.006])
    setting = Setting.of(LINKED.chain, epsilon=2e-4, lam=lam, omega=1.002)
    phasor = solve(LINKED.chain, setting, tol=1e-9, rung="harmonic_balance", start="rest").phasor[0]
    turned = phasor / LINKED.full_scale * np.exp(-1j * np.angle(phasor[0]))
    target = TargetPattern(np.tile(turned, (6, 1)), PatternKind.SINE, phase_matters=True)
    (first, *_) = targets_of(target, LINKED)
    assert isinstance(first, WaveTarget)
    state, again = wave_state(LINKED, first), wave_state(LINKED, first)
    assert state.outcome is Outcome.OK
    np.testing.assert_allclose(state.phasor / LINKED.full_scale, turned, atol=1e-3 * np.abs(turned).max())
    assert again.epsilon == state.epsilon
    np.testing.assert_array_equal(again.lam, state.lam)


@given(st.integers(-180, 180), st.integers(-180, 180), st.floats(0.1, 1))
def test_rows_of_a_wave_are_one_target_but_for_a_turn(lag: float, row_lag: float, level: float) -> None:
    targets = list(targets_of(plane_wave(GRID, lag_deg=lag, row_lag_deg=row_lag, level=level), PAPER))
    shared = {one.unturned for one in targets if isinstance(one, WaveTarget)}
    assert len(shared) == len({one.key for one in shared}) == 1
    (wave,) = shared
    whole = np.array([wave.levels * np.exp(1j * (wave.phases + one.turn)) for one in targets])
    np.testing.assert_allclose(
        whole, plane_wave(GRID, lag_deg=lag, row_lag_deg=row_lag, level=level).amplitude, atol=1e-7
    )


def test_amplitudes_alone_are_no_wave() -> None:
    for pattern in (bars(GRID, vertical=True, width=1, gap=1), levels(np.full((6, 6), 0.4))):
        assert all(isinstance(one, AmplitudeTarget) for one in targets_of(pattern, PAPER))
    mixed = regions(GRID, [Region(0, 2, 0, 6, plane_wave(GRID, lag_deg=60)), Region(2, 6, 0, 6, levels(np.eye(6)))])
    assert [isinstance(one, WaveTarget) for one in targets_of(mixed, PAPER)] == [True] * 2 + [False] * 4
    waves = list(targets_of(plane_wave(GRID, lag_deg=-70), SINGLE))
    assert all(isinstance(one, AmplitudeTarget) for one in waves)
    assert waves[1].turn == pytest.approx(math.radians(70))


@pytest.mark.parametrize("amplitude", [0.002, 0.01, 0.025])
@pytest.mark.parametrize("width", [1.4, 2.0, 3.0])
def test_two_tones_stand_in_every_stage(amplitude: float, width: float) -> None:
    """The stage equations in the time domain of the beat, with the cubic term written out there."""
    made = two_tones(CHAIN, amplitude=amplitude, width=width)
    assert made is not None
    np.testing.assert_allclose(np.abs(made.phasor[[MAIN, MAIN + 1]]), amplitude, rtol=1e-12)
    assert made.width == pytest.approx(width)
    beat = np.linspace(0, 2 * np.pi, 64, endpoint=False)
    turns = np.exp(1j * np.outer(ORDERS, beat))
    before, here = made.phasor, made.phasor * np.exp(-1j * made.lag)
    motion = here @ turns
    cubic = 0.75 * CHAIN.beta * (np.abs(motion) ** 2 * motion) @ turns.conj().T / 64
    left = (1 - made.omega**2 + 1j * CHAIN.delta * made.omega) * here + cubic - made.lam * (before - here)
    assert np.abs(left).max() < 1e-9 * amplitude
    rate = made.omega[MAIN + 1] - made.omega[MAIN]
    if amplitude == 0.002:
        assert rate == pytest.approx(CHAIN.delta * math.tan(math.pi / 2 / width), rel=0.02)


def test_ways_of_waves_and_tones_end_where_they_should() -> None:
    state = wave(PAPER, 90)
    into, out = enter_wave(PAPER, state, True, GOOD), leave_wave(PAPER, state, True)
    assert into.lacking == "" == out.lacking
    assert into.duration_s < 0.5
    assert into.epsilon is not None
    assert into.epsilon[-1] == pytest.approx(state.epsilon, rel=1e-9)
    assert into.lam is not None
    np.testing.assert_allclose(into.lam[-1], state.lam, rtol=1e-9)
    (tone,) = out.tones
    assert out.epsilon is None
    assert tone.omega == state.omega
    assert tone.epsilon[0] == pytest.approx(state.epsilon, rel=1e-9)
    assert tone.epsilon[-1] == 0


def test_single_actuators_take_tones_of_any_place() -> None:
    states = []
    for one in targets_of(walking_bars(GRID, width=2, level=0.5), SINGLE):
        assert isinstance(one, WalkingTarget)
        states.append(one.place)
    assert states == [0, 1, 2, 3, 4, 5] * 6
