"""The slow flow against the full equations: its orders, its steady states, its verdicts and its beats."""

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.integrate import solve_ivp

from chainsim import Chain, Closure, GridIntegrator, Outcome, Setting, Start, solve
from chainsim.averaging.envelope import EnvelopeError, follow
from chainsim.averaging.rung import EnvelopeRung
from chainsim.averaging.settle import reached, strongest_line
from chainsim.continuation.locking import locking
from chainsim.rung import RungError

DATA = json.loads((Path(__file__).parents[1] / "data" / "steady_states.json").read_text())
CASES = DATA["cases"] if isinstance(DATA, dict) else DATA


def full(chain, force, lam, tau):
    """z of the full equations from rest at `tau`, shape (K, n), by DOP853; `lam` and `force` are functions of tau."""

    def slope(at, y):
        z, v = y[: chain.n], y[chain.n :]
        pull = lam(at) * (np.roll(z, 1) - z) - chain.delta * v - z - chain.beta * z**3
        pull[0] += force(at)
        return np.concatenate([v, pull])

    found = solve_ivp(slope, (0, tau[-1]), np.zeros(2 * chain.n), method="DOP853", rtol=1e-10, atol=1e-14, t_eval=tau)
    return found.y[: chain.n].T


def first_harmonic(z, omega, tau):
    """First harmonic over the period sampled by `tau`, the same filter for both sides of a comparison."""
    return 2 * np.mean(z * np.exp(-1j * omega * tau)[:, None], axis=0)


def transient_error(order, eta):
    """Relative error after the time 3/eta when delta, lam, detuning and beta a^2 are all of size eta."""
    chain, omega = Chain(3, 0.5 * eta, -1.0), 1 - 0.3 * eta
    epsilon, lam = 0.5 * eta**1.5, 0.8 * eta
    setting = Setting.of(chain, epsilon=epsilon, lam=lam, omega=omega)
    tau = 3 / eta + np.arange(32) * (2 * np.pi / omega / 32)
    links = np.array([0.0, lam, lam])
    truth = first_harmonic(full(chain, lambda t: epsilon * np.cos(omega * t), lambda t: links, tau), omega, tau)
    trace = follow(chain, setting, np.concatenate([[0.0], tau]), tol=1e-9, order=order)
    assert trace.outcome[0] == Outcome.OK
    mine = first_harmonic((trace.phasor[1:, 0] * np.exp(1j * omega * tau)[:, None]).real, omega, tau)
    return np.abs(mine - truth).max() / np.abs(truth).max()


@pytest.mark.parametrize("order", [1, 2])
def test_a_transient_has_the_claimed_order(order):
    scales = 0.04 * 0.5 ** np.arange(3)
    errors = [transient_error(order, eta) for eta in scales]
    assert np.polyfit(np.log(scales), np.log(errors), 1)[0] == pytest.approx(order, abs=0.15)


def test_steps_are_one_a_cycle_or_fewer():
    chain = Chain(6, 5.3e-3, -1.0)
    setting = Setting.of(chain, epsilon=4e-4, lam=6.1e-3, omega=1.0)
    cycles = 400
    trace = follow(chain, setting, [0.0, 2 * np.pi * cycles], tol=1e-4)
    # Both passes together, four evaluations a step, six oscillators.
    assert trace.stats.rhs_evals <= 4 * 6 * cycles
    assert trace.error_estimate[0] <= 1e-4


def test_changing_drive_and_links_follow_the_full_equations():
    chain, omega, length = Chain(3, 0.01, -1.0), np.sqrt(1.5), 300.0
    setting = Setting.of(chain, epsilon=1.0, lam=0.1, omega=omega)
    knots = np.linspace(0, length, 61)
    part = knots / length
    rise = part**3 * (10 - 15 * part + 6 * part**2)
    epsilon = 0.01 * rise * np.exp(0.5j * part)
    lam = np.stack([0 * part, 0.2 + 0.1 * part, 0.25 - 0.15 * part**2], axis=1)
    tau = np.concatenate([knots, length + np.arange(1, 33) * (2 * np.pi / omega / 32)])
    hold = np.minimum(tau, length)
    drives = np.interp(hold, knots, epsilon.real) + 1j * np.interp(hold, knots, epsilon.imag)
    links = np.stack([np.interp(hold, knots, lam[:, m]) for m in range(3)], axis=1)
    trace = follow(chain, setting, tau, tol=1e-7, epsilon=drives, lam=links)

    def force(at):
        phasor = np.interp(at, knots, epsilon.real) + 1j * np.interp(at, knots, epsilon.imag)
        return (phasor * np.exp(1j * omega * at)).real

    truth = full(chain, force, lambda at: np.array([np.interp(at, knots, lam[:, m]) for m in range(3)]), tau)
    mine = (trace.phasor[:, 0] * np.exp(1j * omega * tau)[:, None]).real
    assert np.abs(mine[-32:] - truth[-32:]).max() < 3e-3 * np.abs(truth).max()


def test_the_linear_chain_is_followed_to_the_slaving():
    chain, omega = Chain(2, 0.02, 0.0), 1.05
    setting = Setting.of(chain, epsilon=1.0, lam=0.02, omega=omega)
    tau = np.linspace(0, 200, 41)
    trace = follow(chain, setting, tau, tol=1e-10)
    links = np.array([0.0, 0.02])
    truth = full(chain, lambda t: np.cos(omega * t), lambda t: links, tau)
    mine = (trace.phasor[:, 0] * np.exp(1j * omega * tau)[:, None]).real
    # The first oscillator's drive is constant, so its slaved part is exact.
    assert np.abs(mine - truth)[:, 0].max() < 1e-7 * np.abs(truth[:, 0]).max()
    assert np.abs(mine - truth)[:, 1].max() < 1e-3 * np.abs(truth[:, 1]).max()


@pytest.mark.parametrize("case", CASES, ids=lambda case: f"{case['closure']}-{case['n']}-{case['outcome']}")
def test_the_reference_states_are_reached(case):
    chain = Chain(case["n"], case["delta"], case["beta"], case["closure"])
    setting = Setting.of(chain, epsilon=case["epsilon"], lam=case["lam"], omega=case["omega"])
    response = EnvelopeRung().solve(chain, setting, tol=1.0, start=Start.REST)
    if case["outcome"] != "ok":
        # In one of these rings beta a^2 is 4: no slow flow is true of it, and the rung says so.
        unsure = (Outcome.OUT_OF_BUDGET,) if case["beta"] > 0 else ()
        assert response.outcome[0] in (Outcome.NOT_LOCKED, Outcome.ESCAPED, *unsure)
        assert np.isnan(response.phasor).all()
        return
    wanted = np.array([complex(*pair) for pair in case["phasor"]])
    error = np.abs(response.phasor[0] - wanted).max() / np.abs(wanted).max()
    assert response.outcome[0] == Outcome.OK
    # The reference itself is good to about 1e-12 of its sharpness.
    assert error <= response.error_estimate[0] + 1e-12 / case["delta"]
    assert response.error_estimate[0] < 0.02
    # The round-off of the reference's own, of the whole monodromy, moves them by up to 6e-3 at twelve oscillators.
    wrong = 1e-2 if case["n"] == 12 and case["closure"] == "open" else 5e-3
    assert np.abs(response.multipliers).max() == pytest.approx(case["max_multiplier"], abs=wrong)


def test_the_fixed_point_ends_as_the_harmonic_balance():
    errors, drives = [], 0.04 * 0.5 ** np.arange(3)
    chain = Chain(3, 0.05, -1.0)
    for epsilon in drives:
        setting = Setting.of(chain, epsilon=epsilon, lam=0.2, omega=1.2)
        truth = solve(chain, setting, tol=1e-12, rung="harmonic_balance").phasor
        rough = EnvelopeRung().solve(chain, setting, tol=1.0, start=Start.REST).phasor
        errors.append(np.abs(rough - truth).max() / np.abs(truth).max())
    assert np.polyfit(np.log(drives), np.log(errors), 1)[0] > 3.7


def test_verdicts_on_the_papers_ring_agree_with_the_full_equations():
    chain = Chain(6, 5.3006e-3, -1.0, Closure.RING)
    setting = Setting.of(chain, epsilon=[6e-4, 1.2e-3, 2e-3, 3e-3], lam=6.131e-3, omega=1.0)
    mine, truth = locking(chain, setting, start="rest"), solve(chain, setting, tol=1e-6, rung="ode")
    assert list(mine.outcome) == list(truth.outcome)
    assert list(mine.locked) == [False, False, True, True]
    assert mine.amplitude[2:] == pytest.approx(np.abs(truth.phasor[2:]), rel=1e-4)
    assert mine.phase_step[2:] == pytest.approx(truth.phase_step[2:], abs=1e-4)
    assert (mine.growth[2:] < 0).all()
    assert (mine.beat[:2] != 0).all()


def test_the_beat_is_the_one_of_the_full_equations():
    chain = Chain(6, 5.3006e-3, -1.0, Closure.RING)
    setting = Setting.of(chain, epsilon=1.2e-3, lam=6.131e-3, omega=1.0)
    found = locking(chain, setting, start="rest")
    grid = GridIntegrator(
        shape=(1, 6), chain_length=6, delta=chain.delta, beta=-1.0, ring=True, dtau=np.pi / 8
    )  # fmt: skip
    tau = np.arange(16 * 9000) * (np.pi / 8)
    force = np.zeros((len(tau), 1, 6))
    # A force that is linear between samples has this much less of its first harmonic.
    force[:, 0, 0] = 1.2e-3 * np.cos(tau) / np.sinc(1 / 16) ** 2
    z = grid.advance(force, np.full((1, 6), 6.131e-3))[:, 0]
    slow = 2 * np.mean((z * np.exp(-1j * tau)[:, None]).reshape(-1, 16, 6), axis=1)[7000:]
    most = (np.ptp(np.abs(slow), axis=0) / np.abs(slow).max(axis=0)).argmax()
    assert found.beat[0] == pytest.approx(strongest_line(slow[:, most], 2 * np.pi), rel=0.003)
    assert found.spread[0] == pytest.approx(np.ptp(np.abs(slow[:, most])) / np.abs(slow[:, most]).max(), abs=0.01)


def test_a_long_wait_at_a_fold_just_passed_is_no_beat():
    chain = Chain(6, 5.3006e-3, -1.0)
    setting = Setting.of(chain, epsilon=2.7524447e-4, lam=0.01, omega=1.0)
    found = locking(chain, setting, start="rest")
    wanted = solve(chain, setting, tol=1e-9, rung="harmonic_balance")
    assert found.locked[0]
    assert found.amplitude[0] == pytest.approx(np.abs(wanted.phasor[0]), rel=1e-4)


@given(st.floats(-0.4, 0.4).filter(lambda w: abs(w) > 0.05), st.floats(0, 6.28), st.floats(0.1, 5))
def test_the_strongest_line_is_found(frequency, phase, level):
    samples = level + np.exp(1j * (frequency * np.arange(400) + phase)) + 0.1 * np.exp(1.9j * np.arange(400))
    assert strongest_line(samples, 1.0) == pytest.approx(frequency, abs=2e-4)


@settings(max_examples=15)
@given(st.floats(1e-4, 3e-3), st.floats(0.98, 1.02), st.floats(1e-9, 1e9))
def test_beta_is_a_length_scale(epsilon, omega, stretch):
    answers = []
    for beta in (-1.0, -stretch):
        chain = Chain(3, 0.02, beta)
        setting = Setting.of(chain, epsilon=epsilon / np.sqrt(-beta), lam=0.01, omega=omega)
        answers.append(reached(chain, setting, start="rest").phasor * np.sqrt(-beta))
    assert answers[1] == pytest.approx(answers[0], rel=1e-9, nan_ok=True)


def test_a_start_on_the_upper_branch_stays_there():
    chain = Chain(1, 0.01, -1.0)
    setting = Setting.of(chain, epsilon=4e-4, lam=0, omega=0.994)
    branches = solve(chain, setting, tol=1e-9, rung="harmonic_balance", start="all").phasor
    assert len(branches) == 3 or len(branches) == 1
    high = np.abs(branches).argmax()
    arrival = reached(chain, setting, start=branches[high])
    assert arrival.phasor[0] == pytest.approx(branches[high], rel=1e-5)


def test_a_ramp_reaches_the_lower_branch():
    chain = Chain(2, 0.02, -1.0)
    setting = Setting.of(chain, epsilon=2e-3, lam=0.05, omega=0.97)
    low = solve(chain, setting, tol=1e-9, rung="harmonic_balance", start="ramp")
    response = EnvelopeRung().solve(chain, setting, tol=1e-3, start=Start.RAMP)
    assert response.phasor[0] == pytest.approx(low.phasor[0], rel=1e-5)
    assert (response.branch == low.branch).all()


def test_batches_do_not_mix():
    chain = Chain(2, 0.02, -1.0)
    one = Setting.of(chain, epsilon=2e-3, lam=0.05, omega=0.97)
    both = Setting.of(chain, epsilon=[2e-3, 1e-4], lam=0.05, omega=[0.97, 1.3])
    alone = reached(chain, one, start="rest").phasor
    assert reached(chain, both, start="rest").phasor[0] == pytest.approx(alone[0], rel=1e-10)


CHAIN = Chain(2, 0.02, -1.0)
PLAIN = Setting.of(CHAIN, epsilon=1e-3, lam=0.05, omega=1.0)
BIASED = Setting.of(CHAIN, epsilon=1e-3, lam=0.05, omega=1.0, bias=0.1)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: follow(CHAIN, PLAIN, [0.0, 1.0], tol=0), "tol"),
        (lambda: follow(CHAIN, PLAIN, [1.0, 0.0], tol=1e-3), "tau"),
        (lambda: follow(CHAIN, PLAIN, [0.0, 1.0], tol=1e-3, order=3), "order"),
        (lambda: follow(CHAIN, PLAIN, [0.0, 1.0], tol=1e-3, epsilon=[1.0]), "epsilon"),
        (lambda: follow(CHAIN, PLAIN, [0.0, 1.0], tol=1e-3, lam=np.ones((2, 3))), "lam"),
        (lambda: follow(CHAIN, PLAIN, [0.0, 1.0], tol=1e-3, lam=np.ones((2, 2))), "open chain"),
        (lambda: follow(CHAIN, PLAIN, [0.0, 1.0], tol=1e-3, start=[1.0]), "start"),
        (lambda: reached(CHAIN, PLAIN, start="all"), "start"),
        (lambda: reached(Chain(2, 0.0, -1.0), PLAIN, start="rest"), "damping"),
        (lambda: reached(Chain(2, 3.0, -1.0), PLAIN, start="rest"), "delta"),
        (lambda: follow(CHAIN, BIASED, [0.0, 1.0], tol=1e-3, lam=[[0.0, 0.1], [0.0, 0.2]]), "bias"),
        (lambda: reached(CHAIN, Setting.of(CHAIN, epsilon=0, lam=-2.0, omega=1), start="rest"), "stiffness"),
    ],
)
def test_bad_questions_are_named(call, words):
    with pytest.raises(EnvelopeError, match=words):
        call()


def test_the_rung_refuses_what_it_cannot_do():
    with pytest.raises(RungError, match="every branch"):
        EnvelopeRung().solve(CHAIN, PLAIN, tol=1e-3, start=Start.ALL)
    long = Chain(65, 0.02, -1.0)
    with pytest.raises(RungError, match="65"):
        EnvelopeRung().solve(long, Setting.of(long, epsilon=1e-3, lam=0, omega=1), tol=1e-3, start=Start.REST)


def test_a_drive_that_throws_it_over_the_hill_is_an_escape():
    setting = Setting.of(CHAIN, epsilon=3.0, lam=0.05, omega=1.0)
    assert reached(CHAIN, setting, start="rest").outcome[0] == Outcome.ESCAPED
    assert follow(CHAIN, setting, [0.0, 30.0], tol=1e-3).outcome[0] == Outcome.ESCAPED


HOSTILE = {
    "lam": [0.0, 1e-12, 1e3, 1e6],
    "omega": [1e-6, 1e-3, np.nextafter(1.0, 2.0), 1e3, 1e6],
    "epsilon": [0.0, 5e-324, 1e-200, 0.38, 1e12],
    "delta": [1e-12, 0.9, 1e6],
    "beta": [0.0, 1e-12, -1e-12, 1e12, -1e12],
    "n": [1, 24],
}
CALM = {"lam": 0.02, "omega": 1.01, "epsilon": 1e-3, "delta": 0.05, "beta": -1.0, "n": 2}


@pytest.mark.parametrize(("name", "value"), [(name, value) for name, values in HOSTILE.items() for value in values])
@pytest.mark.parametrize("closure", ["open", "ring"])
def test_hostile_values_end_in_an_outcome(name, value, closure, monkeypatch):
    # A budget small enough for the list; what is not decided in it has to say so.
    monkeypatch.setattr("chainsim.averaging.settle.LOOKS", 48)
    monkeypatch.setattr("chainsim.averaging.settle.WINDOWS", 1)
    monkeypatch.setattr("chainsim.averaging.run.MOST_STEPS", 400)
    what = {**CALM, name: value}
    chain = Chain(what["n"], what["delta"], what["beta"], closure)
    setting = Setting.of(chain, epsilon=what["epsilon"], lam=what["lam"], omega=what["omega"])
    if EnvelopeRung().refusal(chain, setting, Start.REST):
        with pytest.raises(RungError, match="use rung"):
            EnvelopeRung().solve(chain, setting, tol=1e-3, start=Start.REST)
        return
    response = EnvelopeRung().solve(chain, setting, tol=1e-3, start=Start.REST)
    if response.outcome[0] == Outcome.OK:
        assert np.isfinite(response.harmonics).all()
        if closure == "open":
            wanted = solve(chain, setting, tol=1e-6, rung="harmonic_balance", start="all") if chain.beta else None
            if wanted is not None and chain.n < 3:
                gap = np.nanmin(np.abs(wanted.phasor - response.phasor).max(axis=1))
                assert gap <= 2e-3 * np.abs(response.phasor).max() + 1e-300
