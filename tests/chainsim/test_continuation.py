"""Branches and folds by continuation, against the closed form of one harmonic and against the solvers."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from chainsim import Chain, Closure, Outcome, Setting, solve
from chainsim.averaging.settle import reached
from chainsim.continuation.path import ContinuationError, Ending, continue_branch


def folds_in_epsilon(delta, omega):
    """Drives (jump up, jump down) of one oscillator with beta = -1: extrema of v ((kappa - v)^2 + g^2), v = 3/4 a^2."""
    kappa, g = 1 - omega**2, delta * omega
    v = (2 * kappa + np.array([-1, 1]) * np.sqrt(kappa**2 - 3 * g**2)) / 3
    return np.sqrt(v * ((kappa - v) ** 2 + g**2) / 0.75)


@settings(max_examples=10)
@given(st.floats(0.002, 0.03), st.floats(1.1, 3.0))
def test_folds_of_one_harmonic_are_those_of_the_cubic(delta, depth):
    omega = 1 - depth * np.sqrt(3) / 2 * delta
    up, down = folds_in_epsilon(delta, omega)
    chain = Chain(1, delta, -1.0)
    start = Setting.of(chain, epsilon=0.2 * up, lam=0, omega=omega)
    path = continue_branch(
        chain, start, parameter="epsilon", stop=3 * up, harmonics=1, step=0.05, max_points=600
    )  # fmt: skip
    assert path.ending is Ending.REACHED
    assert path.value[-1] == 3 * up
    assert (path.jump_up, path.jump_down) == pytest.approx((up, down), rel=1e-9)


def test_every_point_of_an_open_chain_is_an_answer():
    chain = Chain(3, 0.01, -1.0)
    start = Setting.of(chain, epsilon=1e-5, lam=0.01, omega=0.98)
    path = continue_branch(
        chain, start, parameter="epsilon", stop=6e-3, harmonics=5, step=0.05, max_points=900
    )  # fmt: skip
    assert path.ending is Ending.REACHED
    assert len(path.folds) >= 2
    for k in (5, path.folds[0].index + 3, len(path.value) - 3):
        setting = Setting.of(chain, epsilon=path.value[k], lam=0.01, omega=0.98)
        every = solve(chain, setting, tol=1e-7, rung="harmonic_balance", start="all")
        gap = np.abs(every.phasor - path.phasor[k]).max(axis=1)
        assert gap.min() < 1e-6 * path.amplitude[k].max()
        assert every.stable[gap.argmin()] == path.stable[k]


def test_the_soft_spring_jumps_where_the_sweep_does():
    chain = Chain(1, 0.01, -1.0)
    start = Setting.of(chain, epsilon=2e-3, lam=0, omega=1.05)
    path = continue_branch(
        chain, start, parameter="omega", stop=0.93, harmonics=3, step=0.05, max_points=600
    )  # fmt: skip
    down, up = path.jump_down, path.jump_up
    assert down < up < 1
    # The branch is lost at the first fold and found again at the second, nowhere else.
    assert list(np.flatnonzero(np.diff(path.stable))) == pytest.approx([f.index for f in path.folds], abs=1)
    low = [
        reached(chain, Setting.of(chain, epsilon=2e-3, lam=0, omega=w), start="ramp") for w in (up - 5e-4, up + 5e-4)
    ]
    fold = next(f for f in path.folds if f.rising)
    assert np.abs(low[0].phasor[0, 0]) < np.abs(fold.phasor[0]) < 0.7 * np.abs(low[1].phasor[0, 0])


def test_lam_keeps_the_ratios_of_the_links():
    chain = Chain(3, 0.02, -1.0)
    start = Setting.of(chain, epsilon=1e-3, lam=np.array([0.01, 0.02]), omega=1.01)
    path = continue_branch(
        chain, start, parameter="lam", stop=0.2, harmonics=3, step=0.05, max_points=300
    )  # fmt: skip
    assert (path.value[0], path.value[-1]) == (0.02, 0.2)
    wanted = solve(chain, Setting.of(chain, epsilon=1e-3, lam=np.array([0.1, 0.2]), omega=1.01), tol=1e-9)
    assert path.phasor[-1] == pytest.approx(wanted.phasor[0], rel=1e-6)


def test_lam_may_start_at_zero():
    chain = Chain(2, 0.02, -1.0)
    start = Setting.of(chain, epsilon=1e-3, lam=0, omega=1.01)
    path = continue_branch(chain, start, parameter="lam", stop=0.1, harmonics=3, step=0.1, max_points=300)
    wanted = solve(chain, Setting.of(chain, epsilon=1e-3, lam=0.1, omega=1.01), tol=1e-9)
    assert path.phasor[-1] == pytest.approx(wanted.phasor[0], rel=1e-6)


def test_a_preload_brings_means_and_even_harmonics():
    chain = Chain(2, 0.02, -1.0)
    setting = Setting.of(chain, epsilon=1e-3, lam=0.05, omega=0.97, preload=0.1)
    path = continue_branch(
        chain, setting, parameter="epsilon", stop=3e-3, harmonics=5, step=0.1, max_points=300
    )  # fmt: skip
    wanted = solve(chain, Setting.of(chain, epsilon=3e-3, lam=0.05, omega=0.97, preload=0.1), tol=1e-9)
    if not path.folds:
        assert path.phasor[-1] == pytest.approx(wanted.phasor[0], rel=1e-5)
    assert (path.mean[:, 0] > 0.09).all()


def test_the_papers_ring_is_lost_below_a_drive():
    chain = Chain(6, 5.3006e-3, -1.0, Closure.RING)
    setting = Setting.of(chain, epsilon=3e-3, lam=6.131e-3, omega=1.0)
    begin = solve(chain, setting, tol=1e-8)
    assert begin.outcome[0] == Outcome.OK
    path = continue_branch(
        chain, setting, parameter="epsilon", stop=1e-3, harmonics=3, step=0.05, max_points=300, start=begin.phasor[0]
    )  # fmt: skip
    assert path.phasor[0] == pytest.approx(begin.phasor[0], rel=1e-6)
    assert path.stable[0]
    lost = path.value[np.flatnonzero(~path.stable)[0]]
    # It does not fold there: a pair of multipliers leaves, and a beat begins.
    assert not path.folds
    beyond = reached(chain, Setting.of(chain, epsilon=[0.97 * lost, 1.2 * lost], lam=6.131e-3, omega=1.0), start="rest")
    assert list(beyond.outcome) == [Outcome.NOT_LOCKED, Outcome.OK]


@settings(max_examples=5)
@given(st.floats(1e-8, 1e8))
def test_beta_is_a_length_scale(stretch):
    found = []
    for beta in (-1.0, -stretch):
        chain = Chain(1, 0.01, beta)
        start = Setting.of(chain, epsilon=1e-4 / np.sqrt(-beta), lam=0, omega=0.985)
        stop = 2e-3 / np.sqrt(-beta)
        path = continue_branch(chain, start, parameter="epsilon", stop=stop, harmonics=3, step=0.1, max_points=300)
        found.append(np.array([fold.at for fold in path.folds]) * np.sqrt(-beta))
    assert found[1] == pytest.approx(found[0], rel=1e-7)


def test_too_few_points_are_said():
    chain = Chain(1, 0.01, -1.0)
    start = Setting.of(chain, epsilon=1e-4, lam=0, omega=0.99)
    path = continue_branch(chain, start, parameter="epsilon", stop=1e-2, harmonics=3, step=0.01, max_points=5)
    assert path.ending is Ending.OUT_OF_POINTS
    assert len(path.value) == 5


def test_bad_questions_are_named():
    chain = Chain(2, 0.01, -1.0)
    good: dict[str, Any] = {"parameter": "epsilon", "stop": 1e-2, "harmonics": 3, "step": 0.1, "max_points": 10}
    one = Setting.of(chain, epsilon=1e-4, lam=0.01, omega=1.0)
    bad = {"parameter": "beta", "stop": np.nan, "harmonics": 2, "step": 0.0, "max_points": 1}
    for name, value in bad.items():
        with pytest.raises(ContinuationError, match=name):
            continue_branch(chain, one, **{**good, name: value})
    with pytest.raises(ContinuationError, match="stop"):
        continue_branch(chain, one, **{**good, "stop": 1e-4})
    with pytest.raises(ContinuationError, match="setting"):
        continue_branch(chain, Setting.of(chain, epsilon=[1e-4, 1e-3], lam=0.01, omega=1.0), **good)
