"""Exact answers and invariants of the steady rungs."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.integrate import solve_ivp

from chainsim import Chain, Closure, Outcome, Setting, solve

DELTA = 5.3006e-3
STEADY = ["linear", "one_harmonic", "harmonic_balance"]

chains = st.builds(Chain, n=st.integers(1, 7), delta=st.floats(1e-3, 0.2), beta=st.sampled_from([-1.0, 1.0]))
drives = st.floats(1e-6, 3e-3)
omegas = st.floats(0.8, 1.6)


@pytest.mark.parametrize("lag_deg", [30, 60, 90, 120, 150])
@pytest.mark.parametrize("a", [0.005, 0.02])
def test_uniform_wave(lag_deg, a):
    """Physics section 2: lam = delta omega / sin phi, omega^2 = 1 + 3/4 beta a^2 + lam (1 - cos phi)."""
    phi, omega = np.radians(lag_deg), 1.0
    for _ in range(60):
        lam = DELTA * omega / np.sin(phi)
        omega = np.sqrt(1 - 0.75 * a * a + lam * (1 - np.cos(phi)))
    kappa = 1 - omega**2 - 0.75 * a * a
    chain = Chain(6, DELTA, -1.0)
    setting = Setting.of(chain, epsilon=a * abs(kappa + 1j * DELTA * omega), lam=lam, omega=omega)
    from chainsim import balance_near

    wave = (a * np.exp(-1j * phi * np.arange(6)) / np.exp(1j * np.angle(kappa + 1j * DELTA * omega)))[None]
    response = balance_near(chain, setting, wave, tol=1e-9)
    # The third harmonic, left out of the closed form, shifts it by about a^2/32 over the sharpness a^2/delta of stages.
    assert np.abs(response.phasor[0]) == pytest.approx(np.full(6, a), rel=2e-3)
    assert np.degrees(response.phase_step[0]) == pytest.approx(np.full(5, -lag_deg), abs=0.2)


@settings(max_examples=30, deadline=None)
@given(chain=chains, epsilon=drives, omega=omegas, lam=st.floats(1e-4, 0.3))
def test_each_pair_of_multipliers_has_the_damping_as_product(chain, epsilon, omega, lam):
    setting = Setting.of(chain, epsilon=epsilon, lam=lam, omega=omega)
    for rung in STEADY:
        response = solve(chain, setting, tol=1e-8, rung=rung)
        product = response.multipliers[0].prod(axis=1)
        if response.locked[0]:
            assert np.abs(product - np.exp(-chain.delta * setting.period[0])).max() <= 1e-10


@settings(max_examples=25, deadline=None)
@given(chain=chains, epsilon=drives, omega=omegas, lam=st.floats(1e-4, 0.3), turn=st.floats(-3, 3))
def test_a_phase_of_the_drive_turns_every_phasor(chain, epsilon, omega, lam, turn):
    plain = Setting.of(chain, epsilon=epsilon, lam=lam, omega=omega)
    turned = Setting.of(chain, epsilon=epsilon, lam=lam, omega=omega, phase=turn)
    a = solve(chain, plain, tol=1e-9, rung="harmonic_balance")
    b = solve(chain, turned, tol=1e-9, rung="harmonic_balance")
    if a.outcome[0] is Outcome.OK and b.outcome[0] is Outcome.OK:
        size = np.abs(a.phasor).max()
        assert np.abs(b.phasor - a.phasor * np.exp(1j * turn)).max() <= 1e-7 * size
        assert np.abs(b.third - a.third * np.exp(3j * turn)).max() <= 1e-7 * size


@pytest.mark.parametrize("rung", STEADY)
@pytest.mark.parametrize("strength", [1e-12, 1e-3, 1e6, 1e12])
def test_the_size_of_beta_is_only_a_scale_of_length(rung, strength):
    plain, strong = Chain(4, 0.01, -1.0), Chain(4, 0.01, -strength)
    a = solve(plain, Setting.of(plain, epsilon=2e-3, lam=0.02, omega=1.03), tol=1e-9, rung=rung)
    scaled = Setting.of(strong, epsilon=2e-3 / np.sqrt(strength), lam=0.02, omega=1.03)
    b = solve(strong, scaled, tol=1e-9, rung=rung)
    assert b.phasor * np.sqrt(strength) == pytest.approx(a.phasor, rel=1e-11)
    assert b.multipliers == pytest.approx(a.multipliers, rel=1e-9)
    assert b.error_estimate == pytest.approx(a.error_estimate, rel=1e-3, abs=1e-12)


@settings(max_examples=20, deadline=None)
@given(rung=st.sampled_from(STEADY), closure=st.sampled_from(list(Closure)), power=st.integers(-30, 30))
def test_a_power_of_four_in_beta_changes_not_a_bit(rung, closure, power):
    plain, strong = Chain(4, 0.01, -1.0, closure), Chain(4, 0.01, -(4.0**power), closure)
    forces: dict[str, Any] = {"epsilon": 2e-3, "preload": 0.01, "bias": np.array([0.0, 0.01, -0.02, 0.0])}
    less = {name: value / 2.0**power for name, value in forces.items()}
    a = solve(plain, Setting.of(plain, **forces, lam=0.006, omega=1.03), tol=1e-9, rung=rung)
    b = solve(strong, Setting.of(strong, **less, lam=0.006, omega=1.03), tol=1e-9, rung=rung)
    for name in ("harmonics", "mean"):
        assert np.array_equal(getattr(b, name) * 2.0**power, getattr(a, name))
    for name in ("multipliers", "branch", "error_estimate", "outcome"):
        assert np.array_equal(getattr(b, name), getattr(a, name))


@pytest.mark.parametrize("rung", STEADY)
def test_a_batch_answers_each_setting_as_alone(rung):
    rng = np.random.default_rng(3)
    chain, size = Chain(5, 0.01, -1.0), 200
    batch = Setting.of(
        chain, epsilon=rng.uniform(1e-4, 3e-3, size), lam=rng.uniform(0.005, 0.05, (size, 4)),
        omega=rng.uniform(0.97, 1.1, size),
    )  # fmt: skip
    together = solve(chain, batch, tol=1e-9, rung=rung)
    for index in range(0, size, 20):
        alone = solve(chain, batch[index : index + 1], tol=1e-9, rung=rung)
        assert alone.outcome[0] is together.outcome[index]
        assert together.phasor[index] == pytest.approx(alone.phasor[0], rel=1e-8, nan_ok=True)
        assert together.multipliers[index] == pytest.approx(alone.multipliers[0], rel=1e-6, nan_ok=True)


def test_equal_rows_give_equal_responses():
    chain = Chain(6, DELTA, -1.0)
    setting = Setting.of(chain, epsilon=np.full(70, 4e-4), lam=6.131e-3, omega=1.0)
    response = solve(chain, setting, tol=1e-6, rung="harmonic_balance")
    assert (response.harmonics == response.harmonics[:1]).all()
    assert (response.multipliers == response.multipliers[:1]).all()


@pytest.mark.parametrize("rung", STEADY)
def test_the_order_of_equal_settings_changes_nothing(rung):
    chain, rng = Chain(6, DELTA, -1.0), np.random.default_rng(8)
    kinds = rng.uniform(1e-4, 2e-3, 5)
    order = rng.permutation(np.repeat(np.arange(5), 16))
    one, other = (
        solve(chain, Setting.of(chain, epsilon=kinds[rows], lam=6.131e-3, omega=1.01), tol=1e-6, rung=rung)
        for rows in (np.sort(order), order)
    )
    back = np.argsort(order, kind="stable")
    assert np.array_equal(one.harmonics, other.harmonics[back])
    assert np.array_equal(one.multipliers, other.multipliers[back])


def test_base_point_of_the_performance_notes():
    chain = Chain(6, 6.1e-3, -1.0)
    response = solve(chain, Setting.of(chain, epsilon=4e-4, lam=6.131e-3, omega=1.0), tol=1e-6)
    assert np.abs(response.phasor[0]) == pytest.approx([0.0600, 0.0492, 0.0381, 0.0284, 0.0207, 0.0149], abs=6e-5)


@settings(max_examples=20, deadline=None)
@given(beta=st.floats(-1e-9, 1e-9), epsilon=drives, omega=st.floats(1.05, 1.5))
def test_all_rungs_agree_as_beta_goes_to_zero(beta, epsilon, omega):
    chain = Chain(3, 0.02, beta)
    setting = Setting.of(chain, epsilon=epsilon, lam=0.01, omega=omega)
    answers = [solve(chain, setting, tol=1e-9, rung=rung).phasor for rung in STEADY]
    for other in answers[1:]:
        assert np.abs(other - answers[0]).max() <= 1e-7 * np.abs(answers[0]).max()


@pytest.mark.parametrize(("beta", "preload", "bias"), [(-1.0, 0, 0), (1.0, 0, 0), (-1.0, 0.1, 0.02), (1.0, 0.3, -0.2)])
def test_the_orbit_closes_under_dop853(beta, preload, bias):
    """An independent look: a period of the full equations from the series' own state comes back to it."""
    chain = Chain(3, 0.05, beta)
    omega, lam = 1.15, np.array([0.1, 0.25])
    setting = Setting.of(chain, epsilon=0.06, lam=lam, omega=omega, preload=preload, bias=bias, phase=0.3)
    response = solve(chain, setting, tol=1e-12, rung="harmonic_balance")
    assert response.outcome[0] is Outcome.OK
    order = np.arange(1, response.harmonics.shape[1] + 1)[:, None]
    start = np.concatenate(
        [
            response.mean[0] + response.harmonics[0].real.sum(axis=0),
            (1j * omega * order * response.harmonics[0]).real.sum(axis=0),
        ]
    )

    def flow(tau, y):
        z, v = y[:3], y[3:]
        push = np.array([0.06 * np.cos(omega * tau + 0.3) + preload, *(lam * (z[:2] - z[1:]))]) + bias
        return np.concatenate([v, push - 0.05 * v - z - beta * z**3])

    end = solve_ivp(flow, (0, 2 * np.pi / omega), start, method="DOP853", rtol=1e-13, atol=1e-15).y[:, -1]
    assert np.abs(end - start).max() <= 1e-10


def test_multipliers_against_dop853():
    chain = Chain(1, 0.03, -1.0)
    omega = 1.05
    setting = Setting.of(chain, epsilon=0.05, lam=0, omega=omega, preload=0.1)
    response = solve(chain, setting, tol=1e-12, rung="harmonic_balance")
    order = np.arange(1, response.harmonics.shape[1] + 1)

    def orbit(tau):
        return response.mean[0, 0] + (response.harmonics[0, :, 0] * np.exp(1j * omega * order * tau)).real.sum()

    def flow(tau, y):
        stiffness = 1 - 3 * orbit(tau) ** 2
        return [y[1], -0.03 * y[1] - stiffness * y[0], y[3], -0.03 * y[3] - stiffness * y[2]]

    end = solve_ivp(flow, (0, 2 * np.pi / omega), [1, 0, 0, 1], method="DOP853", rtol=1e-12, atol=1e-14).y[:, -1]
    wanted = np.linalg.eigvals(end.reshape(2, 2).T)
    found = response.multipliers[0, 0]
    assert min(np.abs(found - wanted).max(), np.abs(found[::-1] - wanted).max()) <= 1e-9


def test_ring_without_cubic_term():
    """Closed form for equal links: the loop gain is the product of stage gains."""
    chain = Chain(6, 0.05, 0.0, Closure.RING)
    omega, lam, epsilon = 0.97, 0.02, 1e-3
    response = solve(chain, Setting.of(chain, epsilon=epsilon, lam=lam, omega=omega), tol=1e-9)
    impedance = 1 + lam - omega**2 + 0.05j * omega
    gain = lam / impedance
    wanted = epsilon / impedance * gain ** np.arange(6) / (1 - gain**6)
    assert response.outcome[0] is Outcome.OK
    assert response.phasor[0] == pytest.approx(wanted, rel=1e-12)
    exponents = np.roots([1, 0.05, 1 + lam - lam * np.exp(1j * np.pi / 3)])
    nearest = np.abs(response.multipliers.reshape(-1)[:, None] - np.exp(exponents * 2 * np.pi / omega)).min(axis=0)
    assert nearest.max() <= 1e-10


def test_ring_loses_stability_at_the_papers_lambda():
    """Physics section 3: delta = 5.3006e-3 puts the threshold of modes 1 and 2 at lam = 6.13e-3."""
    chain = Chain(6, DELTA, 0.0, Closure.RING)
    outcomes = [
        solve(chain, Setting.of(chain, epsilon=1e-4, lam=lam, omega=1.0), tol=1e-6).outcome[0]
        for lam in (6.10e-3, 6.16e-3)
    ]
    assert outcomes == [Outcome.OK, Outcome.ESCAPED]
