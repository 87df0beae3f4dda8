"""The closed forms of a chain with a lam per link, put back into the equation they solve."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, strategies as st
from numpy.typing import NDArray

from chainsim import Chain, Spread
from planner.closed_forms.links import detuning_gain, drive_for, links_for, stage_constant

Floats = NDArray[np.float64]

DELTA = 5.3006e-3
amplitudes = st.lists(st.floats(0.005, 0.3), min_size=2, max_size=8)


def passed_on(chain: Chain, before: float, here: float, lam: float, omega: float) -> float:
    """|A_m| of the one-harmonic stage equation when |A_{m-1}| = before."""
    kappa = 1.0 - omega**2 + 0.75 * chain.beta * here**2
    return abs(lam * before / (kappa + lam + 1j * chain.delta * omega))


@given(amplitudes, st.floats(1.05, 1.6), st.sampled_from([-1.0, 0.0, 0.5]))
def test_links_solve_the_stage_equation(profile: list[float], omega: float, beta: float) -> None:
    chain = Chain(n=len(profile), delta=DELTA, beta=beta)
    a = np.array(profile)
    kappa = 1.0 - omega**2 + 0.75 * beta * a[1:] ** 2
    assume(np.all(kappa < -1e-3))
    lam = links_for(chain, a, omega)
    needed = DELTA * omega * np.sqrt(np.maximum((a[1:] / a[:-1]) ** 2 - 1, 0))
    np.testing.assert_array_equal(np.isnan(lam), np.abs(kappa) < needed)
    for before, here, link in zip(a[:-1], a[1:], lam, strict=True):
        if np.isfinite(link):
            assert link > 0
            assert passed_on(chain, before, here, link, omega) == pytest.approx(here, rel=1e-9)


@pytest.mark.parametrize("profile", [[0.05, 0.05], [0.05, 0.005], [0.005, 0.05], [0.05, 0.04999999999]])
def test_equal_falling_and_rising_steps(profile: list[float]) -> None:
    chain = Chain(n=2, delta=DELTA, beta=-1.0)
    (lam,) = links_for(chain, np.array(profile), 1.35)
    assert passed_on(chain, profile[0], profile[1], lam, 1.35) == pytest.approx(profile[1], rel=1e-12)


def test_an_equal_step_in_closed_form() -> None:
    """kappa^2 + 2 kappa lam + delta^2 omega^2 = 0 has one root."""
    chain = Chain(n=2, delta=DELTA, beta=-1.0)
    kappa = stage_constant(chain, np.array(0.05), 1.35)
    (lam,) = links_for(chain, np.full(2, 0.05), 1.35)
    assert lam == pytest.approx(float(-(kappa**2 + (DELTA * 1.35) ** 2) / (2 * kappa)), rel=1e-12)


def test_links_join_falling_and_rising_steps_without_a_jump() -> None:
    chain = Chain(n=2, delta=DELTA, beta=-1.0)
    before = 0.05 * np.linspace(0.9, 1.1, 2001)
    lam = links_for(chain, np.stack([before, np.full_like(before, 0.05)], axis=1), 1.35)[:, 0]
    assert np.abs(np.diff(lam)).max() < 2e-4
    assert np.all(np.diff(lam) < 0)


def test_the_steepest_rise_is_where_the_closed_form_ends() -> None:
    """|kappa| = delta omega sqrt(r^2 - 1) is the largest ratio r."""
    chain, omega = Chain(n=2, delta=DELTA, beta=0.0), 1.02
    steepest = np.hypot(1.0, abs(1 - omega**2) / (DELTA * omega))
    for ratio, possible in ((0.999, True), (1.001, False)):
        lam = links_for(chain, np.array([1.0, ratio * steepest]), omega)
        assert bool(np.isfinite(lam[0])) is possible


def test_without_detuning_only_falling_steps_exist() -> None:
    chain = Chain(n=4, delta=DELTA, beta=0.0)
    lam = links_for(chain, np.array([1.0, 0.5, 0.5, 0.6]), 0.98)
    assert np.isfinite(lam[0])
    assert np.isnan(lam[1:]).all()


def test_links_are_batched() -> None:
    chain = Chain(n=3, delta=DELTA, beta=-1.0)
    profiles = np.array([[[0.05, 0.01, 0.05], [0.02, 0.03, 0.02]]])
    made = links_for(chain, profiles, 1.3)
    assert made.shape == (1, 2, 2)
    for row in range(2):
        np.testing.assert_array_equal(made[0, row], links_for(chain, profiles[0, row], 1.3))


@given(st.floats(0.001, 0.3), st.floats(0.8, 1.5), st.sampled_from([-1.0, 0.0, 1.0]))
def test_drive_solves_the_first_equation(a: float, omega: float, beta: float) -> None:
    chain = Chain(n=1, delta=DELTA, beta=beta)
    epsilon = drive_for(chain, np.array(a), omega)
    assert abs(epsilon / (1 - omega**2 + 0.75 * beta * a**2 + 1j * DELTA * omega)) == pytest.approx(a, rel=1e-12)


def scanned_gain(chain: Chain, amplitude: Floats, lam: Floats, omega: float) -> float:
    """Largest linear response at any frequency over what the drive makes at omega, by looking everywhere."""
    stiffness = 1.0 + np.concatenate([[0.0], lam])
    centres = np.sqrt(stiffness)
    fine = np.linspace(-2 * chain.delta, 2 * chain.delta, 4001)
    at = (centres[:, None] + fine).ravel()
    response = np.ones(len(at), dtype=np.complex128)
    worst = 0.0
    epsilon = drive_for(chain, amplitude[:1], omega)[0]
    for m in range(chain.n):
        forward = 1.0 if m == 0 else lam[m - 1]
        response = response * forward / (stiffness[m] - at**2 + 1j * chain.delta * at)
        worst = max(worst, float(np.abs(response).max()) / (amplitude[m] / epsilon))
    return worst


@pytest.mark.parametrize("profile", [[1, 1, 0.1, 0.1, 1, 1], [1, 0.1, 1, 0.1, 1, 0.1], [0.1, 0.05, 0.1], [1.0]])
def test_noise_gain_against_a_scan_of_all_frequencies(profile: list[float]) -> None:
    chain = Chain(n=len(profile), delta=DELTA, beta=-1.0)
    a = 0.05 * np.array(profile)
    lam = links_for(chain, a, 1.35)
    gain = detuning_gain(chain, a[None], lam[None], 1.35)
    assert gain.shape == (1,)
    wanted = scanned_gain(chain, a, lam, 1.35)
    # The planner looks at each stage's own resonance; neighbours pull the true peak a little aside.
    assert 0.7 * wanted <= gain[0] <= wanted * (1 + 1e-6)


UNEQUAL = Chain.of(4, delta=[5e-3, 6e-3, 4e-3, 7e-3], beta=[-1.0, -0.5, -2.0, 0.3], stiffness=[1.01, 0.98, 1.03, 0.97])


@given(
    st.lists(st.floats(0.005, 0.05), min_size=4, max_size=4),
    st.floats(1.2, 1.5),
)
def test_oscillators_with_numbers_of_their_own(profile: list[float], omega: float) -> None:
    """Drive and links put into the equations of one harmonic, oscillator by oscillator, give the profile back."""
    a = np.array(profile)
    lam = links_for(UNEQUAL, a, omega)
    assume(bool(np.isfinite(lam).all()))
    z = complex(drive_for(UNEQUAL, a[:1], omega)[0])
    numbers = zip(a, np.append(0.0, lam), UNEQUAL.stiffness, UNEQUAL.deltas, UNEQUAL.betas, strict=True)
    for m, (size, link, stiffness, delta, beta) in enumerate(numbers):
        push = z if m == 0 else link * z
        z = push / (stiffness + link - omega**2 + 0.75 * beta * size**2 + 1j * delta * omega)
        assert abs(z) == pytest.approx(size, rel=1e-7)


def test_equal_oscillators_may_be_said_one_by_one() -> None:
    """A chain whose numbers are given for each gives what it gives when they are one for all."""
    one = Chain(6, 5.3006e-3, -1.0)
    each = replace(one, spread=Spread((5.3006e-3,) * 6, (-1.0,) * 6, (1.0,) * 6))
    a = 0.05 * np.array([[1, 1, 0.1, 0.1, 1, 1], [0.1, 1, 0.1, 1, 0.1, 1]])
    np.testing.assert_allclose(links_for(each, a, 1.35), links_for(one, a, 1.35), rtol=1e-13)
    np.testing.assert_allclose(drive_for(each, a[:, 0], 1.35), drive_for(one, a[:, 0], 1.35), rtol=1e-13)
    lam = links_for(one, a, 1.35)
    np.testing.assert_allclose(detuning_gain(each, a, lam, 1.35), detuning_gain(one, a, lam, 1.35), rtol=1e-9)
