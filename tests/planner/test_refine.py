"""Refined settings, put back into harmonic balance and into the full equations."""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from chainsim import Chain, Outcome, Response, Setting, solve
from planner.amplitudes import refine as refine_module
from planner.amplitudes.refine import Refined, refine
from planner.closed_forms.links import drive_for, links_for

CHAIN = Chain(n=6, delta=5.3006e-3, beta=-1.0)
OMEGA = 1.35
Floats = NDArray[np.float64]


def response_to(found: Refined, chain: Chain = CHAIN) -> NDArray[np.complex128]:
    """Phasors that harmonic balance gives for the settings as they stand, phase of the drive included."""
    setting = Setting.of(
        chain, epsilon=np.abs(found.epsilon), phase=np.angle(found.epsilon), lam=found.lam, omega=OMEGA
    )
    return solve(chain, setting, tol=1e-11, rung="harmonic_balance", start="rest").phasor


def check(found: Refined, amplitude: Floats) -> None:
    assert set(found.outcome) == {Outcome.OK}
    phasor = response_to(found)
    scale = amplitude.max(axis=1, keepdims=True)
    np.testing.assert_array_less(np.abs(np.abs(phasor) - amplitude) / scale, 1.1e-9)
    np.testing.assert_allclose(found.phasor, phasor, rtol=0, atol=1e-10)
    assert np.all(np.abs(phasor[:, -1].imag) < 1e-10)
    assert np.all(phasor[:, -1].real > 0)
    assert np.all(np.abs(np.abs(phasor) - amplitude).max(axis=1) <= found.error + 1e-11)


@settings(max_examples=25)
@given(st.lists(st.lists(st.floats(0.1, 1.0), min_size=6, max_size=6), min_size=1, max_size=4))
def test_random_profiles_have_the_wanted_moduli(profiles: list[list[float]]) -> None:
    amplitude = 0.05 * np.array(profiles)
    check(refine(CHAIN, amplitude, OMEGA), amplitude)


@pytest.mark.parametrize("full_scale", [1e-6, 0.05, 0.15, 0.3])
def test_all_on_off_profiles_at_any_size(full_scale: float) -> None:
    amplitude = full_scale * np.maximum(np.array(list(product((1.0, 0.0), repeat=6))), 0.1)
    check(refine(CHAIN, amplitude, OMEGA), amplitude)


def test_random_profiles_deep_in_the_softening_well() -> None:
    amplitude = 0.3 * np.random.default_rng(7).uniform(0.1, 1.0, (40, 6))
    check(refine(CHAIN, amplitude, OMEGA), amplitude)


def test_the_closed_form_alone_would_not_do() -> None:
    """What refinement is for: one harmonic misses by more than a thousand times the goal."""
    amplitude = 0.3 * np.array([[1.0, 0.1, 1.0, 1.0, 0.1, 1.0]])
    setting = Setting.of(
        CHAIN, epsilon=drive_for(CHAIN, amplitude[:, 0], OMEGA), lam=links_for(CHAIN, amplitude, OMEGA), omega=OMEGA
    )
    phasor = solve(CHAIN, setting, tol=1e-10, rung="harmonic_balance", start="rest").phasor
    assert np.abs(np.abs(phasor) - amplitude).max() / 0.3 > 1e-6


@pytest.mark.parametrize("full_scale", [0.05, 0.3])
def test_few_steps_are_enough(full_scale: float, monkeypatch: pytest.MonkeyPatch) -> None:
    solves = 0

    def counted(*arguments: Any, **named: Any) -> Response:
        nonlocal solves
        solves += 1
        return solve(*arguments, **named)

    monkeypatch.setattr(refine_module, "solve", counted)
    amplitude = full_scale * np.random.default_rng(3).uniform(0.1, 1.0, (30, 6))
    assert set(refine(CHAIN, amplitude, OMEGA).outcome) == {Outcome.OK}
    assert 1 <= solves <= 5


def test_profiles_refined_together_are_as_refined_alone() -> None:
    amplitude = 0.1 * np.random.default_rng(5).uniform(0.1, 1.0, (5, 6))
    together = refine(CHAIN, amplitude, OMEGA)
    for i in range(5):
        alone = refine(CHAIN, amplitude[i : i + 1], OMEGA)
        np.testing.assert_allclose(together.lam[i], alone.lam[0], rtol=1e-7)
        np.testing.assert_allclose(together.epsilon[i], alone.epsilon[0], rtol=1e-7)


def test_a_profile_without_answer_does_not_spoil_the_others() -> None:
    """Near the hilltop some profiles have no stable answer: they say so, and say no number is right."""
    amplitude = np.array([[0.9, 0.09, 0.9, 0.045, 0.9, 0.9], [0.05, 0.005, 0.05, 0.05, 0.005, 0.05]])
    found = refine(CHAIN, amplitude, OMEGA)
    assert found.outcome[0] is not Outcome.OK
    assert found.outcome[1] is Outcome.OK
    assert np.abs(np.abs(found.phasor[1]) - amplitude[1]).max() < 1e-9 * 0.05
    assert np.all(np.isfinite(found.lam))


def test_a_single_actuator() -> None:
    chain = Chain(n=1, delta=5.3006e-3, beta=-1.0)
    amplitude = np.array([[0.05], [0.2]])
    found = refine(chain, amplitude, OMEGA)
    assert found.lam.shape == (2, 0)
    np.testing.assert_allclose(response_to(found, chain), amplitude, rtol=2e-9)


def test_the_full_equations_repeat_on_it() -> None:
    """DOP853 from the planned motion: after five periods the motion is still the planned one."""
    amplitude = 0.15 * np.array([[1.0, 1.0, 0.1, 0.1, 1.0, 1.0]])
    found = refine(CHAIN, amplitude, OMEGA)
    setting = Setting.of(
        CHAIN, epsilon=np.abs(found.epsilon), phase=np.angle(found.epsilon), lam=found.lam, omega=OMEGA
    )
    harmonics = solve(CHAIN, setting, tol=1e-11, rung="harmonic_balance", start="rest").harmonics[0]
    k = np.arange(1, len(harmonics) + 1)[:, None]
    start = np.concatenate([harmonics.sum(axis=0).real, (1j * OMEGA * k * harmonics).sum(axis=0).real])
    links = np.concatenate([[0.0], found.lam[0]])
    epsilon = found.epsilon[0]

    def slope(tau: float, state: Floats) -> Floats:
        z, v = state[:6], state[6:]
        force = links * (np.roll(z, 1) - z)
        force[0] = (epsilon * np.exp(1j * OMEGA * tau)).real
        return np.concatenate([v, force - CHAIN.delta * v - z - CHAIN.beta * z**3])

    period = 2 * np.pi / OMEGA
    points = np.linspace(4 * period, 5 * period, 65)
    ran = solve_ivp(slope, (0.0, 5 * period), start, "DOP853", t_eval=points, rtol=1e-11, atol=1e-13)
    turning = np.exp(-1j * OMEGA * points[:-1])
    phasor = 2 * np.mean(ran.y[:6, :-1] * turning, axis=1)
    np.testing.assert_allclose(np.abs(phasor), amplitude[0], atol=2e-8)
    np.testing.assert_allclose(phasor, found.phasor[0], atol=2e-8)
