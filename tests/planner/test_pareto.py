"""The Pareto set of a frame: none beats another, the ways do what they say, and complaints."""

import itertools
import json
import math
from dataclasses import astuple

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.integrate import solve_ivp

from chainsim import load_device
from encoders import GridShape, levels, plane_wave, walking_bars
from planner.analysis.pareto import RAMPS_S, pareto_of
from planner.analysis.pareto_point import ALIKE, RESOLUTION, ParetoError, ParetoPoint, front_of
from planner.analysis.pareto_still import PERIODS, ways_of_deflections
from planner.targets import WaveTarget, targets_of
from planner.transitions.waves import enter_wave
from planner.waves.wave_fit import GOOD
from planner.waves.wave_state import wave_state
from tests.support.known import known

SHAPE = GridShape(6, 6)
ROW = [1, 1, 0, 0, 1, 1]


def frame_of(*rows):
    return levels(np.array([*rows, *[[0] * 6] * (6 - len(rows))], dtype=float))


@pytest.fixture(scope="module")
def linked():
    return pareto_of(frame_of(ROW, [0, 1, 0, 1, 0, 1]), load_device("linked-6x6"))


@pytest.fixture(scope="module")
def single():
    return pareto_of(frame_of(ROW), load_device("independent-6x6"))


def costs(point):
    return np.array([point.ramp_s, point.drive, point.error, point.spread, point.noise_gain])


POINTS = st.lists(
    st.builds(
        ParetoPoint, omega=st.just(1.2), ramp_s=st.sampled_from(RAMPS_S), contrast_db=st.just(20.0),
        error=st.floats(0, 1), made=st.just(0.0), drive=st.floats(0, 1), noise_gain=st.floats(1, 1e6),
        spread=st.floats(0, 1),
    ), max_size=12,
)  # fmt: skip


@given(POINTS)
def test_the_front_has_none_that_another_beats_and_beats_all_it_leaves_out(points):
    front = front_of(points)
    assert all(point in points for point in front)
    for one, other in itertools.permutations(front, 2):
        assert one is other or not np.all(costs(one) <= costs(other)) or np.all(costs(one) == costs(other))
    for point in points:
        as_good = [np.all(costs(one) <= (1 + ALIKE) * costs(point) + RESOLUTION) for one in front]
        assert point in front or any(as_good)


def test_fronts_keep_to_the_limits_and_none_beats_another(linked, single):
    for found in (linked, single):
        assert found.points
        assert found.tried >= found.unfit + len(found.points)
        for one, other in itertools.permutations(found.points, 2):
            assert not np.all(costs(one) <= costs(other))
        for point in found.points:
            assert 0 < point.drive <= 1
            assert all(math.isfinite(value) for value in costs(point))


def test_the_error_is_the_contrast_and_what_the_way_leaves(linked):
    for point in linked.points:
        floor = 10 ** (-point.contrast_db / 20)
        assert abs(point.error - floor) <= point.made + 1e-12
    slow = [point for point in linked.points if point.ramp_s == max(RAMPS_S) and point.omega > 1.2]
    assert slow
    assert all(point.made < 1e-2 for point in slow)


def test_haste_costs_drive_and_contrast_robustness(linked):
    by_kind: dict[tuple[float, float], list[ParetoPoint]] = {}
    for point in linked.points:
        by_kind.setdefault((point.omega, point.contrast_db), []).append(point)
    chains = [sorted(points, key=lambda one: one.ramp_s) for points in by_kind.values() if len(points) > 1]
    assert chains
    for points in chains:
        assert all(fast.drive > slow.drive for fast, slow in itertools.pairwise(points))
    most = {
        contrast: min(point.spread for point in linked.points if point.contrast_db == contrast)
        for contrast in {point.contrast_db for point in linked.points}
    }
    ordered = [most[contrast] for contrast in sorted(most)]
    assert ordered == sorted(ordered)
    assert len(ordered) > 1


def test_one_actuator_alone_is_its_closed_form(single):
    device = load_device("independent-6x6")
    for point in single.points:
        kappa = 1 - point.omega**2 + 0.75 * device.beta * device.full_scale**2
        steady = device.full_scale * math.hypot(kappa, device.delta * point.omega) / device.epsilon_max
        assert point.drive >= steady * (1 - 1e-3)
        assert point.error < 1e-3
        if abs(kappa) > 0.1:
            # d|A|/|A| = -dk/kappa, and the frequency's 1 % is 2 % of the stiffness.
            assert point.spread == pytest.approx(0.02 / abs(kappa), rel=0.05)


def test_plain_json_and_every_number_named(single):
    found = json.loads(json.dumps(single.as_dict(), allow_nan=False))
    assert len(found["points"]) == len(single.points)
    assert found["points"][0]["contrast_db"] is None
    assert len(found["points"][0]) == len(astuple(single.points[0]))


def test_the_same_frame_gives_the_same_front(single):
    assert pareto_of(frame_of(ROW, ROW), load_device("independent-6x6")) == single


def ringing(device, periods, stiffness):
    """Largest deflection around the mean after a way of full scale of an actuator of another stiffness, linear."""
    tau = 2 * np.pi * periods * np.linspace(0.0, 1.0, 4001)
    x = tau / tau[-1]
    step = sum(
        (-1) ** k * math.comb(5 + k, k) * math.comb(11, 5 - k) * x ** (6 + k) for k in range(6)
    )  # fmt: skip
    slope = np.gradient(step, tau)
    bend = np.gradient(slope, tau)
    force = step + device.delta * slope + bend
    answer = solve_ivp(
        lambda t, y: [y[1], np.interp(t, tau, force) - device.delta * y[1] - stiffness * y[0]],
        (0, tau[-1] + 4 * np.pi), [0.0, 0.0], "DOP853", np.linspace(tau[-1], tau[-1] + 4 * np.pi, 400), rtol=1e-9,
        atol=1e-12, max_step=0.1,
    )  # fmt: skip
    return np.ptp(answer.y[0]) / 2


def test_deflections_are_traded_by_their_closed_forms():
    device = load_device("paper-6x6")
    points, tried = ways_of_deflections(np.array([[1.0, 0.0, 1.0, 0.0, 0.0, 1.0]]), device)
    assert tried == len(points) == len(PERIODS)
    still = points[-1].spread
    # d z/z = -2 df/(1 + 3 beta z^2).
    assert still == pytest.approx(0.02 / (1 - 3 * device.full_scale**2), rel=0.05)
    for periods, point in zip(PERIODS, points, strict=True):
        assert point.ramp_s == pytest.approx(periods / device.f0_hz)
        assert point.error < 1e-9
        assert point.drive == pytest.approx(device.full_scale * (1 - device.full_scale**2) / device.bias_max, rel=0.05)
        rings = math.sqrt(max(point.spread**2 - still**2, 0.0))
        if periods <= 2:
            assert rings == pytest.approx(ringing(device, periods, 1.02), rel=0.1, abs=2e-4)
    found = pareto_of(frame_of(ROW), device)
    ordered = [point.spread for point in found.points]
    assert len(ordered) > 1
    assert ordered == sorted(ordered, reverse=True)


def test_deflections_that_cannot_be_held_have_no_way():
    device = load_device("paper-6x6").model_copy(update={"full_scale": 0.4})
    assert ways_of_deflections(np.ones((1, 6)), device) == ([], len(PERIODS))


@pytest.mark.slow
def test_waves_trade_time_against_drive():
    device = load_device("paper-6x6")
    pattern = plane_wave(SHAPE, lag_deg=60, level=0.2)
    found = pareto_of(pattern, device)
    assert len(found.points) > 1
    for fast, slow in itertools.pairwise(found.points):
        assert fast.ramp_s < slow.ramp_s
        assert fast.drive > slow.drive
    target = next(iter(targets_of(pattern, device)))
    assert isinstance(target, WaveTarget)
    planned = enter_wave(device, wave_state(device, target), True, GOOD)
    assert found.points[0].ramp_s == planned.duration_s
    assert found.points[0].drive == pytest.approx(np.abs(known(planned.epsilon)).max() / device.epsilon_max)
    assert all(point.error <= 2e-3 for point in found.points)


def test_phases_of_uncoupled_actuators_fix_nothing():
    device = load_device("independent-6x6")
    wave, flat = plane_wave(SHAPE, lag_deg=90, level=0.5), levels(np.full((6, 6), 0.5))
    assert pareto_of(wave, device) == pareto_of(flat, device)


@pytest.mark.parametrize(
    ("pattern", "device", "words"),
    [
        (walking_bars(SHAPE, width=3), "linked-6x6", "two tones"),
        (plane_wave(SHAPE, lag_deg=60, level=0.2), "paper-6x6-ring", "is of rings"),
        (plane_wave(SHAPE, lag_deg=-90), "paper-6x6", "cannot make it: waves travel away"),
        (frame_of(ROW), "paper-6x6-ring", "has nothing to trade"),
        (frame_of(), "linked-6x6", "nothing is felt"),
    ],
)
def test_complaints(pattern, device, words):
    with pytest.raises(ParetoError, match=words):
        pareto_of(pattern, load_device(device))
