"""Long chains that amplify: what they reach from rest, against more digits (tests/data/long_chains.json)."""

import shutil

import numpy as np
import pytest

from chainsim import Chain, Outcome, Setting, solve
from chainsim.equations.scaled_chain import ScaledChain
from chainsim.time_domain.rounding import rounding_floor
from tests.support.everyday import one_in
from tests.support.long_chains import LongChain, compiled, kept, reached

KEPT = kept()
TOL = 1e-6
# Both settle within a fifth of a second of the program in C.
LIVE = [place for place, (_, found) in enumerate(KEPT) if found.digits == 19 and found.period < 1000][:2]
# It comes back from nine tenths of the hilltop.
AT_THE_HILL = (29,)
LIVE_34 = [place for place, (_, found) in enumerate(KEPT) if found.digits == 34][:2]


def system(one):
    chain = Chain(one.n, one.delta, one.beta)
    return chain, Setting.of(chain, epsilon=one.epsilon, lam=one.lam, omega=one.omega)


def away(answer, found):
    """Distance of an answer from the one kept, relative to the largest amplitude."""
    known = np.array(found.re) + 1j * np.array(found.im)
    return np.abs(answer.phasor[0] - known).max() / np.abs(known).max()


def test_they_are_as_many_and_as_long_as_they_should_be():
    assert len(KEPT) == 60
    assert all(8 <= one.n <= 24 and 1.5 <= one.lam / one.delta <= 4.001 for one, _ in KEPT)
    assert sum(one.gain > 10**4.87 for one, _ in KEPT) >= 25
    assert {found.outcome for _, found in KEPT} == {"ok", "escaped"}
    # Where 19 digits do not settle, 16 cannot.
    assert len(LIVE_34) == 2


@pytest.mark.parametrize("place", one_in(4, range(len(KEPT))))
def test_auto_says_what_they_reach(place):
    one, found = KEPT[place]
    answer = solve(*system(one), tol=TOL, rung="auto", start="rest")
    assert answer.outcome[0] == found.outcome
    if found.outcome == "ok":
        assert away(answer, found) <= TOL


@pytest.mark.parametrize(
    "place",
    [pytest.param(place, marks=[] if place % 10 == 0 else [pytest.mark.slow]) for place in range(len(KEPT))],
)
def test_ode_says_what_they_reach(place):
    one, found = KEPT[place]
    answer = solve(*system(one), tol=TOL, rung="ode", start="rest")
    assert answer.outcome[0] == found.outcome
    if found.outcome == "ok":
        assert away(answer, found) <= TOL


@pytest.mark.parametrize("place", one_in(4, range(len(KEPT))))
def test_the_envelope_is_right_or_says_that_it_is_too_rough(place):
    one, found = KEPT[place]
    answer = solve(*system(one), tol=TOL, rung="envelope", start="rest")
    if answer.outcome[0] is Outcome.OUT_OF_BUDGET:
        # It has the answer, but not to `tol`; or the motion came too near the hilltop for a slow flow to tell.
        assert answer.error_estimate[0] > TOL
        assert (
            found.outcome == "escaped" or place in AT_THE_HILL or away(answer, found) < answer.error_estimate[0] < 1e-3
        )
    else:
        assert answer.outcome[0] == found.outcome
    if answer.outcome[0] is Outcome.OK:
        assert away(answer, found) <= TOL


def test_the_chain_that_an_audit_found():
    """Gain 2 x 10^4: in doubles a period changes it by 1e-14 for ever, in truth it comes to rest at 2e-16."""
    one = LongChain(12, 2.8319e-3, -1.0, 9.9959e-4, 6.93224e-3, 0.941987)
    for rung in ("auto", "ode", "envelope"):
        answer = solve(*system(one), tol=TOL, rung=rung, start="rest")
        assert answer.outcome[0] is Outcome.OK
        assert abs(answer.phasor[0, -1]) == pytest.approx(2.196977e-16, rel=1e-5)


def test_the_floor_of_rounding_is_the_gain_of_the_chain():
    for one, _ in KEPT:
        scaled = ScaledChain.of(*system(one))
        size = np.zeros((1, one.n))
        size[0, 0] = 1e-3
        floor = rounding_floor(scaled, np.zeros(1, dtype=np.int64), size, 8)[0]
        # Of the roundings of the first alone, half a lam beside the resonance sqrt(1 + lam) of the others.
        gain = one.gain * (1 + one.lam) ** (-0.5 * (one.n - 1)) / np.hypot(1, one.lam / one.delta)
        assert floor[-1] / floor[0] == pytest.approx(gain, rel=0.1)


@pytest.mark.parametrize(("place", "digits"), [(place, 19) for place in LIVE] + [
    pytest.param(place, 34, marks=pytest.mark.slow) for place in LIVE_34
])  # fmt: skip
def test_what_is_kept_is_what_the_program_says(tmp_path, place, digits):
    if shutil.which("gcc") is None:
        pytest.skip("the program in C is run where there is a gcc")
    one, found = KEPT[place]
    assert reached(compiled(tmp_path, digits), one, digits) == found
