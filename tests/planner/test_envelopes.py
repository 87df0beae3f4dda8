"""Ways between vibrating patterns: their ends in closed form, their whole by integrating the full equations."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicHermiteSpline

from chainsim import Chain, Setting, solve
from planner.closed_forms.links import drive_for, links_for
from planner.transitions.envelopes import EnvelopeRamp, change, fall, rise

DELTA, OMEGA = 5.3006e-3, 1.8**0.5
TAU_PER_S = 2 * np.pi * 133.13
DURATION = 0.35 * TAU_PER_S
NODES = 1201
Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]


def chain_of(n: int) -> Chain:
    return Chain(n=n, delta=DELTA, beta=-1.0)


def steady(chain: Chain, amplitude: Floats) -> tuple[Floats, Complexes, complex]:
    """Links, phasors (the last real) and drive phasor of one profile, stage by stage in one harmonic."""
    lam = links_for(chain, amplitude, OMEGA)
    kappa = 1 - OMEGA**2 + 0.75 * chain.beta * amplitude**2 + 1j * chain.delta * OMEGA
    phasor = np.empty(chain.n, dtype=np.complex128)
    phasor[-1] = amplitude[-1]
    for m in range(chain.n - 1, 0, -1):
        phasor[m - 1] = phasor[m] * (kappa[m] + lam[m - 1]) / lam[m - 1]
    return lam, phasor, complex(kappa[0] * phasor[0])


def standing(chain: Chain, amplitude: Floats) -> Floats:
    """State at tau = 0 of the steady motion under the closed-form settings, with all its harmonics.

    A start without the third harmonic would ring, and later stages magnify that by hundreds.
    """
    lam, _, drive = steady(chain, amplitude)
    setting = Setting.of(chain, epsilon=abs(drive), phase=np.angle(drive), lam=lam, omega=OMEGA)
    harmonics = solve(chain, setting, tol=1e-11, rung="harmonic_balance", start="rest").harmonics[0]
    k = np.arange(1, len(harmonics) + 1)[:, None]
    return np.concatenate([harmonics.sum(axis=0).real, (1j * OMEGA * k * harmonics).sum(axis=0).real])


def felt_after(chain: Chain, ramp: EnvelopeRamp, start: Floats, periods: int) -> Complexes:
    """First harmonics under the full equations in each period after the first ramp, shape (periods, n).

    The drive is Re(epsilon(tau) e^{i omega tau}), then its last value for ever; `start` is the state (z, v) at 0.
    """
    nodes = np.linspace(0.0, DURATION, ramp.epsilon.shape[1])
    drive = CubicHermiteSpline(nodes, ramp.epsilon[0], ramp.epsilon_slope[0])
    links = CubicHermiteSpline(nodes, ramp.lam[0], ramp.lam_slope[0])
    n = chain.n

    def slope(tau: float, state: Floats) -> Floats:
        z, v = state[:n], state[n:]
        at = min(tau, DURATION)
        out = np.empty(2 * n)
        out[:n] = v
        out[n:] = -chain.delta * v - z - chain.beta * z**3
        out[n] += (complex(drive(at)) * np.exp(1j * OMEGA * tau)).real
        out[n + 1 :] += links(at) * (z[:-1] - z[1:])
        return out

    period = 2 * np.pi / OMEGA
    points = DURATION + period * np.arange(periods * 32) / 32
    ran = solve_ivp(slope, (0.0, points[-1]), start, "DOP853", t_eval=points, rtol=1e-10, atol=1e-13)
    assert ran.success
    turned = ran.y[:n] * np.exp(-1j * OMEGA * points)
    found: NDArray[np.complex128] = 2 * turned.reshape(n, periods, 32).mean(axis=2).T
    return found


profiles = st.lists(st.floats(0.1, 1.0), min_size=6, max_size=6).map(lambda p: 0.05 * np.array(p))


@settings(max_examples=40)
@given(profiles, profiles)
def test_change_joins_the_steady_settings(before: Floats, after: Floats) -> None:
    chain = chain_of(6)
    ramp = change(chain, before[None], after[None], OMEGA, DURATION, 31)
    for node, profile in ((0, before), (-1, after)):
        lam, _, drive = steady(chain, profile)
        if ramp.possible[0]:
            np.testing.assert_allclose(ramp.lam[0, node], lam, rtol=1e-8)
            np.testing.assert_allclose(ramp.epsilon[0, node], drive, rtol=1e-8)
        np.testing.assert_allclose(np.abs(drive), drive_for(chain, profile[0], OMEGA), rtol=1e-12)
    # Nothing moves at the ends, so the ramp can be followed by standing still.
    np.testing.assert_allclose(ramp.epsilon_slope[0, [0, -1]], 0.0, atol=1e-9)
    np.testing.assert_allclose(ramp.lam_slope[0, [0, -1]], 0.0, atol=1e-9)


def test_on_off_changes_are_possible_in_the_usual_time() -> None:
    rng = np.random.default_rng(1)
    before, after = np.where(rng.random((2, 50, 6)) < 0.5, 0.1, 1.0) * 0.05
    ramp = change(chain_of(6), before, after, OMEGA, DURATION, 61)
    assert ramp.possible.all()
    assert ramp.lam.min() > 0
    np.testing.assert_array_equal(ramp.peak, np.maximum(before, after))


def test_no_change_is_a_constant() -> None:
    chain, profile = chain_of(6), 0.05 * np.array([1, 0.1, 1, 0.1, 0.1, 1])
    ramp = change(chain, profile[None], profile[None], OMEGA, DURATION, 21)
    lam, _, drive = steady(chain, profile)
    np.testing.assert_allclose(ramp.lam[0], np.broadcast_to(lam, (21, 5)), rtol=1e-10)
    np.testing.assert_allclose(ramp.epsilon[0], drive, rtol=1e-10)


def test_asked_too_fast_it_says_so_for_that_ramp_only() -> None:
    chain = chain_of(6)
    before = 0.02 * np.array([[1, 1, 0.1, 0.1, 1, 1], [1, 1, 1, 1, 1, 1]])
    after = 0.02 * np.array([[0.1, 1, 0.1, 1, 0.1, 1], [1, 1, 1, 1, 1, 1]])
    fast = change(chain, before, after, OMEGA, 0.1 * TAU_PER_S, 121)
    assert fast.possible.tolist() == [False, True]
    assert np.all(np.isfinite(fast.lam))
    assert change(chain, before, after, OMEGA, 0.35 * TAU_PER_S, 121).possible.all()


def test_rise_and_fall_begin_and_end_at_rest_and_at_the_profile() -> None:
    chain = chain_of(4)
    amplitude = np.array([[0.05, 0.005, 0.05, 0.05], [0.0, 0.0, 0.0, 0.0]])
    lam, _, drive = steady(chain, amplitude[0])
    up, down = (way(chain, amplitude, OMEGA, DURATION, 101) for way in (rise, fall))
    for ramp, silent, loud in ((up, 0, -1), (down, -1, 0)):
        assert ramp.epsilon[0, silent] == pytest.approx(0, abs=1e-14)
        assert ramp.epsilon[0, loud] == pytest.approx(drive, rel=1e-10)
        np.testing.assert_allclose(ramp.lam[0], np.broadcast_to(lam, (101, 3)))
        np.testing.assert_array_equal(ramp.lam_slope, 0.0)
        np.testing.assert_array_equal(ramp.epsilon[1], 0.0)
        np.testing.assert_allclose(ramp.peak[0], amplitude[0], rtol=0.6)
        assert np.all(ramp.peak[0] >= amplitude[0] * (1 - 1e-9))
        assert ramp.possible.all()


def test_the_way_up_without_softening_is_the_way_down_upside_down() -> None:
    """A linear chain superposes: rise + fall is the steady drive."""
    chain = Chain(n=4, delta=DELTA, beta=0.0)
    amplitude = np.array([[0.05, 0.005, 0.05, 0.02]])
    up, down = (way(chain, amplitude, OMEGA, DURATION, 101) for way in (rise, fall))
    np.testing.assert_allclose(up.epsilon + down.epsilon, np.full((1, 101), up.epsilon[0, -1]), atol=1e-12)


@pytest.mark.parametrize("way", ["rise", "change"])
def test_slopes_are_the_derivatives(way: str) -> None:
    chain = chain_of(4)
    before, after = 0.05 * np.array([[[1, 0.1, 1, 0.1]], [[0.1, 1, 1, 1]]])
    if way == "rise":
        ramp = rise(chain, after, OMEGA, DURATION, NODES)
    else:
        ramp = change(chain, before, after, OMEGA, DURATION, NODES)
    step = DURATION / (NODES - 1)
    for values, slopes in ((ramp.epsilon, ramp.epsilon_slope), (ramp.lam, ramp.lam_slope)):
        numeric = (8 * (values[:, 3:-1] - values[:, 1:-3]) - (values[:, 4:] - values[:, :-4])) / (12 * step)
        np.testing.assert_allclose(slopes[:, 2:-2], numeric, atol=1e-5 * np.abs(slopes).max() + 1e-15)


def test_rises_without_links_say_so() -> None:
    steep = np.array([[0.001, 0.05], [0.05, 0.05]])
    assert rise(Chain(n=2, delta=DELTA, beta=0.0), steep, 1.01, DURATION, 11).possible.tolist() == [False, True]


RISES = [(0.05, [1, 0.1, 1]), (0.02, [0.1, 1, 1, 0.1]), (0.05, [1, 1, 0.1, 0.1, 1, 1])]


@pytest.mark.parametrize(("a", "profile"), RISES, ids=lambda value: str(value))
def test_after_a_rise_every_actuator_stands(a: float, profile: list[float]) -> None:
    chain, amplitude = chain_of(len(profile)), a * np.array(profile)
    ramp = rise(chain, amplitude[None], OMEGA, DURATION, NODES)
    felt = felt_after(chain, ramp, np.zeros(2 * chain.n), periods=8)
    np.testing.assert_allclose(felt, np.broadcast_to(steady(chain, amplitude)[1], felt.shape), atol=1e-3 * a)


CHANGES = [
    (0.05, [1, 0.1, 1], [0.1, 1, 0.1]),
    (0.02, [0.1, 0.1, 0.1, 0.1], [1, 0.1, 1, 1]),
    (0.05, [1, 1, 0.1, 0.1, 1, 1], [0.1, 1, 0.1, 1, 0.1, 1]),
]


@pytest.mark.parametrize(("a", "old", "new"), CHANGES, ids=lambda value: str(value))
def test_after_a_change_every_actuator_stands(a: float, old: list[float], new: list[float]) -> None:
    chain, before, after = chain_of(len(old)), a * np.array(old), a * np.array(new)
    ramp = change(chain, before[None], after[None], OMEGA, DURATION, NODES)
    assert ramp.possible[0]
    felt = felt_after(chain, ramp, standing(chain, before), periods=8)
    np.testing.assert_allclose(felt, np.broadcast_to(steady(chain, after)[1], felt.shape), atol=1e-3 * a)


def test_after_a_fall_every_actuator_rests() -> None:
    chain, amplitude = chain_of(4), 0.05 * np.array([1, 0.1, 1, 1])
    ramp = fall(chain, amplitude[None], OMEGA, DURATION, NODES)
    felt = felt_after(chain, ramp, standing(chain, amplitude), periods=8)
    assert np.abs(felt).max() < 1e-3 * 0.05


def test_a_single_actuator_changes_from_and_to_nothing() -> None:
    chain = chain_of(1)
    for before, after in ((0.0, 0.05), (0.05, 0.0), (0.05, 0.01)):
        ramp = change(chain, np.array([[before]]), np.array([[after]]), OMEGA, DURATION, NODES)
        assert ramp.lam.shape == (1, NODES, 0)
        start = standing(chain, np.array([before])) if before else np.zeros(2)
        felt = felt_after(chain, ramp, start, periods=4)
        np.testing.assert_allclose(felt, after, atol=1e-3 * 0.05)
