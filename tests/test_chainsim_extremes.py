"""Hostile inputs times every rung: an Outcome or a ValueError, never a NaN marked ok."""

import itertools

import numpy as np
import pytest

from chainsim import Chain, Outcome, Setting, solve

STEADY = ["static", "linear", "one_harmonic", "harmonic_balance"]
ESCAPE = 2 / (3 * np.sqrt(3))
BETAS = [0.0, 1.0, -1.0, -1e6, -1e12, 1e-300, -5e-324, 1e300]
DELTAS = [0.0, 1e-9, 5e-3, 3.0]


def sane(response):
    for index in range(len(response)):
        assert isinstance(response.outcome[index], Outcome)
        assert response.outcome[index].sentence
        if response.outcome[index] is Outcome.OK:
            assert np.isfinite(response.harmonics[index]).all()
            assert np.isfinite(response.mean[index]).all()
            assert np.isfinite(response.multipliers[index]).all()
            assert np.isfinite(response.error_estimate[index])
            assert response.stable[index]


@pytest.mark.parametrize("rung", STEADY)
@pytest.mark.parametrize("n", [1, 2, 64])
@pytest.mark.parametrize("beta", BETAS)
def test_hostile_settings(rung, n, beta):
    top = ESCAPE / np.sqrt(abs(beta)) if beta else 1.0
    points = list(
        itertools.product([0.0, 1e-200, 1e-3, 0.999 * top, top, 1.001 * top, 1e150], [0.0, 0.01], [0.3, 1.0, 1e3])
    )
    epsilon, lam, omega = np.array(points[:: 1 if n == 1 else 3]).T
    for delta in DELTAS if n < 64 else DELTAS[2:3]:
        chain = Chain(n, delta, beta)
        setting = Setting.of(chain, epsilon=epsilon, lam=lam[:, None], omega=omega)
        sane(solve(chain, setting, tol=1e-6, rung=rung))


@pytest.mark.parametrize("beta", [0.0, -1.0, 1.0, -1e12])
def test_auto_at_the_edge_of_the_well(beta):
    chain = Chain(2, 0.05, beta)
    top = ESCAPE / np.sqrt(abs(beta)) if beta else 1.0
    setting = Setting.of(chain, epsilon=[0.0, 1e-3 * top, 0.9 * top, top, 1.1 * top, 1e3 * top], lam=0.1, omega=1.0)
    response = solve(chain, setting, tol=1e-6)
    sane(response)
    assert response.outcome[1] is Outcome.OK
    assert response.outcome[-1] is (Outcome.ESCAPED if beta < 0 else response.outcome[-1])


@pytest.mark.parametrize("rung", STEADY)
def test_slow_drive_within_budget(rung):
    chain = Chain(2, 0.1, -1.0)
    sane(solve(chain, Setting.of(chain, epsilon=0.2, lam=0.1, omega=1e-3), tol=1e-6, rung=rung))


@pytest.mark.parametrize("rung", STEADY)
def test_constant_forces_of_every_size(rung):
    chain = Chain(3, 0.02, -1.0)
    setting = Setting.of(
        chain, epsilon=0.01, lam=0.1, omega=1.1, preload=[0.0, 1e-12, 0.1, 0.38, 0.39, 5.0, 1e200], bias=0.01
    )
    sane(solve(chain, setting, tol=1e-6, rung=rung))


def test_no_damping_never_locks_from_rest():
    chain = Chain(1, 0.0, 0.0)
    setting = Setting.of(chain, epsilon=1e-3, lam=0, omega=[1.0, 1.2])
    assert solve(chain, setting, tol=1e-6).outcome.tolist() == [Outcome.ESCAPED, Outcome.NOT_LOCKED]


@pytest.mark.parametrize("bad", [{"omega": 0.0}, {"epsilon": np.nan}, {"lam": np.inf}, {"phase": np.nan}])
def test_bad_numbers_are_value_errors(bad):
    with pytest.raises(ValueError, match=next(iter(bad))):
        Setting.of(Chain(2, 0.01, -1.0), **{"epsilon": 1e-3, "lam": 0.01, "omega": 1.0, **bad})


def test_work_is_counted_and_bounded():
    chain = Chain(6, 6.1e-3, -1.0)
    setting = Setting.of(chain, epsilon=4e-4, lam=6.131e-3, omega=1.0)
    stats = solve(chain, setting, tol=1e-6, rung="harmonic_balance").stats
    assert stats.oscillators_solved == 6
    assert 6 <= stats.newton_steps <= 24
    assert stats.periods == 0
