"""Robust settings against nominal ones, judged by harmonic balance and fresh draws."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from chainsim import Chain, Outcome, Setting, load_device, solve
from planner.amplitudes.vibration import Vibration
from planner.closed_forms.links import drive_for, links_for
from planner.operating_point import OperatingPoint
from planner.robustness.robust import RobustError, RobustPlan, Trial, accuracy_needed, robust_plan
from planner.robustness.robust_search import RobustSearch
from planner.robustness.spread import FrameTarget, RelativeSpread, draw, spread_of

Floats = NDArray[np.float64]

DEVICE = load_device("linked-6x6")
CHAIN = DEVICE.chain
PROFILE = np.array([1, 1, 0.1, 0.1, 1, 1])
WISH = FrameTarget(PROFILE[None] + 0j, DEVICE.full_scale)
TRIAL = Trial(CHAIN, WISH, RelativeSpread(f0=0.01), tolerance=0.2, threshold=0.5, count=1000, seed=0)
WELL = 0.8


def closed_form(omega: float, profile: Floats = PROFILE) -> OperatingPoint:
    amplitude = DEVICE.full_scale * profile
    return OperatingPoint(float(drive_for(CHAIN, amplitude[:1], omega)[0]), links_for(CHAIN, amplitude, omega), omega)


@pytest.fixture(scope="module")
def found() -> RobustPlan:
    return robust_plan(DEVICE, TRIAL, closed_form(math.sqrt(1.06)), well_share=WELL)


def test_one_percent_in_natural_frequency_costs_at_most_a_third_of_the_nominal_error(found: RobustPlan) -> None:
    assert found.nominal.report.median > 0.5
    assert found.robust.report.median <= found.nominal.report.median / 3
    assert abs(found.robust.point.epsilon) <= DEVICE.epsilon_max
    assert found.robust.well < WELL
    assert found.robust.report.yield_ > found.nominal.report.yield_


def test_harmonic_balance_confirms_both_medians(found: RobustPlan) -> None:
    """The same ratio with the dearer rung, chain by chain, on draws that neither search nor judge has seen."""
    parts = draw(6, count=60, seed=12345).parts(CHAIN, TRIAL.spread)
    medians = []
    for row in (found.nominal, found.robust):
        errors = []
        for j in range(60):
            chain = Chain.of(6, delta=CHAIN.delta, beta=CHAIN.beta, stiffness=parts.stiffness[:, 0, j])
            setting = Setting.of(chain, epsilon=row.point.epsilon, lam=[row.point.lam], omega=row.point.omega)
            response = solve(chain, setting, tol=1e-6, rung="harmonic_balance", start="rest")
            assert response.outcome[0] is Outcome.OK
            errors.append(np.abs(np.abs(response.phasor[0]) / DEVICE.full_scale - PROFILE).max())
        medians.append(float(np.median(errors)))
        assert medians[-1] == pytest.approx(row.report.median, rel=0.25)
    assert medians[1] <= medians[0] / 3


def test_the_trade_shows_robustness_bought_with_drive(found: RobustPlan) -> None:
    omega = [row.point.omega for row in found.trade]
    volts = [row.volts for row in found.trade]
    expected = [row.report.expected for row in found.trade]
    assert len(found.trade) >= 6
    assert omega == sorted(omega)
    assert volts == sorted(volts)
    assert expected == sorted(expected, reverse=True)
    assert found.robust.report.expected <= min(expected)
    allowed = DEVICE.coupling.lam
    for row in (*found.trade, found.robust):
        assert DEVICE.omega.min <= row.point.omega <= DEVICE.omega.max
        assert np.all((row.point.lam >= allowed.min) & (row.point.lam <= allowed.max))
        assert row.volts <= 1


def test_the_table_and_the_json_say_the_same(found: RobustPlan) -> None:
    lines = found.table().splitlines()
    assert len(lines) == len(found.trade) + 3
    assert lines[1].endswith("nominal")
    assert lines[-1].endswith("robust")
    plain = found.as_dict()
    assert f"{plain['robust']['median']:.4f}" in lines[-1]
    assert plain["robust"]["lam"] == found.robust.point.lam.tolist()
    assert len(plain["trade"]) == len(found.trade)


def test_fewer_volts_leave_less_robustness() -> None:
    poor = DEVICE.model_copy(update={"amplifier": DEVICE.amplifier.model_copy(update={"volts": 8.0})})
    rich = robust_plan(DEVICE, TRIAL, closed_form(math.sqrt(1.06)), well_share=WELL).robust
    found = robust_plan(poor, TRIAL, closed_form(math.sqrt(1.06)), well_share=WELL)
    assert abs(found.robust.point.epsilon) <= poor.epsilon_max * (1 + 1e-12)
    assert found.nominal.report.expected > found.robust.report.expected > 1.2 * rich.report.expected


@pytest.mark.parametrize("phase_matters", [False, True])
def test_the_gradient_is_a_finite_difference(phase_matters: bool) -> None:
    wish = FrameTarget(PROFILE[None] * np.exp(1j * np.arange(6)), DEVICE.full_scale, phase_matters)
    search = RobustSearch(DEVICE, replace(TRIAL, wish=wish), RelativeSpread(f0=0.01, delta=0.1, beta=0.1, lam=0.05))
    held = closed_form(1.2)
    x, h = np.array([*np.log([held.epsilon, *held.lam]), held.omega]), 1e-7
    _, found = search._expected(x, held)
    ends = [[search._expected(x + s * step, held)[0] for s in (1, -1)] for step in h * np.eye(len(x))]
    np.testing.assert_allclose(found, [(up - down) / (2 * h) for up, down in ends], rtol=2e-4, atol=1e-5)


def test_a_searched_setting_is_never_worse_on_its_own_draws() -> None:
    search = RobustSearch(DEVICE, TRIAL, TRIAL.spread)
    rng = np.random.default_rng(0)
    for _ in range(5):
        start = closed_form(rng.uniform(1.1, 1.35), rng.uniform(0.1, 1.0, 6))
        least = search.least(start, free_omega=False)
        logs = [np.array([*np.log([held.epsilon, *held.lam]), held.omega]) for held in (start, least)]
        before, after = (search._expected(x, start)[0] for x in logs)
        assert after <= before
        assert least.omega == start.omega


def test_without_spread_the_robust_setting_is_the_nominal_one() -> None:
    trial = replace(TRIAL, spread=RelativeSpread())
    plan = robust_plan(DEVICE, trial, closed_form(1.3), well_share=WELL)
    assert plan.robust.nominal_error < 1e-12
    assert plan.robust.report.yield_ == 1.0


def test_a_measured_chain_is_planned_exactly() -> None:
    """What a calibration is for: 1 % off and known is as good as not off."""
    rng = np.random.default_rng(1)
    for _ in range(5):
        chain = Chain.of(
            6, delta=CHAIN.delta * rng.uniform(0.8, 1.2, 6), beta=-rng.uniform(0.8, 1.2, 6),
            stiffness=(1 + 0.01 * rng.standard_normal(6)) ** 2,
        )  # fmt: skip
        search = RobustSearch(DEVICE, replace(TRIAL, chain=chain, tolerance=0.01), RelativeSpread(f0=1e-4))
        blind, known = search.row(closed_form(1.35)), search.row(search.least(closed_form(1.35), free_omega=False))
        assert blind.report.yield_ == 0.0
        assert known.report.yield_ >= 0.98
        setting = Setting.of(chain, epsilon=known.point.epsilon, lam=[known.point.lam], omega=1.35)
        felt = np.abs(solve(chain, setting, tol=1e-8, rung="harmonic_balance", start="rest").phasor[0])
        assert np.abs(felt / DEVICE.full_scale - PROFILE).max() < 1e-3


def test_the_accuracy_needed_is_enough_and_hardly_more_is_not() -> None:
    nominal = closed_form(1.35)
    found = accuracy_needed(DEVICE, replace(TRIAL, tolerance=0.1), nominal, share=0.9)
    assert 0.05 < found.factor < 0.9
    assert found.spread == TRIAL.spread.scaled(found.factor)
    assert found.row.report.yield_ >= 0.9
    fresh = replace(TRIAL, tolerance=0.1, seed=777)
    for factor, enough in ((0.9, True), (1.15, False)):
        search = RobustSearch(DEVICE, fresh, found.spread.scaled(factor))
        rows = [search.row(held) for held in (nominal, found.row.point, search.least(nominal, free_omega=False))]
        assert (max(row.report.yield_ for row in rows) >= 0.9) is enough


def test_a_wave_over_weak_coupling_needs_a_hundredth_of_a_percent() -> None:
    device = load_device("paper-6x6")
    a, lag = 0.02, math.pi / 2
    omega2 = 1.0
    for _ in range(60):
        lam = device.delta * math.sqrt(omega2) / math.sin(lag)
        omega2 = 1 + 0.75 * device.beta * a**2 + lam * (1 - math.cos(lag))
    epsilon = a * math.hypot(1 - omega2 + 0.75 * device.beta * a**2, device.delta * math.sqrt(omega2))
    nominal = OperatingPoint(epsilon, np.full(5, lam), math.sqrt(omega2))
    wish = FrameTarget(np.exp(-1j * lag * np.arange(6))[None], a, phase_matters=True)
    trial = Trial(device.chain, wish, RelativeSpread(f0=0.01), tolerance=0.2, threshold=0.5, count=400, seed=0)
    plan = robust_plan(device, trial, nominal, well_share=WELL)
    assert plan.nominal.nominal_error < 1e-9
    assert plan.trade == ()
    assert plan.robust.report.yield_ < 0.05
    assert len(set(plan.robust.point.lam)) == 1
    needed = accuracy_needed(device, trial, nominal, share=0.9)
    assert 1e-4 < needed.spread.f0 < 1e-3
    assert needed.row.report.yield_ >= 0.9


def test_no_accuracy_helps_a_setting_that_cannot_make_the_pattern() -> None:
    device = load_device("paper-6x6")
    trial = Trial(
        device.chain, FrameTarget(PROFILE[None] + 0j, 0.02), RelativeSpread(f0=0.01), 0.05, 0.5, count=50, seed=0
    )
    found = accuracy_needed(device, trial, OperatingPoint(1e-4, np.full(5, 6e-3), 1.0), share=0.9)
    assert found.factor == 0.0
    assert found.row.report.yield_ < 0.9
    easy = accuracy_needed(DEVICE, replace(TRIAL, tolerance=5.0, threshold=0.0), closed_form(1.35), share=0.9)
    assert easy.factor == 1.0


def test_a_planned_state_is_judged_as_it_stands() -> None:
    state = Vibration(DEVICE, 20.0).states(PROFILE[None])[0]
    row = RobustSearch(DEVICE, TRIAL, TRIAL.spread).row(state)
    assert row.nominal_error < 1e-4
    frame = spread_of(DEVICE, [state], TRIAL.spread, tolerance=0.2, threshold=0.5, seed=TRIAL.seed + 1)
    np.testing.assert_allclose(row.report.error, frame.error, rtol=1e-12)


def test_a_nominal_setting_beyond_the_device_is_refused() -> None:
    with pytest.raises(RobustError, match=r"omega 1\.4.*is beyond what linked-6x6 can hold"):
        robust_plan(DEVICE, TRIAL, closed_form(1.4), well_share=WELL)
