"""The compiled sweep: against harmonic balance in NumPy, the integrated equations, and exact identities."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from chainsim import Chain, Closure, Outcome, Setting, solve
from chainsim.batch.chains import Found, Given
from chainsim.batch.deep import march_deep, tables_for
from chainsim.batch.multipliers import MOST, trace_of
from chainsim.batch.sweep import OUTCOMES, sweep, unit_of

CHAIN = Chain(6, 6.1e-3, -1.0)
OK = OUTCOMES.index(Outcome.OK)


def spread(size, chain, *, epsilon, lam, omega, seed=1):
    """Random settings, log-uniform in each span."""
    rng = np.random.default_rng(seed)

    def draw(span, shape):
        return np.exp(rng.uniform(np.log(span[0]), np.log(span[1]), shape))

    links = draw(lam, (size, chain.n - 1)) if chain.n > 1 else 0.0
    return Setting.of(chain, epsilon=draw(epsilon, size), lam=links, omega=draw(omega, size))


def anchor(size, seed=1):
    return spread(size, CHAIN, epsilon=(3e-5, 6e-4), lam=(3e-3, 9e-3), omega=(0.985, 1.015), seed=seed)


def apart(a, b):
    """Distance of multiplier pairs, whichever stands first, relative to the larger of 1 and their size; shape (N,)."""
    swapped = np.minimum(np.abs(a - b).max(axis=2), np.abs(a[..., ::-1] - b).max(axis=2)).max(axis=1)
    return swapped / np.maximum(np.abs(b).max(axis=(1, 2)), 1)


CASES = {
    "anchor": (CHAIN, {"epsilon": (3e-5, 6e-4), "lam": (3e-3, 9e-3), "omega": (0.985, 1.015)}),
    "folds": (CHAIN, {"epsilon": (3e-4, 6e-3), "lam": (3e-3, 9e-2), "omega": (0.9, 1.1)}),
    "links": (Chain(6, 5.3e-3, -1.0), {"epsilon": (1e-3, 1e-1), "lam": (3e-2, 1), "omega": (0.8, 1.6)}),
    "hardening": (Chain(4, 5.3e-3, 1.0), {"epsilon": (1e-3, 1e-1), "lam": (3e-2, 1), "omega": (0.8, 3)}),
    "slow": (Chain(3, 5.3e-2, -1.0), {"epsilon": (1e-3, 1e-1), "lam": (3e-2, 1), "omega": (0.1, 1)}),
    "scaled": (Chain(3, 5.3e-3, -1e12), {"epsilon": (1e-9, 1e-7), "lam": (3e-2, 1), "omega": (0.8, 1.6)}),
    "alone": (Chain(1, 1e-3, -1.0), {"epsilon": (1e-4, 1e-2), "lam": (1, 1), "omega": (0.9, 1.1)}),
    "linear": (Chain(5, 1e-3, 0.0), {"epsilon": (1e-4, 1e-2), "lam": (1e-3, 1), "omega": (0.9, 1.1)}),
}


@pytest.mark.parametrize("name", CASES)
def test_agrees_with_numpy(name):
    chain, spans = CASES[name]
    setting = spread(300, chain, **spans)
    fast = sweep(chain, setting, tol=1e-8, from_rest=False)
    slow = solve(chain, setting, tol=1e-11, rung="harmonic_balance")
    both = fast.locked & slow.locked & (slow.error_estimate < 1e-10) & (fast.error_estimate <= 1e-8)
    assert both.mean() > 0.97
    size = np.abs(slow.phasor).max(axis=1)
    error = np.abs(fast.phasor - slow.phasor).max(axis=1) / size
    # Rounding in the reference, magnified by the nearest fold.
    assert np.all(error[both] <= fast.error_estimate[both] + slow.error_estimate[both])
    assert np.array_equal(fast.branch[both], slow.branch[both])
    assert np.array_equal(fast.stable[both], slow.stable[both])
    assert np.quantile(apart(fast.multipliers, slow.multipliers)[both], 0.99) < 3e-7
    third = np.abs(fast.third - slow.third).max(axis=1) / size
    assert np.all(third[both] < 1e-7)


def test_anchor_settings_are_right_to_a_millionth_of_each_oscillator():
    setting = anchor(2000, seed=3)
    fast = sweep(CHAIN, setting, tol=1e-6, from_rest=False)
    slow = solve(CHAIN, setting, tol=1e-9, rung="harmonic_balance")
    assert np.all(fast.code == OK)
    assert np.max(np.abs(fast.phasor - slow.phasor) / np.abs(slow.phasor)) < 1e-6
    assert np.max(np.abs(fast.phase_step - slow.phase_step)) < 1e-6
    assert np.median(apart(fast.multipliers, slow.multipliers)) < 1e-10


def test_multipliers_of_the_integrated_equations():
    setting = spread(12, CHAIN, epsilon=(3e-4, 3e-3), lam=(3e-2, 9e-2), omega=(1.05, 1.15), seed=9)
    fast = sweep(CHAIN, setting, tol=1e-11, from_rest=False)
    full = solve(CHAIN, setting, tol=1e-11, rung="ode")
    same = (full.outcome == Outcome.OK) & (np.abs(full.phasor - fast.phasor).max(axis=1) < 1e-6)
    assert same.sum() >= 8
    assert np.max(apart(fast.multipliers, full.multipliers)[same]) < 2e-8


@given(st.integers(0, 10**6), st.floats(1e-4, 0.3), st.floats(0.5, 2))
@settings(max_examples=30)
def test_each_pair_multiplies_to_the_damping(seed, delta, omega):
    chain = Chain(3, delta, -1.0)
    setting = spread(5, chain, epsilon=(1e-6, 1e-2), lam=(1e-4, 1), omega=(omega, 1.01 * omega), seed=seed)
    found = sweep(chain, setting, tol=1e-6, from_rest=False)
    known = found.locked & np.isfinite(found.multipliers).all(axis=(1, 2))
    product = found.multipliers.prod(axis=2)[known]
    assert np.allclose(product, np.exp(-delta * setting.period[known])[:, None], rtol=1e-12)


def test_linear_chain_is_the_product_of_gains():
    chain = Chain(4, 0.01, 0.0)
    setting = spread(50, chain, epsilon=(1e-3, 1), lam=(1e-2, 1), omega=(0.5, 2))
    wanted = setting.epsilon / (1 - setting.omega**2 + 1j * chain.delta * setting.omega)
    found = sweep(chain, setting, tol=1e-9, from_rest=False)
    for m in range(4):
        if m:
            k = 1 + setting.lam[:, m]
            wanted = setting.lam[:, m] * wanted / (k - setting.omega**2 + 1j * chain.delta * setting.omega)
        assert np.allclose(found.phasor[:, m], wanted, rtol=1e-11)
    assert not found.third.any()


@given(st.integers(1, 70), st.integers(0, 10**6))
@settings(max_examples=25)
def test_a_setting_does_not_feel_its_neighbours(size, seed):
    chain, spans = CASES["links"]
    setting = spread(size, chain, **spans, seed=seed)
    together = sweep(chain, setting, tol=1e-8, from_rest=False)
    at = np.random.default_rng(seed).integers(size)
    alone = sweep(chain, setting[at : at + 1], tol=1e-8, from_rest=False)
    for name in ("code", "phasor", "third", "multipliers", "branch", "answers", "stable", "error_estimate"):
        one, many = getattr(alone, name)[0], getattr(together, name)[at]
        assert np.array_equal(one, many, equal_nan=True), name


def test_answers_do_not_depend_on_the_cores(monkeypatch):
    setting = anchor(100)
    many = sweep(CHAIN, setting, tol=1e-6, from_rest=False)
    monkeypatch.setattr("os.cpu_count", lambda: 1)
    one = sweep(CHAIN, setting, tol=1e-6, from_rest=False)
    assert np.array_equal(one.phasor, many.phasor)
    assert np.array_equal(one.multipliers, many.multipliers)


def test_three_answers_are_counted():
    chain = Chain(1, 5e-3, -1.0)
    setting = Setting.of(chain, epsilon=[1.5e-3, 1e-5, 1e-2], lam=0.0, omega=0.985)
    found = sweep(chain, setting, tol=1e-8, from_rest=False)
    assert found.answers.ravel().tolist() == [3, 1, 1]
    assert found.branch.ravel().tolist() == [0, 0, 0]


def test_from_rest_is_what_an_integration_says():
    chain = Chain(2, 5e-2, -1.0)
    setting = spread(30, chain, epsilon=(3e-2, 0.3), lam=(3e-2, 9e-2), omega=(0.8, 1.0), seed=2)
    found = sweep(chain, setting, tol=1e-6, from_rest=True)
    wanted = solve(chain, setting, tol=1e-6)
    assert list(found.outcome) == list(wanted.outcome)
    assert list(found.outcome_name) == [str(outcome) for outcome in wanted.outcome]
    assert {Outcome.OK, Outcome.ESCAPED} <= set(wanted.outcome)
    both = found.locked & wanted.locked
    assert np.max(np.abs(found.phasor - wanted.phasor)[both]) < 1e-6 * np.abs(wanted.phasor)[both].max()
    lower = sweep(chain, setting, tol=1e-6, from_rest=False)
    assert np.any(lower.code != found.code)


@pytest.mark.parametrize("order", [9, 33])
def test_more_harmonics_agree_with_five(order):
    setting = anchor(20)
    wanted = sweep(CHAIN, setting, tol=1e-6, from_rest=False)
    size, n = len(setting), CHAIN.n
    made = Found(
        np.empty((size, n), complex), np.empty((size, n), complex), np.empty((size, n, 2), complex),
        np.empty((size, n), np.int8), np.empty((size, n), np.int8), np.empty(size), np.zeros(size),
    )  # fmt: skip
    question = Given(setting.epsilon, setting.lam, setting.omega, setting.phase, CHAIN.delta, -1.0, 1.0)
    march_deep(question, made, np.arange(size), tables_for(order))
    assert np.max(np.abs(made.phasor - wanted.phasor) / np.abs(wanted.phasor)) < 1e-10
    assert np.max(apart(made.multipliers, wanted.multipliers)) < 1e-8
    assert np.array_equal(made.branch, wanted.branch)
    assert np.all(made.estimate < 1e-6)


@pytest.mark.parametrize("stiffness", [-0.3, 0.0, 0.4, 1.02, 30.0])
def test_a_constant_stiffness_has_a_known_trace(stiffness):
    points = np.zeros(MOST)
    root = np.emath.sqrt(stiffness)
    assert trace_of(points, stiffness, -1.0, 1.0) == pytest.approx(np.cos(np.pi * root).real, rel=1e-12, abs=1e-12)


def test_mathieu():
    # u'' + (q + 3 a^2/2 (1 + cos 2 theta)) u with z = a cos theta; characteristic exponent by Hill's determinant.
    theta = np.arange(MOST) * np.pi / MOST
    amplitude, q = 0.4, 0.7
    half, off = q + 1.5 * amplitude**2, 0.75 * amplitude**2
    size = 81
    index = np.arange(-(size // 2), size // 2 + 1)
    scaled = off / (half - 4.0 * index**2)
    hill = np.eye(size) + np.diag(scaled[1:], -1) + np.diag(scaled[:-1], 1)
    sine = np.linalg.det(hill) * np.sin(0.5 * np.pi * np.sqrt(half)) ** 2
    assert trace_of(amplitude * np.cos(theta), q, 1.0, 1.0) == pytest.approx(1 - 2 * sine, abs=2e-6)


HOSTILE = [
    {"epsilon": 0.0, "lam": 0.1, "omega": 1.0},
    {"epsilon": 1e-310, "lam": 0.1, "omega": 1.0},
    {"epsilon": 1e12, "lam": 0.1, "omega": 1.0},
    {"epsilon": 1e-3, "lam": 0.0, "omega": 1.0},
    {"epsilon": 1e-3, "lam": 1e-12, "omega": 1.0},
    {"epsilon": 1e-3, "lam": 1e6, "omega": 1.0},
    {"epsilon": 1e-3, "lam": 0.1, "omega": 1e-6},
    {"epsilon": 1e-3, "lam": 0.1, "omega": 1e6},
    {"epsilon": 1e-3, "lam": 0.1, "omega": np.nextafter(1.0, 2.0)},
]


@pytest.mark.parametrize("beta", [-1.0, 0.0, 1.0, 1e-12, -1e12])
@pytest.mark.parametrize("delta", [0.0, 1e-12, 1.0, 1e6])
def test_hostile_settings_end_in_an_outcome(beta, delta):
    chain = Chain(3, delta, beta)
    for question in HOSTILE:
        found = sweep(chain, Setting.of(chain, **question), tol=1e-6, from_rest=False)
        outcome = OUTCOMES[found.code[0]]
        known = np.isfinite(found.phasor).all() and np.isfinite(found.multipliers).all()
        if outcome in (Outcome.OK, Outcome.UNSTABLE):
            assert known, question
            assert found.error_estimate[0] <= 1e-6, question
        else:
            assert outcome in (Outcome.NO_CONVERGENCE, Outcome.OUT_OF_BUDGET), question


def test_a_long_chain_costs_as_its_length():
    work = []
    for n in (1000, 20_000):
        chain = Chain(n, 5e-3, -1.0)
        found = sweep(chain, Setting.of(chain, epsilon=1e-3, lam=0.1, omega=1.08), tol=1e-6, from_rest=False)
        assert found.code[0] == OK
        work.append(found.stats.oscillators_solved)
    assert work == [1000, 20_000]


def test_a_ring_and_constant_forces_go_to_the_ladder():
    ring = Chain(3, 0.05, -1.0, Closure.RING)
    found = sweep(ring, Setting.of(ring, epsilon=1e-3, lam=0.01, omega=1.0), tol=1e-6, from_rest=True)
    assert found.code[0] == OK
    biased = Setting.of(CHAIN, epsilon=1e-4, lam=0.01, omega=1.1, preload=0.01)
    wanted = solve(CHAIN, biased, tol=1e-6, rung="harmonic_balance")
    found = sweep(CHAIN, biased, tol=1e-6, from_rest=False)
    assert np.array_equal(found.mean, wanted.mean)
    assert found.answers[0].tolist() == [0] * 6


def test_bad_input():
    with pytest.raises(ValueError, match="tol"):
        sweep(CHAIN, anchor(1), tol=0.0, from_rest=False)
    with pytest.raises(ValueError, match="made for 6"):
        sweep(Chain(3, 0.1, -1.0), anchor(1), tol=1e-6, from_rest=False)
    assert unit_of(6) == 4096
    assert unit_of(10**6) == 1
