"""Several answers at one setting: which there are, which are stable, and how each is reached."""

import numpy as np
import pytest

from chainsim import Branch, Chain, Closure, Outcome, RungError, Setting, solve

CHAIN = Chain(1, 5.3006e-3, -1.0)


def cubic_roots(epsilon, omega, delta, beta):
    """Squared amplitudes of the one-harmonic answers, from numpy.roots."""
    kappa, g, b = 1 - omega**2, delta * omega, 0.75 * beta
    roots = np.roots([b * b, 2 * b * kappa, kappa**2 + g**2, -(epsilon**2)])
    return np.sort(roots.real[np.abs(roots.imag) < 1e-9])


@pytest.mark.parametrize(("epsilon", "omega"), [(1.5e-3, 0.985), (4e-3, 0.96), (4e-4, 1.0), (1e-3, 1.2)])
def test_one_harmonic_has_every_root_of_the_cubic(epsilon, omega):
    setting = Setting.of(CHAIN, epsilon=epsilon, lam=0, omega=omega)
    response = solve(CHAIN, setting, tol=1e-9, rung="one_harmonic", start="all")
    wanted = cubic_roots(epsilon, omega, CHAIN.delta, CHAIN.beta)
    assert np.abs(response.phasor[:, 0]) ** 2 == pytest.approx(wanted, rel=1e-8)
    assert len(wanted) == (3 if omega < 1 else 1)
    if len(wanted) == 3:
        assert response.branch[:, 0].tolist() == [Branch.LOW, Branch.MIDDLE, Branch.HIGH]
        assert response.stable.tolist() == [True, False, True]
        assert response.outcome.tolist() == [Outcome.OK, Outcome.UNSTABLE, Outcome.OK]


def test_harmonic_balance_follows_all_three():
    setting = Setting.of(CHAIN, epsilon=1.5e-3, lam=0, omega=0.985)
    rough = solve(CHAIN, setting, tol=1e-9, rung="one_harmonic", start="all")
    fine = solve(CHAIN, setting, tol=1e-9, rung="harmonic_balance", start="all")
    assert fine.stable.tolist() == [True, False, True]
    assert np.abs(fine.phasor) == pytest.approx(np.abs(rough.phasor), rel=1e-2)
    assert (fine.error_estimate <= 1e-9).all()


def test_a_chain_has_a_tree_of_branches_each_a_true_answer():
    chain = Chain(3, 5.3006e-3, -1.0)
    setting = Setting.of(chain, epsilon=2e-3, lam=6.131e-3, omega=0.99)
    response = solve(chain, setting, tol=1e-9, start="all")
    labels = [tuple(branch) for branch in response.branch]
    assert len(set(labels)) == len(labels) > 3
    assert labels == sorted(labels)
    # Stable exactly when no oscillator is on its middle branch.
    assert [Branch.MIDDLE not in label for label in labels] == response.stable.tolist()
    # The stage equation of the first harmonic holds along every path, up to the third harmonic's share.
    kappa = 1 + 6.131e-3 - 0.99**2 - 0.75 * np.abs(response.phasor) ** 2
    left = (kappa + 1j * chain.delta * 0.99)[:, 1:] * response.phasor[:, 1:]
    assert np.abs(left - 6.131e-3 * response.phasor[:, :-1]).max() <= 1e-4


def test_multipliers_reach_one_at_the_fold():
    setting = Setting.of(CHAIN, epsilon=np.linspace(1.5e-3, 3e-3, 400), lam=0, omega=0.985)
    response = solve(CHAIN, setting, tol=1e-9, rung="harmonic_balance", start="ramp")
    held = response.outcome == Outcome.OK
    edge = int(np.flatnonzero(held)[-1])
    assert 0 < edge < 399
    assert held[: edge + 1].all()
    nearest = np.abs(response.multipliers[: edge + 1, 0] - 1).min(axis=1)
    assert nearest[edge] < 0.25 * nearest[0]


def test_a_ramp_jumps_at_the_fold_where_rest_goes_too():
    setting = Setting.of(CHAIN, epsilon=3e-3, lam=0, omega=0.985)
    assert len(cubic_roots(3e-3, 0.985, CHAIN.delta, CHAIN.beta)) == 1
    by_name = solve(CHAIN, setting, tol=1e-6, rung="harmonic_balance", start="ramp")
    assert by_name.outcome[0] is Outcome.NO_CONVERGENCE
    ramp, rest = (solve(CHAIN, setting, tol=1e-6, start=start) for start in ("ramp", "rest"))
    assert ramp.outcome[0] is rest.outcome[0] is Outcome.OK
    # One answer is left beyond the fold.
    np.testing.assert_allclose(ramp.phasor, rest.phasor, rtol=1e-6)


def test_static_equilibria():
    setting = Setting.of(CHAIN, epsilon=0, lam=0, omega=1, bias=0.2)
    response = solve(CHAIN, setting, tol=1e-9, rung="static", start="all")
    assert np.sort(response.mean[:, 0]) == pytest.approx(np.sort(np.roots([-1, 0, 1, -0.2]).real), rel=1e-12)
    assert response.stable.tolist() == [True, False, False]
    assert response.mean[0, 0] - response.mean[0, 0] ** 3 == pytest.approx(0.2, rel=1e-14)


@pytest.mark.parametrize("beta", [-1.0, -4.0])
def test_static_limit_of_the_well(beta):
    chain = Chain(1, 0.01, beta)
    limit = 2 / (3 * np.sqrt(3 * abs(beta)))
    biases = limit * np.array([[0.5], [0.999], [1.001], [2.0]])
    response = solve(chain, Setting.of(chain, epsilon=0, lam=0, omega=1, bias=biases), tol=1e-9, start="ramp")
    assert response.outcome.tolist() == [Outcome.OK, Outcome.OK, Outcome.ESCAPED, Outcome.ESCAPED]


def test_a_sudden_bias_escapes_sooner_than_a_slow_one():
    """From rest without damping the hilltop is reached at b = sqrt(2/27): the energy there is then 0."""
    chain = Chain(1, 1e-3, -1.0)
    biases = np.sqrt(2 / 27) * np.array([[0.95], [1.05]])
    response = solve(chain, Setting.of(chain, epsilon=0, lam=0, omega=1, bias=biases), tol=1e-6)
    assert response.outcome.tolist() == [Outcome.OK, Outcome.ESCAPED]


def test_auto_from_rest_agrees_with_integration_where_it_did_not_integrate():
    from chainsim.reach.rest import sure_from_rest
    from chainsim.time_domain.ode import steady_from_rest

    rng = np.random.default_rng(11)
    chain, size = Chain(4, 6.1e-3, -1.0), 120
    setting = Setting.of(
        chain, epsilon=np.exp(rng.uniform(np.log(3e-4), np.log(3e-2), size)),
        lam=rng.uniform(3e-3, 0.3, (size, 3)), omega=rng.uniform(0.95, 1.4, size),
    )  # fmt: skip
    steady = solve(chain, setting, tol=1e-8, rung="harmonic_balance")
    sure = sure_from_rest(chain, setting, steady)
    assert 20 < sure.sum() < size - 10
    whole = steady_from_rest(chain, setting[sure], tol=1e-8, max_periods=60_000)
    assert (whole.outcome == Outcome.OK).all()
    size_of = np.abs(whole.phasor).max(axis=1)
    assert (np.abs(whole.phasor - steady.phasor[sure]).max(axis=1) <= 1e-6 * size_of).all()


def test_branches_of_a_ring_come_the_lowest_first():
    ring = Chain(3, 0.02, -1.0, Closure.RING)
    setting = Setting.of(ring, epsilon=0.02, lam=0.05, omega=0.95)
    listed = solve(ring, setting, tol=1e-8, start="all")
    assert len(listed) > 3
    low = solve(ring, setting, tol=1e-8, start="ramp")
    np.testing.assert_allclose(listed.phasor[0], low.phasor[0], rtol=1e-6)
    assert 1 <= listed.stable.sum() < len(listed)


def test_refusals_name_the_cure():
    ring = Chain(6, 0.01, -1.0, Closure.RING)
    setting = Setting.of(ring, epsilon=1e-3, lam=0.01, omega=1.0)
    with pytest.raises(RungError, match="expected one setting of a ring or bidirectional chain, got 2"):
        solve(ring, Setting.of(ring, epsilon=[1e-3, 2e-3], lam=0.01, omega=1.0), tol=1e-6, start="all")
    with pytest.raises(RungError, match="envelope"):
        solve(ring, setting, tol=1e-6, rung="envelope", start="all")
    two = Setting.of(CHAIN, epsilon=[1e-3, 2e-3], lam=0, omega=1.0)
    with pytest.raises(RungError, match="one setting, got 2"):
        solve(CHAIN, two, tol=1e-6, rung="one_harmonic", start="all")
    with pytest.raises(RungError, match="expected one of auto, static"):
        solve(CHAIN, two, tol=1e-6, rung="spline")
    with pytest.raises(ValueError, match="expected one of rest, ramp, all, got 'slow'"):
        solve(CHAIN, two, tol=1e-6, start="slow")
    with pytest.raises(ValueError, match="tol: expected a number from 1e-12 to 1"):
        solve(CHAIN, two, tol=float("nan"))
    with pytest.raises(ValueError, match="made for 1 oscillators"):
        solve(Chain(2, 0.01, 0.0), two, tol=1e-6)


@pytest.mark.parametrize("beta", [-1.0, 1.0])
def test_biased_chains_agree_with_integration(beta):
    from chainsim import steady_from_rest

    rng = np.random.default_rng(8)
    chain, size = Chain(3, 2e-2, beta), 60
    setting = Setting.of(
        chain, epsilon=np.exp(rng.uniform(np.log(1e-3), np.log(0.1), size)), lam=rng.uniform(0.01, 0.5, (size, 2)),
        omega=rng.uniform(0.9, 1.5, size), preload=rng.uniform(-0.2, 0.2, size), bias=rng.uniform(-0.1, 0.1, (size, 3)),
    )  # fmt: skip
    found = solve(chain, setting, tol=1e-7)
    truth = steady_from_rest(chain, setting, tol=1e-9, max_periods=60_000)
    assert found.outcome.tolist() == truth.outcome.tolist()
    ok = truth.outcome == Outcome.OK
    assert ok.sum() > size // 2
    big = np.abs(truth.phasor[ok]).max(axis=1)
    assert (np.abs(found.phasor[ok] - truth.phasor[ok]).max(axis=1) <= 1e-6 * big).all()
    assert (np.abs(found.mean[ok] - truth.mean[ok]).max(axis=1) <= 1e-6 * big).all()
