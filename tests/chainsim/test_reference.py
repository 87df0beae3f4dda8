"""Sixty steady states reached from rest, computed by shooting with DOP853 at 1e-13 (tests/data/steady_states.json)."""

import json
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from chainsim import Chain, Closure, Outcome, Setting, solve

CASES = json.loads((Path(__file__).parents[1] / "data" / "steady_states.json").read_text())
OPEN_OK = [i for i, case in enumerate(CASES) if case["closure"] == "open" and case["outcome"] == "ok"]
OUTCOMES = {"ok": Outcome.OK, "escaped": Outcome.ESCAPED, "not_periodic": Outcome.NOT_LOCKED}


def built(case):
    chain = Chain(case["n"], case["delta"], case["beta"], Closure(case["closure"]))
    return chain, Setting.of(chain, epsilon=case["epsilon"], lam=case["lam"], omega=case["omega"])


@cache
def answered(index):
    chain, setting = built(CASES[index])
    return solve(chain, setting, tol=1e-10)


def numbers(pairs):
    return np.array([complex(*pair) for pair in pairs])


def test_there_are_sixty():
    assert len(CASES) == 60
    assert {case["outcome"] for case in CASES} == set(OUTCOMES)


@pytest.mark.parametrize("index", range(60))
def test_auto_finds_what_is_reached_from_rest(index):
    case, response = CASES[index], answered(index)
    assert response.outcome[0] is OUTCOMES[case["outcome"]]
    if case["outcome"] != "ok":
        assert not response.stable[0]
        assert np.isnan(response.phasor).all()
        return
    wanted = numbers(case["phasor"])
    assert np.abs(response.phasor[0] - wanted).max() <= 1e-8 * np.abs(wanted).max()
    assert np.all(np.abs(response.phasor[0] - wanted) <= 1e-8 * np.abs(wanted))
    assert response.stable[0]
    assert response.locked[0]
    assert response.error_estimate[0] <= 1e-9


@pytest.mark.parametrize("index", OPEN_OK)
def test_harmonic_balance_beside_the_reference_has_its_third_harmonic(index):
    case = CASES[index]
    chain, setting = built(case)
    response = solve(chain, setting, tol=1e-10, rung="harmonic_balance")
    wanted, third = numbers(case["phasor"]), numbers(case["third"])
    assert response.outcome[0] is Outcome.OK
    assert np.all(np.abs(response.phasor[0] - wanted) <= 1e-8 * np.abs(wanted))
    assert np.abs(response.third[0] - third).max() <= 1e-10 * np.abs(wanted).max()
    assert np.all(response.mean == 0)


@pytest.mark.parametrize("index", [i for i, case in enumerate(CASES) if case["outcome"] == "ok"])
def test_largest_multiplier(index):
    # n equal stages make the reference's 2n x 2n monodromy defective: its eigenvalues carry rounding^(1/n), which is
    # up to 6e-3 at n = 12, while the 2 x 2 blocks used here are exact.
    case, response = CASES[index], answered(index)
    largest = np.abs(response.multipliers[0]).max()
    defective = case["closure"] == "open" and case["n"] > 2
    assert largest == pytest.approx(case["max_multiplier"], abs=1e-2 if defective else 1e-8)
    if case["beta"] == 0 and case["closure"] == "open":
        assert largest == pytest.approx(np.exp(-case["delta"] * np.pi / case["omega"]), rel=1e-12)
