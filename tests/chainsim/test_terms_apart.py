"""Play hysteresis, an amplifier's slew and its limit against an integrator that shares nothing with ours."""

import numpy as np
import pytest

from chainsim import Chain, Outcome, Setting, Start
from chainsim.effects.effects import AmplifierDynamics, Play, Terms
from chainsim.effects.ode import integrate_terms
from chainsim.effects.steady import steady_with_terms
from tests.support.everyday import one_in
from tests.support.terms_reference import PlayingChain

DELTA, EPSILON, LAM, OMEGA, PERIODS = 0.2, 0.05, 0.15, 1.03, 4
PERIOD = 2 * np.pi / OMEGA
PLAYS = Play(radius=(0.004, 0.02), weight=(0.3, 0.2), base=0.5)
AMPLIFIERS = {
    "slew": AmplifierDynamics(bandwidth=3.0, slew=0.02),
    "limit": AmplifierDynamics(bandwidth=3.0, limit=0.03),
    "slew and limit": AmplifierDynamics(bandwidth=3.0, slew=0.04, limit=0.03),
}
TERMS = {
    "play": Terms(hysteresis=PLAYS),
    **{name: Terms(amplifier=each) for name, each in AMPLIFIERS.items()},
    "play, slew and limit": Terms(hysteresis=PLAYS, amplifier=AMPLIFIERS["slew and limit"]),
}
# The matrices of the links, written down from the equations.
LINKS = {
    "open": [[0, 0, 0], [1, -1, 0], [0, 1, -1]],
    "ring": [[-1, 0, 1], [1, -1, 0], [0, 1, -1]],
    "bidirectional": [[-1, 1, 0], [1, -2, 1], [0, 1, -1]],
}


def pair(closure, terms):
    """The chain, its setting, and the same for the other integrator."""
    chain = Chain(3, DELTA, -1.0, closure)
    setting = Setting.of(chain, epsilon=EPSILON, lam=LAM, omega=OMEGA)
    plays, amplifier = terms.hysteresis, terms.amplifier
    played = {} if plays is None else {"base": plays.base, "radius": plays.radius, "weight": plays.weight}
    driven = {} if amplifier is None else vars(amplifier)
    links = LAM * np.array(LINKS[closure], dtype=float)
    return chain, setting, PlayingChain(DELTA, -1.0, links, EPSILON, OMEGA, **played, **driven)


@pytest.mark.parametrize("name", TERMS)
@pytest.mark.parametrize("closure", LINKS)
def test_the_way_from_rest_is_the_same(closure, name):
    chain, setting, other = pair(closure, TERMS[name])
    count = 256
    step = PERIOD / (count * 16)
    motion = integrate_terms(chain, setting, TERMS[name], duration=PERIODS * PERIOD, step=step, every=count)
    wanted = other.tips(motion.tau[motion.tau > 0])
    mine = motion.tip[motion.tau > 0]
    assert len(mine) == PERIODS * 16
    # The corners of a play are met exactly; a drive that turns at its limit while plays slide is known less well there.
    known = 2e-4 if name == "play, slew and limit" else 2e-6
    assert np.abs(mine - wanted).max() <= known * np.abs(wanted).max()
    # The terms are felt: without them the motion is another.
    plain = integrate_terms(chain, setting, Terms(), duration=PERIODS * PERIOD, step=step, every=count)
    assert np.abs(plain.tip - motion.tip).max() > 0.02 * np.abs(wanted).max()


@pytest.mark.parametrize("name", one_in(3, TERMS))
def test_the_steady_state_is_the_same(name):
    chain, setting, other = pair("open", TERMS[name])
    at = (24 + np.arange(64) / 64) * PERIOD
    wanted = 2 * (other.tips(at) * np.exp(-1j * OMEGA * at)[:, None]).mean(axis=0)
    found = steady_with_terms(chain, setting, TERMS[name], tol=1e-4, start=Start.REST)
    assert found.outcome is Outcome.OK
    assert np.abs(found.amplitude[0] - wanted).max() <= 1e-4 * np.abs(wanted).max()
