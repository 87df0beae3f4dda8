"""Which answer a start reaches: the envelope's verdicts against the full equations."""

import numpy as np
import pytest

from chainsim import Branch, Chain, Outcome, Setting, reached_from_rest, solve
from chainsim.averaging.decide import decide
from chainsim.reach.ramp import from_ramp
from chainsim.reach.rest import sure_from_rest
from chainsim.rung import Start
from chainsim.time_domain.ode import steady_from_ramp

PAPER = Chain(6, 6.1e-3, -1.0)
BUDGET = 60_000


def multistable(seed, count, draws):
    """Settings of the paper's chain in which some oscillator of the lower answer has three."""
    rng = np.random.default_rng(seed)
    drawn = Setting.of(
        PAPER,
        epsilon=np.exp(rng.uniform(np.log(3e-5), np.log(3e-3), draws)),
        lam=rng.uniform(3e-3, 9e-3, (draws, 1)),
        omega=rng.uniform(0.985, 1.015, draws),
    )
    low = solve(PAPER, drawn, tol=1e-3, rung="one_harmonic").phasor
    force = np.concatenate([drawn.epsilon[:, None] + 0j, drawn.lam[:, 1:] * low[:, :-1]], axis=1)
    omega = drawn.omega[:, None]
    kappa, g = 1 + drawn.lam - omega**2, PAPER.delta * omega
    # v ((kappa - v)^2 + g^2) = 3/4 |F|^2 has three roots between its two extrema.
    root = np.sqrt(np.maximum(kappa**2 - 3 * g**2, 0))
    dip, peak = (2 * kappa + root) / 3, (2 * kappa - root) / 3
    value = [v * ((kappa - v) ** 2 + g**2) for v in (dip, peak)]
    load = 0.75 * np.abs(force) ** 2
    several = (kappa > np.sqrt(3) * g) & (load >= value[0]) & (load <= value[1])
    chosen = np.flatnonzero(several.any(axis=1))[:count]
    assert len(chosen) == count
    return drawn[chosen]


def same(a, b, far):
    return (np.abs(a - b) <= far * np.abs(b)).all(axis=1)


def judged(setting):
    """Where the envelope is sure, where it is right, and where the lower answer is not the one reached."""
    truth = reached_from_rest(PAPER, setting, max_periods=BUDGET)
    assert (truth.outcome == Outcome.OK).all()
    low = solve(PAPER, setting, tol=1e-6, rung="harmonic_balance")
    decision = decide(PAPER, setting, Start.REST)
    bounded = sure_from_rest(PAPER, setting, low)
    lower = same(low.phasor, truth.phasor, 0.02)
    assert lower[bounded].all()
    assert np.isnan(decision.phasor[~decision.sure]).all()
    return decision.sure, same(decision.phasor, truth.phasor, 0.05), ~lower


def test_a_sure_verdict_on_a_sudden_drive_is_right():
    sure, right, unusual = judged(multistable(5, 60, 1400))
    assert right[sure].all()
    assert sure.mean() >= 0.9
    assert unusual.any()


@pytest.mark.slow
def test_of_1500_multistable_settings_none_is_decided_wrongly():
    sure, right, unusual = judged(multistable(17, 1500, 30_000))
    assert right[sure].all()
    assert sure.mean() >= 0.95
    # Here 3 to 6 % go elsewhere than to the lower answer; most of those are found without the full equations.
    assert 0.02 <= unusual.mean() <= 0.1
    assert (sure & unusual).sum() >= 0.75 * unusual.sum()


@pytest.mark.slow
def test_far_from_the_paper_a_sure_verdict_is_right_too():
    rng = np.random.default_rng(23)
    asked = certain = 0
    for _ in range(40):
        n, beta = int(rng.integers(1, 9)), float(rng.choice([-1.0, 1.0]))
        delta, count = float(np.exp(rng.uniform(np.log(4e-3), np.log(6e-2)))), 60
        chain = Chain(n, delta, beta)
        omega = 1 + rng.uniform(0.5, 6, count) * delta * beta
        a = rng.uniform(0.02, 0.4, count)
        epsilon = a * np.abs(1 - omega**2 + 0.75 * beta * a**2 + 1j * delta * omega) * rng.uniform(0.5, 1.5, count)
        lam = np.exp(rng.uniform(np.log(0.3 * delta), np.log(10 * delta), (count, n - 1))) if n > 1 else 0.0
        setting = Setting.of(chain, epsilon=epsilon, lam=lam, omega=omega)
        truth = reached_from_rest(chain, setting, max_periods=BUDGET)
        low = solve(chain, setting, tol=1e-6, rung="harmonic_balance")
        sure = sure_from_rest(chain, setting, low)
        assert (truth.outcome[sure] == Outcome.OK).all()
        assert same(low.phasor, truth.phasor, 0.02)[sure].all()
        asked, certain = asked + count, certain + int(sure.sum())
    assert certain >= 0.5 * asked


def test_the_envelope_costs_a_small_part_of_the_kicks():
    setting = multistable(5, 20, 1400)
    work = reached_from_rest(PAPER, setting, max_periods=BUDGET).stats.rhs_evals
    assert decide(PAPER, setting, Start.REST).stats.rhs_evals < work / 20


def test_auto_takes_the_envelopes_word_where_it_is_sure(monkeypatch):
    setting = multistable(5, 60, 1400)
    low = solve(PAPER, setting, tol=1e-6, rung="harmonic_balance")
    settled = setting[sure_from_rest(PAPER, setting, low)]
    assert len(settled) > 45

    def never(*_args, **_more):
        raise AssertionError("nothing is to be integrated here")

    monkeypatch.setattr("chainsim.time_domain.ode.reached_from_rest", never)
    assert (solve(PAPER, settled, tol=1e-6).outcome == Outcome.OK).all()


def test_a_verdict_does_not_depend_on_its_neighbours():
    setting = multistable(5, 12, 1400)
    together = decide(PAPER, setting, Start.REST)
    for i in range(0, 12, 5):
        alone = decide(PAPER, setting[i : i + 1], Start.REST)
        assert alone.sure[0] == together.sure[i]
        np.testing.assert_allclose(alone.phasor[0], together.phasor[i], rtol=1e-9)


def test_the_edge_of_a_basin_is_not_sure():
    # Between these drives the overshoot begins to carry the motion to the upper of three answers.
    chain = Chain(1, 0.01, -1.0)
    low, high = 5.5e-3, 6e-3
    for _ in range(24):
        middle = 0.5 * (low + high)
        there = reached_from_rest(chain, Setting.of(chain, epsilon=middle, lam=0, omega=0.97), max_periods=BUDGET)
        low, high = (middle, high) if abs(there.phasor[0, 0]) < 0.2 else (low, middle)
    drives = [0.97 * low, low, high, 1.03 * high]
    decision = decide(chain, Setting.of(chain, epsilon=drives, lam=0, omega=0.97), Start.REST)
    assert list(decision.sure[1:3]) == [False, False]
    assert (np.abs(decision.phasor[decision.sure, 0]) > 0.2).tolist() == [
        which for which, sure in zip([False, True], decision.sure[[0, 3]], strict=True) if sure
    ]


def test_what_the_slow_flow_is_not_true_of_is_not_sure():
    chain = Chain(2, 0.02, -1.0)
    wild = Setting.of(chain, epsilon=[0.5, 1e12], lam=0.05, omega=1.0)
    assert not decide(chain, wild, Start.REST).sure.any()
    stiff = Chain(2, 1e6, -1.0)
    assert not decide(stiff, Setting.of(stiff, epsilon=1e-3, lam=0.05, omega=1.0), Start.REST).sure.any()


RAMPED = Setting.of(
    PAPER, epsilon=[1.4e-3, 2.5e-3, 1e-4], lam=np.array([[4e-3], [8e-3], [5e-3]]), omega=[0.992, 0.99, 1.01]
)


@pytest.mark.slow
def test_a_ramp_past_a_fold_ends_where_the_full_equations_say():
    steady = solve(PAPER, RAMPED, tol=1e-6, rung="harmonic_balance", start="ramp")
    assert list(steady.outcome) == [Outcome.NO_CONVERGENCE, Outcome.NO_CONVERGENCE, Outcome.OK]
    found = from_ramp(PAPER, RAMPED, steady, tol=1e-8, max_periods=BUDGET)
    truth = steady_from_ramp(PAPER, RAMPED, tol=1e-9, max_periods=BUDGET)
    assert (found.outcome == Outcome.OK).all()
    np.testing.assert_allclose(found.phasor[:2], truth.phasor[:2], rtol=1e-6)
    np.testing.assert_allclose(found.phasor[2], truth.phasor[2], rtol=1e-4)
    assert decide(PAPER, RAMPED, Start.RAMP).sure.any()


def test_a_ramp_stays_below_where_a_sudden_drive_jumps():
    chain = Chain(1, 0.01, -1.0)
    setting = Setting.of(chain, epsilon=6e-3, lam=0, omega=0.97)
    slow = steady_from_ramp(chain, setting, tol=1e-8, max_periods=BUDGET)
    sudden = reached_from_rest(chain, setting, max_periods=BUDGET)
    assert slow.branch[0, 0] == Branch.LOW
    assert abs(slow.phasor[0, 0]) < 0.15 < 0.3 < abs(sudden.phasor[0, 0])
    assert decide(chain, setting, Start.RAMP).phasor[0] == pytest.approx(slow.phasor[0], rel=1e-3)


@pytest.mark.slow
def test_ramps_past_folds_are_decided_as_the_full_equations_do():
    setting = multistable(9, 150, 4000)
    steady = solve(PAPER, setting, tol=1e-6, rung="harmonic_balance", start="ramp")
    truth = steady_from_ramp(PAPER, setting, tol=1e-6, max_periods=BUDGET)
    assert (truth.outcome == Outcome.OK).all()
    held = steady.outcome == Outcome.OK
    assert same(steady.phasor, truth.phasor, 0.02)[held].all()
    decision = decide(PAPER, setting, Start.RAMP)
    assert decision.sure.mean() >= 0.85
    assert same(decision.phasor, truth.phasor, 0.05)[decision.sure].all()
