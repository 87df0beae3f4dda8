"""Each steady rung's claimed order, measured, and the honesty of its error estimate."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from chainsim import (
    DEFLECTION,
    RUNGS,
    TERMS,
    VIBRATION,
    Chain,
    Closure,
    Outcome,
    Setting,
    Start,
    balance_near,
    load_rung,
    solve,
)

CHAIN = Chain(3, 0.05, -1.0)


def away(rung, epsilon, **more):
    """True relative error of the phasors and the estimate, at a drive off resonance."""
    setting = Setting.of(CHAIN, epsilon=epsilon, lam=0.2, omega=1.2, **more)
    truth = solve(CHAIN, setting, tol=1e-12, rung="harmonic_balance")
    rough = solve(CHAIN, setting, tol=1e-12, rung=rung)
    size = np.abs(truth.phasor).max()
    return np.abs(rough.phasor - truth.phasor).max() / size, rough.error_estimate[0]


@pytest.mark.parametrize(("rung", "power"), [("linear", 2.0), ("one_harmonic", 4.0)])
def test_error_falls_with_the_claimed_power_of_amplitude(rung, power):
    drives = 0.04 * 0.5 ** np.arange(4)
    errors = [away(rung, drive)[0] for drive in drives]
    slope = np.polyfit(np.log(drives), np.log(errors), 1)[0]
    assert slope == pytest.approx(power, abs=0.25)


def test_static_error_falls_with_the_square_of_the_drive():
    chain = Chain(2, 0.05, -1.0)
    errors, drives = [], 0.02 * 0.5 ** np.arange(4)
    for drive in drives:
        setting = Setting.of(chain, epsilon=drive, lam=0.2, omega=1.3, bias=0.1)
        truth = solve(chain, setting, tol=1e-12, rung="harmonic_balance")
        errors.append(np.abs(truth.mean - solve(chain, setting, tol=1e-9, rung="static").mean).max())
    assert np.polyfit(np.log(drives), np.log(errors), 1)[0] == pytest.approx(2.0, abs=0.1)


def test_harmonic_balance_is_geometric_in_the_harmonics_it_keeps():
    from chainsim.equations.basis import basis_for
    from chainsim.equations.scaled_chain import ScaledChain
    from chainsim.harmonic_balance.march import march

    chain = Chain(1, 0.1, 1.0)
    scaled = ScaledChain.of(chain, Setting.of(chain, epsilon=1.0, lam=0, omega=1.1))
    truth = march(scaled, basis_for(33, False)).x[0, :2, 0]
    errors = [np.abs(march(scaled, basis_for(order, False)).x[0, :2, 0] - truth).max() for order in (1, 3, 5, 9)]
    assert all(later < 0.1 * sooner for sooner, later in pairwise(errors))


@pytest.mark.parametrize("rung", ["linear", "one_harmonic"])
@pytest.mark.parametrize("epsilon", [1e-3, 1e-2, 5e-2])
def test_estimate_covers_the_error_and_is_within_ten_times(rung, epsilon):
    error, estimate = away(rung, epsilon)
    assert error <= estimate <= 10 * error + 1e-12


def test_estimates_are_honest_over_random_settings():
    rng = np.random.default_rng(7)
    chain, size = Chain(4, 6.1e-3, -1.0), 300
    setting = Setting.of(
        chain,
        epsilon=np.exp(rng.uniform(np.log(3e-5), np.log(6e-4), size)),
        lam=rng.uniform(3e-3, 9e-3, (size, 1)),
        omega=rng.uniform(0.985, 1.015, size),
    )
    truth = solve(chain, setting, tol=1e-11, rung="harmonic_balance")
    rough = solve(chain, setting, tol=1e-6, rung="one_harmonic")
    good = (truth.outcome == Outcome.OK) & (rough.branch == truth.branch).all(axis=1)
    error = np.abs(rough.phasor - truth.phasor).max(axis=1) / np.abs(truth.phasor).max(axis=1)
    covered = error <= rough.error_estimate
    assert good.mean() > 0.95
    assert covered[good].mean() > 0.99
    sharp = rough.error_estimate <= 10 * error + 1e-10
    assert sharp[good].mean() > 0.9


def test_auto_takes_the_cheapest_rung_that_meets_the_tolerance():
    setting = Setting.of(CHAIN, epsilon=1e-2, lam=0.2, omega=1.2)
    assert [solve(CHAIN, setting, tol=tol).rung for tol in (1e-2, 1e-6, 1e-11)] == [
        "linear", "one_harmonic", "harmonic_balance",
    ]  # fmt: skip
    plain = Chain(3, 0.05, 0.0)
    assert solve(plain, setting, tol=1e-12).rung == "linear"
    still = Setting.of(CHAIN, epsilon=0, lam=0.2, omega=1.2, bias=0.05)
    assert solve(CHAIN, still, tol=1e-6).rung == "static"


FEW = Setting.of(CHAIN, epsilon=1e-3, lam=0.2, omega=1.2)


@pytest.mark.parametrize("name", list(RUNGS))
def test_every_rung_states_its_claims(name):
    rung = load_rung(name)
    assert rung.name == name
    assert rung.order
    assert rung.valid
    assert rung.models <= TERMS
    assert rung.answers
    assert rung.answers <= {DEFLECTION, VIBRATION}
    assert rung.adjustable == (name in {"harmonic_balance", "ode"})
    assert rung.full_equations == (name == "ode")
    assert rung.lists_branches == (rung.refusal(CHAIN, FEW, Start.ALL) == "" and name != "linear")
    assert rung.refusal(CHAIN, Setting.of(CHAIN, epsilon=1e-3, lam=0.2, omega=1.2), Start.REST) == ""


def test_an_undriven_chain_has_the_equilibrium_of_static_in_every_steady_rung():
    for closure in Closure:
        for beta in (-1.0, 1.0, 30.0):
            chain = Chain(4, 0.05, beta, closure)
            length = np.sqrt(abs(beta))
            bias = np.array([0.3, -0.1, 0.2, 0.05]) / length
            setting = Setting.of(chain, epsilon=0, lam=0.03, omega=1, preload=[0.05 / length, -0.6 / length], bias=bias)
            wanted = solve(chain, setting, tol=1e-10, rung="static")
            for rung in ("one_harmonic", "harmonic_balance"):
                found = solve(chain, setting, tol=1e-10, rung=rung)
                assert found.outcome.tolist() == wanted.outcome.tolist() == [Outcome.OK] * 2
                assert found.mean == pytest.approx(wanted.mean, rel=1e-9)
                assert not found.harmonics.any()
                assert found.multipliers == pytest.approx(wanted.multipliers, abs=1e-9)


def test_near_the_fold_of_the_well_the_undriven_chain_is_answered_or_not_as_by_static():
    chain = Chain(1, 0.05, -1.0)
    top = 2 / (3 * np.sqrt(3))
    setting = Setting.of(chain, epsilon=0, lam=0, omega=1, preload=[top * (1 - 1e-9), top * (1 + 1e-9)])
    found = solve(chain, setting, tol=1e-3, rung="harmonic_balance")
    assert found.outcome.tolist() == [Outcome.OK, Outcome.NO_CONVERGENCE]
    assert found.mean[0, 0] == pytest.approx(np.sqrt(1 / 3), rel=1e-4)


@pytest.mark.parametrize("closure", ["ring", "bidirectional"])
@pytest.mark.parametrize("beta", [1.0, -1.0])
def test_past_the_fold_of_its_lower_branch_a_coupled_chain_has_the_answer_that_is_left(closure, beta):
    chain = Chain(4, 0.03, beta, closure)
    # The first folds, by the cubic of one harmonic, at 0.043 and 0.022.
    omega = 1.1 if beta > 0 else 0.93
    setting = Setting.of(chain, epsilon=[0.01, 0.025, 0.04, 0.06], lam=0.005, omega=omega)
    found = solve(chain, setting, tol=1e-9, rung="harmonic_balance")
    assert found.outcome.tolist() == [Outcome.OK] * 4
    past = 3 if beta > 0 else 1
    reached = solve(chain, setting[past:], tol=1e-9, rung="ode")
    assert found.phasor[past:] == pytest.approx(reached.phasor, rel=1e-7)
    ramped = solve(chain, setting, tol=1e-9, rung="harmonic_balance", start="ramp")
    assert ramped.outcome.tolist() == [Outcome.OK] * past + [Outcome.NO_CONVERGENCE] * (4 - past)


def test_strongly_driven_hardening_chains_are_answered():
    rng, closed = np.random.default_rng(3), 0
    for _ in range(40):
        n, delta = int(rng.integers(1, 4)), float(rng.uniform(0.05, 0.5))
        chain = Chain(n, delta, 1.0)
        setting = Setting.of(
            chain, epsilon=float(np.exp(rng.uniform(np.log(0.3), np.log(100)))), lam=rng.uniform(0.01, 0.5),
            omega=rng.uniform(0.7, 3),
        )  # fmt: skip
        found = solve(chain, setting, tol=1e-8, rung="harmonic_balance")
        assert found.outcome[0] is not Outcome.NO_CONVERGENCE
        if found.error_estimate[0] <= 1e-8:
            closed += 1
            assert gap_after_a_period(chain, setting, found) <= 1e-4
    assert closed >= 35


def gap_after_a_period(chain, setting, response):
    """Distance, over the state's size, between the series' state at phase 0 and DOP853's a period later."""
    n, omega, lam = chain.n, setting.omega[0], setting.lam[0]
    order = np.arange(1, response.harmonics.shape[1] + 1)[:, None]
    still = response.mean[0] + response.harmonics[0].real.sum(axis=0)
    start = np.concatenate([still, (1j * omega * order * response.harmonics[0]).real.sum(axis=0)])

    def slope(tau, y):
        z, v = y[:n], y[n:]
        push = np.zeros(n)
        push[0] = setting.epsilon[0] * np.cos(omega * tau)
        push[1:] = lam[1:] * (z[:-1] - z[1:])
        return np.concatenate([v, push - chain.delta * v - z - chain.beta * z**3])

    end = solve_ivp(slope, (0, 2 * np.pi / omega), start, method="DOP853", rtol=1e-11, atol=1e-13).y[:, -1]
    return np.abs(end - start).max() / np.abs(start).max()


def test_where_the_symmetry_breaks_the_odd_answer_says_so_and_the_broken_one_is_found():
    """z(tau) -> -z(tau + T/2) maps the equations to themselves; past some drive stable orbits come in pairs."""
    chain = Chain(1, 0.1821, 1.0)
    setting = Setting.of(chain, epsilon=44.02, lam=0, omega=2.5407)
    odd = solve(chain, setting, tol=1e-9, rung="harmonic_balance")
    assert odd.outcome[0] is Outcome.UNSTABLE
    assert not odd.mean.any()
    assert not odd.harmonics[:, 1::2].any()
    # Symmetry breaks where a real multiplier passes +1, that of half a turn passing -1.
    assert odd.multipliers.real.max() > 2
    reached = solve(chain, setting, tol=1e-9)
    assert reached.outcome[0] is Outcome.OK
    assert abs(reached.mean[0, 0]) > 0.1
    for sign in (1, -1):
        turn = sign ** np.arange(1, reached.harmonics.shape[1] + 1)[None, :, None]
        near = balance_near(chain, setting, sign * turn * reached.harmonics, tol=1e-9, mean=sign * reached.mean)
        assert near.outcome[0] is Outcome.OK
        assert near.mean == pytest.approx(sign * reached.mean, rel=1e-7)
        assert gap_after_a_period(chain, setting, near) <= 1e-8
        assert np.prod(near.multipliers) == pytest.approx(np.prod(reached.multipliers), rel=1e-6)
        assert near.multipliers.sum() == pytest.approx(reached.multipliers.sum(), rel=1e-6)
    # First harmonics alone tell nothing of the mean: beside them stands the odd answer.
    assert not balance_near(chain, setting, odd.phasor, tol=1e-9).mean.any()


def test_without_damping_to_speak_of_the_estimate_off_resonance_is_rounding():
    chain = Chain(3, 1e-12, -1.0)
    found = solve(chain, Setting.of(chain, epsilon=1e-3, lam=0.01, omega=1.05), tol=1e-9, rung="harmonic_balance")
    assert found.outcome[0] is Outcome.OK
    assert found.error_estimate[0] <= 1e-12
    damped = Chain(3, 1e-9, -1.0)
    other = solve(damped, Setting.of(damped, epsilon=1e-3, lam=0.01, omega=1.05), tol=1e-9, rung="harmonic_balance")
    assert found.phasor == pytest.approx(other.phasor, rel=1e-7)


@pytest.mark.parametrize("closure", ["ring", "bidirectional"])
@pytest.mark.parametrize(("delta", "omega"), [(0.02, 1e-3), (0.3, 1e-6), (1e6, 1.05), (1e6, 1e-6)])
def test_multipliers_of_coupled_oscillators_far_from_the_drive(closure, delta, omega):
    """A faint orbit has those of the chain at rest, exp(T s) with s of the characteristic matrix."""
    chain = Chain(3, delta, -1.0, closure)
    setting = Setting.of(chain, epsilon=1e-6, lam=0.004, omega=omega)
    found = solve(chain, setting, tol=1e-6, rung="harmonic_balance")
    assert found.outcome[0] is Outcome.OK
    stiff = np.eye(3) + 0.004 * (np.eye(3) - np.roll(np.eye(3), 1, axis=0))
    if closure == "bidirectional":
        stiff = np.eye(3) + 0.004 * np.array([[1, -1, 0], [-1, 2, -1], [0, -1, 1]])
    rates = []
    for k in np.linalg.eigvals(stiff).astype(complex):
        fast = -delta / 2 - np.sqrt(delta**2 / 4 - k)
        rates += [fast, k / fast]
    wanted = np.sort(np.abs(np.exp(2 * np.pi / omega * np.array(rates))))
    assert np.sort(np.abs(found.multipliers).ravel()) == pytest.approx(wanted, rel=1e-4, abs=1e-100)


def test_multipliers_from_the_frozen_system_are_those_of_the_steps(monkeypatch):
    from chainsim.floquet import monodromy

    chain = Chain(4, 0.02, -1.0, Closure.RING)
    setting = Setting.of(chain, epsilon=0.1, lam=0.03, omega=0.01)
    steps = solve(chain, setting, tol=1e-6, rung="harmonic_balance")
    monkeypatch.setattr(monodromy, "MANY_SWINGS", 1.0)
    frozen = solve(chain, setting, tol=1e-6, rung="harmonic_balance")
    ours, theirs = (np.sort(np.log(np.abs(each.multipliers)).ravel()) for each in (frozen, steps))
    assert ours == pytest.approx(theirs, abs=0.01)
    assert not np.array_equal(ours, theirs)
