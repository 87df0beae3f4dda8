"""Compiled 2-D grids, and everything the compiled sweep must leave to `solve`."""

import os

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from numpy.typing import ArrayLike

from chainsim import Chain, Outcome, Setting, solve
from chainsim.batch.sweep import OUTCOMES, sweep

OK = OUTCOMES.index(Outcome.OK)


def random_grid(
    rows, cols, size, *, seed,
    epsilon: tuple[float, float] = (1e-3, 1e-2), omega: tuple[float, float] = (0.9, 1.3), delta=0.05, beta=-1.0,
):  # fmt: skip
    rng = np.random.default_rng(seed)
    chain = Chain(rows * cols, delta, beta, rows=rows)
    return chain, Setting.of(
        chain, epsilon=rng.uniform(*epsilon, size), omega=rng.uniform(*omega, size), phase=rng.uniform(0, 6, size),
        lam=rng.uniform(0.02, 0.3, (size, rows, cols - 1)), lam_y=rng.uniform(0.02, 0.3, (size, rows - 1, cols)),
    )  # fmt: skip


def test_a_grid_whose_links_share_one_strength_is_a_chain_along_its_diagonals():
    rows, cols = 21, 19
    share = np.random.default_rng(1).uniform(0.3, 0.7, (rows, cols))
    share[0], share[:, 0] = 1.0, 0.0
    grid, line = Chain(rows * cols, 5.3e-3, -1.0, rows=rows), Chain(rows + cols - 1, 5.3e-3, -1.0)
    links: dict[str, ArrayLike] = {"lam": 0.3 * share[:, 1:], "lam_y": 0.3 * (1 - share[1:])}
    found = sweep(grid, Setting.of(grid, epsilon=1e-2, omega=1.1, **links), tol=1e-6, from_rest=False)
    wanted = sweep(line, Setting.of(line, epsilon=1e-2, omega=1.1, lam=0.3), tol=1e-6, from_rest=False)
    diagonal = np.add.outer(np.arange(rows), np.arange(cols)).ravel()
    assert found.code[0] == wanted.code[0] == OK
    np.testing.assert_allclose(found.phasor[0], wanted.phasor[0, diagonal], rtol=1e-12)
    np.testing.assert_allclose(found.multipliers[0], wanted.multipliers[0, diagonal], rtol=1e-8)
    assert found.error_estimate[0] == pytest.approx(wanted.error_estimate[0], rel=1e-6)


@pytest.mark.parametrize(("rows", "cols"), [(2, 2), (3, 5), (18, 2)])
def test_agrees_with_numpy(rows, cols):
    chain, setting = random_grid(rows, cols, 20, seed=rows)
    fast = sweep(chain, setting, tol=1e-8, from_rest=False)
    slow = solve(chain, setting, tol=1e-11, rung="harmonic_balance")
    both = (fast.code == OK) & (slow.outcome == Outcome.OK)
    assert both.sum() >= 15
    size = np.abs(slow.phasor).max(axis=1, keepdims=True)
    assert np.all((np.abs(fast.phasor - slow.phasor) / size)[both] < 1e-8)
    assert np.all((np.abs(fast.third - slow.third) / size)[both] < 1e-8)
    assert np.array_equal(fast.branch[both], slow.branch[both])
    assert np.array_equal(fast.stable[both], slow.stable[both])
    one, other = fast.multipliers[both], slow.multipliers[both]
    apart = np.minimum(np.abs(one - other).max(axis=2), np.abs(one[..., ::-1] - other).max(axis=2))
    assert apart.max() < 1e-6


def test_agrees_with_the_integrated_equations():
    chain, setting = random_grid(2, 3, 6, seed=5, epsilon=(3e-3, 1e-2), omega=(1.1, 1.3))
    fast = sweep(chain, setting, tol=1e-9, from_rest=True)
    full = solve(chain, setting, tol=1e-10, rung="ode")
    assert (full.outcome == Outcome.OK).all()
    assert (fast.code == OK).all()
    assert np.abs(fast.phasor - full.phasor).max() < 1e-8 * np.abs(full.phasor).max()


@settings(max_examples=15, deadline=None)
@given(st.integers(1, 40), st.integers(0, 10**6))
def test_a_grid_does_not_feel_its_neighbours(size, seed):
    chain, setting = random_grid(3, 4, size, seed=seed)
    together = sweep(chain, setting, tol=1e-3, from_rest=False)
    at = seed % size
    alone = sweep(chain, setting[at : at + 1], tol=1e-3, from_rest=False)
    for name in ("code", "phasor", "third", "multipliers", "branch", "stable", "error_estimate"):
        assert np.array_equal(getattr(alone, name)[0], getattr(together, name)[at], equal_nan=True), name


def test_a_grid_without_an_answer_spoils_no_other():
    size = 2 * (os.cpu_count() or 1) + 2
    chain, setting = random_grid(3, 4, size, seed=1)
    wanted = sweep(chain, setting, tol=1e-3, from_rest=False)
    links = {"lam": setting.lam.reshape(-1, 3, 4)[:, :, 1:], "lam_y": setting.lam_y.reshape(-1, 3, 4)[:, 1:]}
    epsilon = np.where(np.arange(size) == 0, 1e200, setting.epsilon)
    lost = Setting.of(chain, epsilon=epsilon, omega=setting.omega, phase=setting.phase, **links)
    found = sweep(chain, lost, tol=1e-3, from_rest=False)
    assert found.code[0] != OK
    assert (wanted.code == OK).all()
    assert np.array_equal(found.phasor[1:], wanted.phasor[1:])
    assert np.array_equal(found.error_estimate[1:], wanted.error_estimate[1:])


def test_grids_in_numpy_read_nothing_that_was_not_written(monkeypatch):
    chain, setting = random_grid(4, 4, 2, seed=3)
    wanted = solve(chain, setting, tol=1e-9, rung="harmonic_balance")
    real = np.empty

    def unwritten(*args, **rest):
        array = real(*args, **rest)
        if array.dtype.kind in "fc":
            array.fill(np.nan)
        return array

    monkeypatch.setattr(np, "empty", unwritten)
    found = solve(chain, setting, tol=1e-9, rung="harmonic_balance")
    monkeypatch.undo()
    assert list(found.outcome) == [Outcome.OK, Outcome.OK]
    assert np.array_equal(found.phasor, wanted.phasor)


def test_what_five_harmonics_cannot_do_is_solved_with_more():
    chain, setting = random_grid(2, 2, 8, seed=2, epsilon=(0.1, 0.2), omega=(0.3, 0.5))
    loose = sweep(chain, setting, tol=1.0, from_rest=False)
    found = sweep(chain, setting, tol=1e-11, from_rest=False)
    assert (loose.error_estimate > 1e-11).any()
    assert (found.error_estimate[found.code == OK] <= 1e-11).all()
    wanted = solve(chain, setting, tol=1e-11, rung="harmonic_balance")
    assert list(found.outcome) == list(wanted.outcome)


def test_a_grid_without_columns_to_the_right_is_a_chain_downwards():
    grid, line = Chain(5, 0.02, -1.0, rows=5), Chain(5, 0.02, -1.0)
    links = np.array([0.1, 0.2, 0.15, 0.3])
    found = sweep(
        grid, Setting.of(grid, epsilon=1e-2, lam=0.0, lam_y=links[:, None], omega=1.1), tol=1e-6, from_rest=False
    )
    wanted = sweep(line, Setting.of(line, epsilon=1e-2, lam=links, omega=1.1), tol=1e-6, from_rest=False)
    np.testing.assert_allclose(found.phasor, wanted.phasor, rtol=1e-13)


N = 4
NOT_PLAIN: dict[str, tuple[Chain, dict[str, ArrayLike]]] = {
    "amplifier": (Chain.of(N, delta=0.05, beta=-1.0, kind="amplifier"), {}),
    "ring": (Chain.of(N, delta=0.05, beta=-1.0, closure="ring"), {}),
    "both ways": (Chain.of(N, delta=0.05, beta=-1.0, closure="bidirectional"), {}),
    "damping": (Chain.of(N, delta=[0.05, 0.06, 0.05, 0.05], beta=-1.0), {}),
    "cubic": (Chain.of(N, delta=0.05, beta=[-1.0, -1.0, 1.0, -1.0]), {}),
    "frequency": (Chain.of(N, delta=0.05, beta=-1.0, stiffness=[1.0, 1.0, 1.02, 1.0]), {}),
    "bias": (Chain(N, 0.05, -1.0), {"bias": [0.0, 0.0, 0.1, 0.0]}),
    "preload": (Chain(N, 0.05, -1.0), {"preload": 0.05}),
    "amplifier grid": (Chain.of(N, delta=0.05, beta=-1.0, rows=2, kind="amplifier"), {"lam_y": 0.04}),
    "grid of unlike oscillators": (Chain.of(N, delta=[0.05, 0.06, 0.05, 0.05], beta=-1.0, rows=2), {"lam_y": 0.04}),
}


@pytest.mark.parametrize("from_rest", [False, True])
@pytest.mark.parametrize("name", NOT_PLAIN)
def test_what_is_not_plain_is_answered_as_by_solve(name, from_rest):
    chain, more = NOT_PLAIN[name]
    question: dict[str, ArrayLike] = {"epsilon": [1e-2, 2e-2, 4e-2], "omega": 1.1, "lam": 0.04}
    setting = Setting.of(chain, **question, **more)
    found = sweep(chain, setting, tol=1e-6, from_rest=from_rest)
    wanted = solve(chain, setting, tol=1e-6, rung="auto" if from_rest else "harmonic_balance")
    assert list(found.outcome) == list(wanted.outcome)
    for field in ("phasor", "third", "mean", "multipliers", "branch", "stable", "error_estimate"):
        assert np.array_equal(getattr(found, field), getattr(wanted, field), equal_nan=True), field
    plain = Chain(N, 0.05, -1.0, rows=chain.rows)
    links: dict[str, ArrayLike] = {"lam_y": 0.04} if chain.rows > 1 else {}
    other = sweep(plain, Setting.of(plain, **question, **links), tol=1e-6, from_rest=False)
    both = (found.code == OK) & (other.code == OK)
    assert both.any()
    assert (np.abs(found.phasor - other.phasor) / np.abs(other.phasor)).max(axis=1)[both].min() > 1e-5
