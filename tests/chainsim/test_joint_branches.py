"""Every branch of rings and bidirectional chains: none missed, none invented, each an orbit of the equations."""

from fractions import Fraction
from itertools import pairwise, zip_longest

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from numpy.typing import NDArray

from chainsim import Chain, Closure, Outcome, RungError, Setting, solve
from chainsim.equations.basis import basis_for
from chainsim.equations.scaled_chain import ScaledChain
from chainsim.harmonic_balance.joint import newton_joint
from chainsim.harmonic_balance.joint_branches import joint_branches
from chainsim.harmonic_balance.joint_roots import roots_of

DELTA = 5.3006e-3
BELOW = {"epsilon": 4e-3, "lam": 1e-2, "omega": 0.985}
BESIDE = Fraction(1, 10**8)
each_closure = pytest.mark.parametrize("closure", ["ring", "bidirectional"])


def listed(chain, setting, rung="harmonic_balance", tol=1e-7):
    return joint_branches(chain, setting, tol=tol, rung=rung)


def by_chance(chain, setting, count, seed):
    """Single-harmonic answers (n, B) that Newton finds from random starts of any size and phase."""
    scaled, basis, rng = ScaledChain.of(chain, setting), basis_for(1, False), np.random.default_rng(seed)
    start = np.empty((chain.n, 2, count))
    size = 0.6 * 10 ** rng.uniform(-2.5, 0, (chain.n, count))
    angle = rng.uniform(0, 2 * np.pi, (chain.n, count))
    start[:, 0], start[:, 1] = size * np.cos(angle), size * np.sin(angle)
    with np.errstate(all="ignore"):
        solved = newton_joint(scaled.pick(np.zeros(count, dtype=np.intp)), basis, start)
    found: list[NDArray[np.complex128]] = []
    for phasor in (solved.x[:, 0] + 1j * solved.x[:, 1])[:, solved.ok].T:
        if all(np.abs(phasor - other).max() > 1e-5 * np.abs(phasor).max() for other in found):
            found.append(phasor)
    return np.array(found)


@each_closure
@pytest.mark.parametrize("n", [2, 3, 4, 6])
@pytest.mark.parametrize("place", [BELOW, {"epsilon": 2e-2, "lam": 0.05, "omega": 0.95}], ids=["near", "far"])
def test_nothing_that_chance_finds_is_missing(closure, n, place):
    chain = Chain(n, DELTA, -1.0, closure)
    setting = Setting.of(chain, **place)
    every = listed(chain, setting, "one_harmonic")
    assert every.complete
    some = by_chance(chain, setting, 1500, seed=n)
    assert len(some) >= 3
    away = np.abs(every.response.phasor[:, None] - some).max(axis=2).min(axis=0)
    assert (away <= 1e-6 * np.abs(some).max(axis=1)).all()
    if n == 2:
        assert len(some) == len(every.response)


def times(a, b):
    product = [Fraction(0)] * (len(a) + len(b) - 1)
    for i, left in enumerate(a):
        for j, right in enumerate(b):
            product[i + j] += left * right
    return product


def added(a, b):
    return [x + y for x, y in zip_longest(a, b, fillvalue=Fraction(0))]


def value(polynomial, s):
    total = Fraction(0)
    for each in reversed(polynomial):
        total = total * s + each
    return total


def positive_roots(polynomial):
    """How many distinct roots above 0, by Sturm's sequence in exact fractions, lowest power first."""
    sequence = [polynomial, [k * each for k, each in enumerate(polynomial)][1:]]
    while len(sequence[-1]) > 1:
        rest, by = list(sequence[-2]), sequence[-1]
        while len(rest) >= len(by):
            ratio = rest[-1] / by[-1]
            for k in range(len(by)):
                rest[len(rest) - len(by) + k] -= ratio * by[k]
            rest.pop()
        sequence.append([-each for each in rest])

    def changes(signs):
        return sum(a != b for a, b in pairwise(signs))

    return changes([each[0] > 0 for each in sequence]) - changes([each[-1] > 0 for each in sequence])


@each_closure
@settings(max_examples=25)
@given(st.floats(1e-4, 3e-2), st.floats(1e-3, 0.2), st.floats(0.9, 1.3), st.sampled_from([-1.0, 1.0]))
def test_two_oscillators_have_the_roots_of_their_polynomial(closure, epsilon, lam, omega, beta):
    """|D|^2 = epsilon^2 is of degree 9 in s = |A_2|^2; its positive roots, counted exactly, are the answers."""
    chain = Chain(2, DELTA, beta, closure)
    found = roots_of(ScaledChain.of(chain, Setting.of(chain, epsilon=epsilon, lam=lam, omega=omega)))
    exact = [Fraction(each) for each in (lam, omega, DELTA, beta, epsilon)]
    lam, omega, delta, beta, epsilon = exact
    re, im = [1 + lam - omega**2, 3 * beta / 4], [delta * omega]  # K_2 in powers of s
    size = [each / lam**2 for each in added(times(re, re), times(im, im))]  # |A_1|^2 over s
    first = added([1 + lam - omega**2], times([0, 3 * beta / 4], size))  # Re K_1; its imaginary part is that of K_2
    drive_re = added(added(times(first, re), [-each for each in times(im, im)]), [-(lam**2)])
    drive_im = added(times(first, im), times(im, re))
    square = added(times(drive_re, drive_re), times(drive_im, drive_im))
    condition = added([0, *(each / lam**2 for each in square)], [-(epsilon**2)])
    assert found.complete
    assert found.phasor.shape[1] == positive_roots(condition)
    for s in np.abs(found.phasor[1]) ** 2:
        below, above = (value(condition, Fraction(float(s)) * (1 + shift)) for shift in (-BESIDE, BESIDE))
        assert (below > 0) != (above > 0)


@each_closure
def test_each_answer_is_an_orbit_of_the_equations(closure):
    chain = Chain.of(3, delta=[5e-3, 6e-3, 5e-3], beta=[-1.0, -1.2, -0.8], stiffness=[1, 1.002, 1], closure=closure)
    setting = Setting.of(chain, phase=0.7, **BELOW)
    every = listed(chain, setting, tol=1e-10)
    assert every.complete
    assert len(every.response) > 5
    theta = 2 * np.pi * np.arange(256) / 256
    order = np.arange(1, every.response.harmonics.shape[1] + 1)
    turn = np.exp(1j * np.outer(theta, order))
    lam, omega = setting.lam[0], setting.omega[0]
    for waves in every.response.harmonics:
        z, v, a = ((turn * (1j * omega * order) ** d @ waves).real for d in (0, 1, 2))
        pull = a + chain.deltas * v + chain.stiffness * z + chain.betas * z**3
        pull -= lam * (np.roll(z, 1, axis=1) - z)
        if closure == "bidirectional":
            pull[:, :-1] -= lam[1:] * (z[:, 1:] - z[:, :-1])
        pull[:, 0] -= setting.epsilon[0] * np.cos(theta + 0.7)
        # Higher harmonics than those of the answer are what it leaves out.
        left = np.fft.rfft(pull, axis=0)[: len(order) + 1] / 128
        assert np.abs(left).max() < 1e-9 * np.abs(a).max()


@each_closure
def test_what_is_reached_is_a_stable_one_of_them(closure):
    chain = Chain(2, DELTA, -1.0, closure)
    setting = Setting.of(chain, epsilon=2e-3, lam=2e-2, omega=0.99)
    every = listed(chain, setting).response
    reached = solve(chain, setting, tol=1e-9, rung="ode")
    assert reached.outcome[0] is Outcome.OK
    away = np.abs(every.phasor - reached.phasor).max(axis=1) / np.abs(reached.phasor).max()
    at = int(away.argmin())
    assert away[at] < 1e-6
    assert every.stable[at]
    assert np.sort(np.abs(every.multipliers[at].ravel())) == pytest.approx(
        np.sort(np.abs(reached.multipliers[0].ravel())), rel=1e-5
    )
    assert not every.stable.all()


def test_without_a_closing_link_a_ring_is_the_open_chain():
    ring, chain = Chain(3, DELTA, -1.0, Closure.RING), Chain(3, DELTA, -1.0)
    place = {"epsilon": 2e-3, "omega": 0.99}
    every = listed(ring, Setting.of(ring, lam=[0.0, 6e-3, 6e-3], **place))
    tree = solve(chain, Setting.of(chain, lam=6e-3, **place), tol=1e-7, rung="harmonic_balance", start="all")
    assert every.complete
    assert len(every.response) == len(tree) > 3
    mine, other = (each.phasor[np.argsort(np.abs(each.phasor[:, 2]))] for each in (every.response, tree))
    assert mine == pytest.approx(other, rel=1e-6)


def test_oscillators_behind_a_cut_link_rest():
    chain = Chain(4, DELTA, -1.0, Closure.BIDIRECTIONAL)
    every = listed(chain, Setting.of(chain, epsilon=4e-3, lam=[1e-2, 0.0, 1e-2], omega=0.985))
    pair = Chain(2, DELTA, -1.0, Closure.BIDIRECTIONAL)
    alone = listed(pair, Setting.of(pair, **BELOW))
    assert every.complete
    assert every.response.phasor[:, :2] == pytest.approx(alone.response.phasor, rel=1e-7)
    assert not every.response.phasor[:, 2:].any()


@pytest.mark.parametrize("beta", [-1e-6, -1e12])
def test_beta_is_a_length_scale(beta):
    answers = []
    for value in (-1.0, beta):
        chain, size = Chain(3, DELTA, value, Closure.RING), 1 / np.sqrt(-value)
        answers.append(listed(chain, Setting.of(chain, **{**BELOW, "epsilon": 4e-3 * size})).response.phasor / size)
    assert answers[1] == pytest.approx(answers[0], rel=1e-7)


def test_constant_forces_leave_the_list_open():
    chain = Chain(2, DELTA, -1.0, Closure.RING)
    plain = listed(chain, Setting.of(chain, **BELOW))
    every = listed(chain, Setting.of(chain, bias=[0.0, 1e-3], **BELOW))
    assert not every.complete
    assert len(every.response) == len(plain.response) == 5
    assert np.abs(every.response.mean).max() == pytest.approx(1e-3, rel=0.2)


def test_equilibria_of_a_ring():
    """z + beta z^3 = lam (z_other - z) + b: equal oscillators under equal biases may rest alike, at three places."""
    chain = Chain(2, 0.01, -1.0, Closure.RING)
    every = listed(chain, Setting.of(chain, epsilon=0, lam=0.1, omega=1, bias=0.2), "static", 1e-9)
    alike = np.sort(np.roots([-1, 0, 1, -0.2]).real)
    both = every.response.mean[np.abs(np.ptp(every.response.mean, axis=1)) < 1e-9, 0]
    assert np.sort(both) == pytest.approx(alike, rel=1e-9)
    assert len(every.response) == 9
    assert every.response.stable.sum() == 1


@each_closure
@pytest.mark.parametrize(
    "place",
    [
        {"epsilon": 0.0, "lam": 0.01, "omega": 1.0}, {"epsilon": 1e-300, "lam": 0.01, "omega": 1.0},
        {"epsilon": 1e12, "lam": 0.01, "omega": 1.0}, {"epsilon": 1e-3, "lam": 1e-12, "omega": 0.99},
        {"epsilon": 1e-3, "lam": 1e6, "omega": 0.99}, {"epsilon": 1e-3, "lam": 0.01, "omega": 1e-6},
        {"epsilon": 1e-3, "lam": 0.01, "omega": 1e6}, {"epsilon": 1e-3, "lam": -0.01, "omega": 0.99},
    ],
)  # fmt: skip
def test_extremes_end_in_outcomes(closure, place):
    chain = Chain(3, DELTA, -1.0, closure)
    found = listed(chain, Setting.of(chain, **place)).response
    assert len(found) >= 1
    ok = found.outcome == Outcome.OK
    assert np.isfinite(found.phasor[ok]).all()
    assert (found.error_estimate[ok] <= 1e-7).all()
    if place["epsilon"] == 0:
        assert not found.phasor.any()


def test_long_chains_stay_within_the_budget():
    chain = Chain(40, DELTA, -1.0, Closure.BIDIRECTIONAL)
    assert len(listed(chain, Setting.of(chain, epsilon=1e-4, lam=6e-3, omega=1.02)).response) >= 1


def test_refusals():
    ring = Chain(2, DELTA, -1.0, Closure.RING)
    with pytest.raises(RungError, match="does not list every branch; use rung harmonic_balance"):
        joint_branches(ring, Setting.of(ring, **BELOW), tol=1e-6, rung="envelope")
    with pytest.raises(RungError, match="one setting"):
        joint_branches(ring, Setting.of(ring, **BELOW | {"omega": [0.9, 1.0]}), tol=1e-6, rung="one_harmonic")
