"""Steady states from rest: the sixty references, DOP853, and what must not be called settled."""

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from chainsim import Branch, Chain, Closure, Outcome, Setting, solve
from chainsim.rung import RungError, Start
from chainsim.time_domain.ode import OdeRung, reached_from_rest, steady_from_rest

CASES = json.loads((Path(__file__).parents[1] / "data" / "steady_states.json").read_text())
PAPER = Chain(n=6, delta=5.3006e-3, beta=-1.0)
BUDGET = 40_000


def solved(case, tol=1e-11):
    chain = Chain(case["n"], case["delta"], case["beta"], case["closure"])
    setting = Setting.of(chain, epsilon=case["epsilon"], lam=case["lam"], omega=case["omega"])
    return steady_from_rest(chain, setting, tol=tol, max_periods=BUDGET)


def complexes(pairs):
    return np.array([complex(*pair) for pair in pairs])


@pytest.mark.parametrize("index", range(len(CASES)))
def test_reference(index):
    case = CASES[index]
    response = solved(case)
    wanted = {"ok": Outcome.OK, "escaped": Outcome.ESCAPED, "not_periodic": Outcome.NOT_LOCKED}[case["outcome"]]
    assert response.outcome[0] is wanted
    assert response.locked[0] == response.stable[0] == (wanted is Outcome.OK)
    if wanted is not Outcome.OK:
        assert np.isnan(response.phasor).all()
        return
    phasor = complexes(case["phasor"])
    error = np.max(np.abs(response.phasor[0] - phasor) / np.abs(phasor))
    assert error < 1e-9
    assert np.max(np.abs(response.third[0] - complexes(case["third"])) / np.abs(phasor)) < 1e-10
    assert np.max(np.abs(response.mean[0] - case["mean"]) / np.abs(phasor)) < 1e-10
    # The reference took the eigenvalues of the whole monodromy, which for a chain is far from normal:
    # its own round-off moves them by up to 6e-3 at twelve oscillators.
    exact = case["n"] <= 2 or case["closure"] == "ring"
    largest = np.max(np.abs(response.multipliers))
    assert largest == pytest.approx(case["max_multiplier"], abs=1e-8 if exact else 1e-2)


@pytest.mark.parametrize("index", [i for i, c in enumerate(CASES) if c["outcome"] == "ok"][::5])
def test_multipliers_have_the_product_damping_gives(index):
    case = CASES[index]
    product = np.prod(solved(case).multipliers[0], axis=-1)
    decay = np.exp(-case["delta"] * 2 * np.pi / case["omega"])
    if case["closure"] == "ring":
        assert np.prod(product) == pytest.approx(decay ** case["n"], rel=1e-9)
    else:
        assert product == pytest.approx(np.full(case["n"], decay), rel=1e-11)


def test_a_batch_is_its_members():
    epsilon, lam = np.array([1e-4, 4e-4, 2e-3, 1.0]), np.array([[3e-3], [6.131e-3], [0.02], [6e-3]])
    together = Setting.of(PAPER, epsilon=epsilon, lam=lam, omega=1.0)
    batch = steady_from_rest(PAPER, together, tol=1e-10, max_periods=6000)
    for i in range(4):
        one = steady_from_rest(PAPER, together[i : i + 1], tol=1e-10, max_periods=6000)
        assert batch.outcome[i] is one.outcome[0]
        np.testing.assert_array_equal(batch.harmonics[i], one.harmonics[0])
    assert batch.outcome[1] is Outcome.OK
    assert batch.outcome[3] is Outcome.ESCAPED


def test_preload_bias_and_phase_agree_with_dop853():
    chain = Chain(n=2, delta=0.1, beta=-1.0)
    setting = Setting.of(chain, epsilon=0.02, lam=0.2, omega=0.9, preload=0.05, bias=[0.0, -0.1], phase=0.7)
    response = steady_from_rest(chain, setting, tol=1e-11, max_periods=2000)

    def slope(tau, y):
        first = 0.02 * np.cos(0.9 * tau + 0.7) + 0.05
        second = 0.2 * (y[0] - y[1]) - 0.1
        return [y[2], y[3], first - 0.1 * y[2] - y[0] + y[0] ** 3, second - 0.1 * y[3] - y[1] + y[1] ** 3]

    period, samples = 2 * np.pi / 0.9, 64
    times = (120 + np.arange(samples) / samples) * period
    z = solve_ivp(slope, (0, times[-1]), np.zeros(4), method="DOP853", rtol=1e-12, atol=1e-15, t_eval=times).y[:2]
    waves = np.fft.rfft(z, axis=1).T / samples
    assert response.outcome[0] is Outcome.OK
    assert response.mean[0] == pytest.approx(waves[0].real, abs=1e-9)
    for k in range(1, 8):
        assert response.harmonics[0, k - 1] == pytest.approx(2 * waves[k], abs=1e-9)


def test_linear_chain_is_the_product_of_stage_gains():
    chain = Chain(n=4, delta=0.03, beta=0.0)
    response = steady_from_rest(
        chain, Setting.of(chain, epsilon=0.01, lam=0.2, omega=1.05), tol=1e-11, max_periods=5000
    )
    own = 1 - 1.05**2 + 1j * 0.03 * 1.05
    phasor = 0.01 / own * (0.2 / (own + 0.2)) ** np.arange(4)
    assert response.phasor[0] == pytest.approx(phasor, rel=1e-10)
    assert response.error_estimate[0] <= 1e-11


def test_a_linear_ring_escapes_just_above_its_threshold():
    # Modes 60 degrees apart: delta^2 (1 + lam (1 - cos phi)) = lam^2 sin^2 phi; the paper's 6.13e-3.
    ring = Chain(n=6, delta=5.3006e-3, beta=0.0, closure=Closure.RING)
    phi = np.pi / 3
    a, b = np.sin(phi) ** 2, ring.delta**2 * (1 - np.cos(phi))
    threshold = (b + np.sqrt(b**2 + 4 * a * ring.delta**2)) / (2 * a)
    assert threshold == pytest.approx(6.13e-3, abs=1e-5)
    links = threshold * np.array([0.999, 1.001])[:, None]
    response = steady_from_rest(ring, Setting.of(ring, epsilon=1e-4, lam=links, omega=1.0), tol=1e-9, max_periods=1000)
    assert list(response.outcome) == [Outcome.OK, Outcome.ESCAPED]


def test_a_cascade_of_jumps_is_waited_for():
    # Near a fold the six oscillators jump one after the other, each after hundreds of periods of standing still.
    chain = Chain(n=6, delta=6.1e-3, beta=-1.0)
    setting = Setting.of(chain, epsilon=0.0029883512, lam=0.00641976, omega=0.99572774)
    response = steady_from_rest(chain, setting, tol=1e-8, max_periods=BUDGET)
    assert response.outcome[0] is Outcome.OK
    assert np.abs(response.phasor[0, 3:]) == pytest.approx([0.151] * 3, abs=1e-3)


def test_arrays_are_read_only():
    response = steady_from_rest(PAPER, Setting.of(PAPER, epsilon=1e-4, lam=3e-3, omega=1.0), tol=1e-6, max_periods=5000)
    with pytest.raises(ValueError, match="read-only"):
        response.phasor[0, 0] = 0


def test_scaling_removes_beta():
    small, large = Chain(3, 0.02, -1.0), Chain(3, 0.02, -1e12)
    one = steady_from_rest(small, Setting.of(small, epsilon=4e-3, lam=0.05, omega=1.0), tol=1e-9, max_periods=5000)
    two = steady_from_rest(large, Setting.of(large, epsilon=4e-9, lam=0.05, omega=1.0), tol=1e-9, max_periods=5000)
    assert one.outcome[0] is two.outcome[0] is Outcome.OK
    assert two.phasor[0] * 1e6 == pytest.approx(one.phasor[0], rel=1e-9)


def test_the_error_estimate_covers_the_error():
    setting = Setting.of(PAPER, epsilon=[4e-4, 1e-3], lam=6.131e-3, omega=0.995)
    fine = steady_from_rest(PAPER, setting, tol=1e-12, max_periods=BUDGET)
    for tol in (1e-4, 1e-6, 1e-8):
        rough = steady_from_rest(PAPER, setting, tol=tol, max_periods=BUDGET)
        error = np.max(np.abs(rough.phasor - fine.phasor) / np.abs(fine.phasor), axis=1)
        assert (error <= rough.error_estimate + fine.error_estimate).all()
        assert (rough.error_estimate <= tol).all()


def test_the_branch_from_rest_is_named():
    chain = Chain(n=1, delta=0.01, beta=-1.0)
    drives = [2e-4, 5.5e-3, 6e-3, 8e-3]
    response = steady_from_rest(
        chain, Setting.of(chain, epsilon=drives, lam=0.0, omega=0.97), tol=1e-8, max_periods=5000
    )
    assert (response.outcome == Outcome.OK).all()
    # The overshoot of a sudden 6e-3 lands on the upper of three answers; at 8e-3 there is one answer only.
    assert list(response.branch[:, 0]) == [Branch.LOW, Branch.LOW, Branch.HIGH, Branch.LOW]
    amplitude = np.abs(response.phasor[:, 0])
    assert amplitude[1] < 0.11
    assert amplitude[2] > 0.31


def test_slow_settling_is_not_taken_for_beating():
    chain = Chain(n=6, delta=1e-3, beta=-1.0)
    response = steady_from_rest(
        chain, Setting.of(chain, epsilon=2e-6, lam=1.1e-3, omega=1.0), tol=1e-8, max_periods=BUDGET
    )
    assert response.outcome[0] is Outcome.OK
    assert response.stats.periods > 2000


@pytest.mark.parametrize("epsilon", [6e-4, 8e-4])
def test_the_paper_ring_beats_at_middle_drive(epsilon):
    ring = Chain(n=6, delta=5.3006e-3, beta=-1.0, closure=Closure.RING)
    setting = Setting.of(ring, epsilon=epsilon, lam=6.131e-3, omega=1.0)
    assert steady_from_rest(ring, setting, tol=1e-8, max_periods=BUDGET).outcome[0] is Outcome.NOT_LOCKED


def test_reached_from_rest_is_close_to_the_polished_answer():
    setting = Setting.of(PAPER, epsilon=[1e-4, 4e-4, 3.0], lam=6.131e-3, omega=1.0)
    quick = reached_from_rest(PAPER, setting, max_periods=BUDGET)
    full = steady_from_rest(PAPER, setting, tol=1e-10, max_periods=BUDGET)
    assert list(quick.outcome) == [Outcome.OK, Outcome.OK, Outcome.ESCAPED] == list(full.outcome)
    assert quick.phasor[:2] == pytest.approx(full.phasor[:2], rel=1e-4)
    assert np.isnan(quick.phasor[2]).all()
    assert quick.stats.rhs_evals < full.stats.rhs_evals


def test_too_few_periods_is_out_of_budget():
    setting = Setting.of(PAPER, epsilon=4e-4, lam=6.131e-3, omega=1.0)
    response = steady_from_rest(PAPER, setting, tol=1e-8, max_periods=100)
    assert response.outcome[0] is Outcome.OUT_OF_BUDGET
    assert response.stats.periods == 100
    assert np.isnan(response.harmonics).all()


EXTREMES = [
    {"epsilon": 0.0},
    {"lam": 0.0},
    {"omega": 1e-6},
    {"omega": 0.05},
    {"omega": 1e3},
    {"delta": 0.0},
    {"delta": 1e-9},
    {"delta": 5.0},
    {"beta": 0.0},
    {"beta": -1e6},
    {"beta": -1e12, "epsilon": 1e-10},
    {"epsilon": 1e300},
    {"preload": 0.5},
    {"lam": -2.0},
    {"lam": 50.0},
    {"n": 1},
    {"n": 64},
]


@pytest.mark.parametrize("closure", ["open", "ring"])
@pytest.mark.parametrize("extreme", EXTREMES, ids=str)
def test_extremes_end_in_an_outcome(extreme, closure):
    values = {"n": 3, "delta": 0.02, "beta": -1.0, "epsilon": 1e-3, "lam": 0.05, "omega": 1.0, "preload": 0.0} | extreme
    chain = Chain(values["n"], values["delta"], values["beta"], closure)
    setting = Setting.of(chain, **{k: values[k] for k in ("epsilon", "lam", "omega", "preload")})
    response = steady_from_rest(chain, setting, tol=1e-6, max_periods=1500)
    assert isinstance(response.outcome[0], Outcome)
    ok = response.outcome[0] is Outcome.OK
    assert np.isfinite(response.harmonics).all() == ok
    assert not ok or response.error_estimate[0] <= 1e-6
    assert response.stats.periods <= 2 * 1500


def test_the_rung_answers_from_rest_only():
    rung, setting = OdeRung(), Setting.of(PAPER, epsilon=1e-4, lam=3e-3, omega=1.0)
    assert rung.solve(PAPER, setting, tol=1e-6, start=Start.REST).outcome[0] is Outcome.OK
    with pytest.raises(RungError, match="use start rest"):
        rung.solve(PAPER, setting, tol=1e-6, start=Start.ALL)


def test_impossible_requests_are_refused():
    setting = Setting.of(PAPER, epsilon=1e-4, lam=3e-3, omega=1.0)
    with pytest.raises(RungError, match="tol"):
        steady_from_rest(PAPER, setting, tol=1e-14, max_periods=100)
    with pytest.raises(RungError, match="max_periods"):
        steady_from_rest(PAPER, setting, tol=1e-6, max_periods=0)


def test_a_slow_passage_by_the_ghost_of_a_fold_is_not_a_beat():
    """An open chain that hesitates for about 40,000 tau before it settles on its only answer."""
    chain = PAPER
    setting = Setting.of(chain, epsilon=2.7524447e-4, lam=0.010, omega=1.0)
    found = steady_from_rest(chain, setting, tol=1e-8, max_periods=60_000)
    assert found.outcome[0] is Outcome.OK
    only = solve(chain, setting, tol=1e-8, rung="harmonic_balance", start="rest")
    np.testing.assert_allclose(found.phasor, only.phasor, atol=1e-7)
