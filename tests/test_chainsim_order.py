"""Each steady rung's claimed order, measured, and the honesty of its error estimate."""

from itertools import pairwise

import numpy as np
import pytest

from chainsim import RUNGS, Chain, Outcome, Setting, Start, load_rung, solve

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
    from chainsim.basis import basis_for
    from chainsim.march import march
    from chainsim.scaling import Stages

    chain = Chain(1, 0.1, 1.0)
    stages = Stages.of(chain, Setting.of(chain, epsilon=1.0, lam=0, omega=1.1))
    truth = march(stages, basis_for(33, False)).x[0, :2, 0]
    errors = [np.abs(march(stages, basis_for(order, False)).x[0, :2, 0] - truth).max() for order in (1, 3, 5, 9)]
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


@pytest.mark.parametrize("name", list(RUNGS))
def test_every_rung_states_its_claims(name):
    rung = load_rung(name)
    assert rung.name == name
    assert rung.order
    assert rung.valid
    assert rung.refusal(CHAIN, Setting.of(CHAIN, epsilon=1e-3, lam=0.2, omega=1.2), Start.REST) == ""
