"""Motions with a way in of their own: the answer beside them, by the cheapest rung, and nothing integrated."""

import numpy as np
import pytest

import chainsim.averaging.decide
import chainsim.time_domain.ode
from chainsim import Chain, Outcome, RungError, Setting, balance_near, solve

LOOSE, TIGHT = 1e-2, 1e-9
SIX = Chain(6, 5.3006e-3, -1.0)
# A sudden drive throws it out of its well.
THROWN = Setting.of(SIX, epsilon=0.02, lam=0.3, omega=1.35)


@pytest.fixture(autouse=True)
def nothing_is_integrated(monkeypatch):
    def never(*given, **more):
        raise AssertionError("an integration was started")

    monkeypatch.setattr(chainsim.time_domain.ode, "reached_from_rest", never)
    monkeypatch.setattr(chainsim.time_domain.ode, "steady_from_rest", never)
    monkeypatch.setattr(chainsim.averaging.decide, "Run", never)


def test_where_a_sudden_drive_is_a_question_a_way_in_is_none():
    known = solve(SIX, THROWN, tol=TIGHT, rung="harmonic_balance")
    with pytest.raises(AssertionError, match="integration"):
        solve(SIX, THROWN, tol=TIGHT, start="rest")
    found = solve(SIX, THROWN, tol=TIGHT, start=known.phasor)
    assert (found.outcome[0], found.rung) == (Outcome.OK, "harmonic_balance")
    assert found.phasor == pytest.approx(known.phasor, rel=1e-12)
    assert found.stats.newton_steps == known.stats.newton_steps
    assert found.stats.oscillators_solved == known.stats.oscillators_solved


def test_each_tolerance_takes_the_cheapest_rung_that_meets_it():
    chain = Chain(2, 0.05, -1.0)
    setting = Setting.of(chain, epsilon=4e-3, lam=0.1, omega=1.1)
    motion = solve(chain, setting, tol=1e-11, rung="harmonic_balance").phasor
    names = []
    for tol in (LOOSE, 1e-4, TIGHT):
        found = solve(chain, setting, tol=tol, start=motion)
        assert np.abs(found.phasor - motion).max() <= tol * np.abs(motion).max()
        # No other rung was tried before.
        assert found.stats.oscillators_solved == 2
        names.append(found.rung)
    assert names == ["linear", "one_harmonic", "harmonic_balance"]


def test_it_is_the_branch_of_the_motion():
    chain = Chain(1, 5.3006e-3, -1.0)
    setting = Setting.of(chain, epsilon=2e-3, lam=0, omega=0.985)
    every = solve(chain, setting, tol=TIGHT, start="all")
    assert len(every.outcome) == 3
    for place, outcome in ((0, Outcome.OK), (2, Outcome.OK)):
        found = solve(chain, setting, tol=TIGHT, start=every.phasor[place][None])
        assert found.outcome[0] is outcome
        assert found.phasor[0] == pytest.approx(every.phasor[place], rel=1e-8)
    middle = balance_near(chain, setting, every.phasor[1][None], tol=TIGHT)
    found = solve(chain, setting, tol=TIGHT, start=every.phasor[1][None])
    assert found.outcome[0] is middle.outcome[0] is Outcome.UNSTABLE
    elsewhere = solve(chain, setting, tol=TIGHT, start=1.5 * every.phasor[0][None])
    assert elsewhere.outcome[0] is Outcome.NO_CONVERGENCE


def test_deflections_are_met_by_the_static_rung():
    chain = Chain(2, 0.05, -1.0)
    setting = Setting.of(chain, epsilon=0.0, lam=0.1, omega=1.0, bias=[0.05, 0.02])
    known = solve(chain, setting, tol=TIGHT, rung="static")
    found = solve(chain, setting, tol=TIGHT, start=known.mean)
    assert (found.outcome[0], found.rung) == (Outcome.OK, "static")
    assert np.array_equal(found.mean, known.mean)


@pytest.mark.parametrize(
    ("motion", "rung", "words"),
    [
        (np.zeros((1, 5)), "auto", r"start: expected finite amplitudes of shape \(1, 6\), got \(1, 5\)"),
        (np.full((1, 6), np.nan), "auto", "expected finite amplitudes"),
        (np.zeros((1, 6)), "ode", "rung ode: it does not start from amplitudes; use rung auto"),
    ],
)
def test_what_is_no_motion_is_refused(motion, rung, words):
    with pytest.raises(RungError, match=words):
        solve(SIX, THROWN, tol=TIGHT, rung=rung, start=motion)
