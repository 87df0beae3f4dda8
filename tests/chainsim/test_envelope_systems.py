"""The slow flow of rings, links both ways, grids, unequal oscillators and biased ones, against the full equations."""

import warnings

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from numpy.typing import ArrayLike
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from chainsim import Chain, Closure, Outcome, RungError, Setting, reached_from_rest, solve, steady_from_rest
from chainsim.averaging.envelope import EnvelopeError, follow, slow_refusal
from chainsim.averaging.linear import exponential, solvent
from chainsim.averaging.rung import EnvelopeRung
from chainsim.reach.rest import sure_from_rest
from chainsim.rung import Start


def transient_error(eta, closure, rows, bias):
    """Relative error after the time 3/eta when delta, lam, detuning, beta a^2 and beta z0^2 are all of size eta."""
    chain, omega = Chain.of(4, delta=0.5 * eta, beta=-1.0, closure=closure, rows=rows), 1 - 0.3 * eta
    down = {"lam_y": 0.4 * eta} if rows > 1 else {}
    setting = Setting.of(
        chain, epsilon=0.5 * eta**1.5, lam=0.6 * eta, omega=omega, bias=bias * eta**0.5, **down
    )  # fmt: skip
    spring = chain.law.matrix(setting.lam, setting.lam_y)[0] + np.eye(4)

    def slope(at, y):
        pull = -spring @ y[:4] - chain.delta * y[4:] + y[:4] ** 3 + setting.bias[0]
        pull[0] += setting.epsilon[0] * np.cos(omega * at)
        return np.concatenate([y[4:], pull])

    tau = 3 / eta + np.arange(32) * (2 * np.pi / omega / 32)
    found = solve_ivp(slope, (0, tau[-1]), np.zeros(8), method="DOP853", rtol=1e-9, atol=1e-13, t_eval=tau)
    turn = np.exp(1j * omega * tau)[:, None]
    truth = 2 * np.mean(found.y[:4].T / turn, axis=0)
    trace = follow(chain, setting, np.concatenate([[0.0], tau]), tol=1e-8)
    mine = 2 * np.mean((trace.phasor[1:, 0] * turn).real / turn, axis=0)
    return np.abs(mine - truth).max() / np.abs(truth).max()


@pytest.mark.parametrize(
    ("closure", "rows", "bias"),
    [("ring", 1, 0.0), ("bidirectional", 1, 0.0), ("open", 2, 0.0), ("open", 1, 0.5), ("bidirectional", 1, 0.5)],
)
def test_a_transient_from_rest_is_of_second_order(closure, rows, bias):
    errors = [transient_error(eta, closure, rows, bias) for eta in (0.02, 0.01)]
    assert errors[0] < 1e-3
    assert errors[1] < 0.35 * errors[0]


SYSTEMS: dict[str, tuple[Chain, dict[str, ArrayLike], float]] = {
    "bidirectional": (Chain.of(4, delta=0.03, beta=-1.0, closure="bidirectional"), {"lam": 0.05, "omega": 1.02}, 1e-7),
    "grid": (Chain.of(6, delta=0.03, beta=-1.0, rows=2), {"lam": 0.1, "lam_y": 0.2, "omega": 1.1}, 5e-5),
    "amplifiers, biased": (
        Chain.of(6, delta=0.03, beta=-1.0, rows=2, kind="amplifier"),
        {"lam": 0.02, "lam_y": 0.03, "omega": 1.01, "bias": 0.05},
        1e-4,
    ),
    "unequal, both ways, biased": (
        Chain.of(3, delta=[0.03, 0.05, 0.02], beta=[-1, 1, -2.0], stiffness=[1, 1.05, 0.9], closure="bidirectional"),
        {"lam": 0.05, "omega": 1.02, "bias": [0.02, -0.03, 0.01], "preload": 0.02},
        1e-4,
    ),
    "biased": (Chain(3, 0.05, -1.0), {"lam": 0.2, "omega": 1.1, "bias": [0.1, -0.05, 0.1], "preload": 0.05}, 1e-3),
    "ring": (Chain(5, 0.03, 1.0, Closure.RING), {"lam": 0.01, "omega": 1.01}, 5e-6),
}


@pytest.mark.parametrize("name", SYSTEMS)
def test_steady_states_and_stability_are_those_of_the_full_equations(name):
    chain, given_, close = SYSTEMS[name]
    setting = Setting.of(chain, epsilon=[1e-3, 4e-3], **given_)
    truth = steady_from_rest(chain, setting, tol=1e-9, max_periods=20_000)
    found = EnvelopeRung().solve(chain, setting, tol=1.0, start=Start.REST)
    assert list(found.outcome) == list(truth.outcome) == [Outcome.OK, Outcome.OK]
    size = np.abs(truth.phasor).max(axis=1)
    error = np.abs(found.phasor - truth.phasor).max(axis=1) / size
    assert (error <= close).all()
    assert (error <= found.error_estimate).all()
    assert np.abs(found.mean - truth.mean).max() <= close * size.max()
    assert (found.branch == truth.branch).all()
    largest = np.abs(truth.multipliers).max(axis=(1, 2))
    assert np.abs(found.multipliers).max(axis=(1, 2)) == pytest.approx(largest, abs=1e-5)


def test_a_biased_steady_state_has_the_claimed_order():
    chain, errors, drives = Chain(3, 0.05, -1.0), [], 4e-3 * 0.5 ** np.arange(3)
    for epsilon in drives:
        setting = Setting.of(chain, epsilon=epsilon, lam=0.2, omega=1.1, bias=[0.1, -0.05, 0.1])
        truth = solve(chain, setting, tol=1e-12, rung="harmonic_balance").phasor
        rough = EnvelopeRung().solve(chain, setting, tol=1.0, start=Start.REST).phasor
        errors.append(np.abs(rough - truth).max() / np.abs(truth).max())
    assert np.polyfit(np.log(drives), np.log(errors), 1)[0] > 2.7


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["ring", "bidirectional", "grid", "bias", "amplifier", "spread"])
def test_what_is_surely_reached_from_rest_is(kind):
    rng = np.random.default_rng(sum(map(ord, kind)))
    asked = certain = 0
    for _ in range(12):
        n, rows = (2 * int(rng.integers(1, 4)), 2) if kind == "grid" else (int(rng.integers(2, 7)), 1)
        delta, beta = float(np.exp(rng.uniform(np.log(6e-3), np.log(6e-2)))), float(rng.choice([-1.0, 1.0]))
        uneven = rng.uniform(0.7, 1.4, n) if kind == "spread" else np.ones(n)
        closure = kind if kind in ("ring", "bidirectional") else "open"
        link = "amplifier" if kind == "amplifier" else "resistor"
        chain = Chain.of(n, delta=delta * uneven, beta=beta * uneven, closure=closure, rows=rows, kind=link)
        omega, a = 1 + rng.uniform(-1, 6, 40) * delta * beta, rng.uniform(0.02, 0.35, 40)
        epsilon = a * np.abs(1 - omega**2 + 0.75 * beta * a * a + 1j * delta * omega) * rng.uniform(0.5, 1.5, 40)
        lam = np.exp(rng.uniform(np.log(0.2 * delta), np.log((1 if kind == "ring" else 5) * delta), (40, 1)))
        more = {"bias": rng.uniform(-0.15, 0.15, (40, n))} if kind == "bias" else {}
        if rows > 1:
            lam = lam[:, :, None]
            more = {"lam_y": lam}
        setting = Setting.of(chain, epsilon=epsilon, lam=lam, omega=omega, **more)
        truth = reached_from_rest(chain, setting, max_periods=60_000)
        low = solve(chain, setting, tol=1e-6, rung="harmonic_balance")
        sure = sure_from_rest(chain, setting, low)
        assert (truth.outcome[sure] == Outcome.OK).all()
        assert (np.abs(low.phasor - truth.phasor) <= 0.02 * np.abs(truth.phasor))[sure].all()
        asked, certain = asked + 40, certain + int(sure.sum())
    assert certain >= 0.5 * asked


@settings(max_examples=40)
@given(st.integers(1, 5), st.integers(0, 10_000), st.floats(1e-3, 3.0))
def test_the_exponential_is_scipys(n, seed, size):
    rng = np.random.default_rng(seed)
    matrix = size * (rng.normal(size=(3, n, n)) + 1j * rng.normal(size=(3, n, n)))
    wanted = np.stack([expm(each) for each in matrix])
    assert np.abs(exponential(matrix) - wanted).max() <= 1e-12 * np.abs(wanted).max()


@settings(max_examples=40)
@given(st.sampled_from(["open", "ring", "bidirectional"]), st.floats(0, 0.8), st.floats(0.3, 3), st.integers(1, 6))
def test_the_solvents_split_every_linear_motion(closure, lam, omega, n):
    chain = Chain.of(n, delta=np.linspace(0.01, 0.3, n), beta=0.0, stiffness=np.linspace(0.9, 1.2, n), closure=closure)
    setting = Setting.of(chain, epsilon=0, lam=lam, omega=omega)
    spring = chain.law.matrix(setting.lam, setting.lam_y) + np.diag(chain.stiffness)
    delta = np.broadcast_to(chain.deltas, (1, n))
    damping, stiff = 2j * omega + delta, spring - omega**2 * np.eye(n) + 1j * omega * np.diag(delta[0])
    own = np.diagonal(spring, axis1=1, axis2=2)
    root = 1j * np.sqrt(own - delta**2 / 4)
    both = [solvent(damping, stiff, sign * root - damping / 2) for sign in (1, -1)]
    rates = np.concatenate([np.linalg.eigvals(each[0]) for each in both]) + 1j * omega
    # Together they are the eigenvalues of z'' + delta z' + K z = 0, twice n of them.
    zero, one = np.zeros((n, n)), np.eye(n)
    wanted = np.linalg.eigvals(np.block([[zero, one], [-spring[0], -np.diag(delta[0])]]))
    # Equal eigenvalues of a chain answer a rounding of 1e-16 by its n-th root.
    assert np.poly(rates) == pytest.approx(np.poly(wanted), rel=1e-9, abs=1e-9)


HOSTILE = [
    (name, value)
    for name, values in {
        "delta": [0.0, 1e-12, 0.999, 1.0, 1e6],
        "beta": [0.0, 1e-12, -1e-12, 1e12, -1e12],
        "lam": [0.0, 1e-12, 1e6],
        "omega": [1e-6, np.nextafter(1.0, 2.0), 1e3, 1e6],
        "epsilon": [0.0, 5e-324, 1e12],
        "bias": [0.38, 0.39, -1e12],
    }.items()
    for value in values
]


@pytest.mark.parametrize("closure", ["open", "ring", "bidirectional", "grid"])
@pytest.mark.parametrize(("name", "value"), HOSTILE)
def test_hostile_values_are_named_and_never_warn(name, value, closure, monkeypatch):
    monkeypatch.setattr("chainsim.averaging.settle.LOOKS", 24)
    monkeypatch.setattr("chainsim.averaging.settle.WINDOWS", 1)
    monkeypatch.setattr("chainsim.averaging.run.MOST_STEPS", 256)
    monkeypatch.setattr("chainsim.averaging.envelope.MOST_STEPS", 2000)
    what = {"delta": 0.05, "beta": -1.0, "lam": 0.02, "omega": 1.01, "epsilon": 1e-3, "bias": 0.0} | {name: value}
    rows = 2 if closure == "grid" else 1
    chain = Chain.of(
        4, delta=what["delta"], beta=what["beta"], closure="open" if rows > 1 else closure, rows=rows
    )  # fmt: skip
    down = {"lam_y": what["lam"]} if rows > 1 else {}
    setting = Setting.of(chain, **{key: what[key] for key in ("lam", "omega", "epsilon", "bias")}, **down)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        if slow_refusal(chain, setting):
            with pytest.raises(EnvelopeError, match="use rung"):
                follow(chain, setting, [0.0, 1.0, 30.0], tol=1e-3)
        else:
            trace = follow(chain, setting, [0.0, 1.0, 30.0], tol=1e-3)
            assert np.isfinite(trace.phasor[:, trace.outcome == Outcome.OK]).all()
        if EnvelopeRung().refusal(chain, setting, Start.REST):
            with pytest.raises(RungError, match="use rung"):
                EnvelopeRung().solve(chain, setting, tol=1e-3, start=Start.REST)
        else:
            response = EnvelopeRung().solve(chain, setting, tol=1e-3, start=Start.REST)
            assert isinstance(response.outcome[0], Outcome)
            assert response.outcome[0] != Outcome.OK or np.isfinite(response.harmonics).all()


def test_a_bias_past_the_static_fold_has_no_well_to_stay_in():
    chain = Chain(1, 0.05, -1.0)
    setting = Setting.of(chain, epsilon=1e-4, lam=0, omega=1.0, bias=0.4)
    assert EnvelopeRung().solve(chain, setting, tol=1e-3, start=Start.REST).outcome[0] == Outcome.ESCAPED
