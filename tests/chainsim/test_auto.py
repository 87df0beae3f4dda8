"""`auto`: its error estimate against the true error, over random systems, settings and tolerances."""

import numpy as np
import pytest
from numpy.typing import NDArray

from chainsim import Chain, Outcome, Setting, balance_near, solve, steady_from_rest


def drawn(rng):
    """A random question: every closure and kind, 1 to 12 oscillators alike or not, soft or hard, weakly or strongly."""

    def logarithmic(low, high):
        return float(np.exp(rng.uniform(np.log(low), np.log(high))))

    system, rows, n = str(rng.choice(["open", "open", "ring", "bidirectional", "grid"])), 1, int(rng.integers(1, 13))
    if system == "grid":
        rows = int(rng.integers(2, 4))
        n = rows * int(rng.integers(1, 5))
    closure = "open" if system == "grid" else system
    kind = "amplifier" if closure != "bidirectional" and rng.random() < 0.2 else "resistor"
    delta, beta = logarithmic(2e-3, 0.3), float(rng.choice([-1.0, -1.0, 1.0, 1.0, -30.0, 100.0]))
    each = {"delta": delta, "beta": beta}
    if rng.random() < 0.35:
        least = 0.0 if rng.random() < 0.3 else 0.5
        each = {"delta": delta * rng.uniform(0.7, 1.4, n), "beta": beta * rng.uniform(least, 1.5, n)}
        each["stiffness"] = 1 + rng.normal(0, 0.02, n)
    chain = Chain.of(n, **each, closure=closure, rows=rows, kind=kind)
    growing = closure == "ring" or kind == "amplifier"
    lam = delta * rng.uniform(0.1, 1) if growing else logarithmic(1e-3, 0.5)
    omega = rng.uniform(0.3, 1.8) if rng.random() < 0.5 else 1 + rng.normal(0, 0.05) + 0.5 * lam
    length, still = np.sqrt(abs(beta)), rng.random() < 0.3
    drive = logarithmic(1e-5, 0.3 if beta < 0 else 3.0) * (delta if rng.random() < 0.5 else 1.0)
    down = {"lam_y": lam * rng.uniform(0.3, 2)} if rows > 1 else {}
    setting = Setting.of(
        chain, epsilon=0.0 if still and rng.random() < 0.1 else drive / length, lam=lam, omega=omega,
        phase=rng.uniform(-3, 3), preload=still * rng.uniform(-0.3, 0.3) / length,
        bias=still * rng.uniform(-0.15, 0.15, n) / length, **down,
    )  # fmt: skip
    return chain, setting, 10 ** -rng.uniform(2, 10)


def error_over_estimate(response, truth):
    size = max(np.abs(truth.phasor).max(), np.abs(truth.mean).max())
    away = max(np.abs(truth.phasor - response.phasor).max(), np.abs(truth.mean - response.mean).max())
    # The truth is known to 1e-12 at best; its own estimate is granted the factor that all are.
    return (away / size - max(10 * truth.error_estimate[0], 1e-12)) / response.error_estimate[0]


def judged(seed, count, true_answer) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Error over estimate of every answer that is ok, and whether each estimate meets its tolerance."""
    rng, ratios, met = np.random.default_rng(seed), [], []
    for _ in range(count):
        chain, setting, tol = drawn(rng)
        response = solve(chain, setting, tol=tol)
        if response.outcome[0] is not Outcome.OK:
            continue
        truth = true_answer(chain, setting, response)
        if truth.outcome[0] is Outcome.OK:
            ratios.append(error_over_estimate(response, truth))
            met.append(response.error_estimate[0] <= tol)
    return np.array(ratios), np.array(met)


def finest_balance(chain, setting, response):
    return balance_near(chain, setting, response.phasor, tol=1e-12)


def integration(chain, setting, response):
    return steady_from_rest(chain, setting, tol=1e-12, max_periods=60_000)


def honest(ratios, met, count):
    assert len(ratios) > 0.8 * count
    assert met.all()
    assert (ratios > 1).mean() <= 0.01
    assert ratios.max() <= 10


@pytest.mark.parametrize("count", [20, pytest.param(200, marks=pytest.mark.slow)])
def test_the_estimate_covers_the_true_error(count):
    honest(*judged(1, count, finest_balance), count)


@pytest.mark.slow
def test_the_estimate_covers_the_distance_to_an_integration_over_a_thousand_settings():
    honest(*judged(2, 1000, integration), 1000)


@pytest.mark.parametrize("size", [20, pytest.param(60, marks=pytest.mark.slow)])
def test_auto_and_the_compiled_sweep_agree(size):
    from chainsim import sweep

    rng, judged = np.random.default_rng(3), 0
    for beta in (-1.0, 1.0, -30.0):
        chain = Chain(int(rng.integers(1, 8)), float(rng.uniform(5e-3, 0.05)), beta)
        setting = Setting.of(
            chain, epsilon=np.exp(rng.uniform(np.log(1e-4), np.log(0.1), size)) / np.sqrt(abs(beta)),
            lam=np.exp(rng.uniform(np.log(2e-3), np.log(0.3), (size, 1))), omega=rng.uniform(0.8, 1.4, size),
            phase=rng.uniform(-3, 3, size),
        )  # fmt: skip
        alone = solve(chain, setting, tol=1e-8, rung="harmonic_balance")
        many = sweep(chain, setting, tol=1e-8, from_rest=False)
        for index in range(size):
            assert str(many.outcome[index]) == str(alone.outcome[index])
            if alone.outcome[index] is Outcome.OK:
                assert many.branch[index].tolist() == alone.branch[index].tolist()
                away = np.abs(many.phasor[index] - alone.phasor[index]).max()
                assert away <= 2e-8 * np.abs(alone.phasor[index]).max()
                judged += 1
        rest, reached = solve(chain, setting, tol=1e-6), sweep(chain, setting, tol=1e-6, from_rest=True)
        assert [str(one) for one in rest.outcome] == [str(one) for one in reached.outcome]
        size_of = np.abs(rest.phasor).max(axis=1, keepdims=True)
        assert (np.abs(rest.phasor - reached.phasor) <= 2e-6 * size_of)[rest.outcome == Outcome.OK].all()
    assert judged > size


@pytest.mark.parametrize(
    "other",
    [
        {"closure": "ring"}, {"closure": "bidirectional"}, {"kind": "amplifier"}, {"rows": 2},
        {"delta": [0.02, 0.04] * 3}, {"beta": [-9.0, -1.0] * 3}, {"stiffness": [1.0, 1.05] * 3},
    ],
    ids=str,
)  # fmt: skip
@pytest.mark.parametrize("from_rest", [False, True])
def test_a_sweep_gives_no_other_system_the_plain_answer(other, from_rest):
    from chainsim import sweep

    chain = Chain.of(6, **{"delta": 0.02, "beta": -1.0, **other})
    down = {"lam_y": 0.03} if chain.rows > 1 else {}
    setting = Setting.of(chain, epsilon=[5e-3, 1e-2], lam=0.015, omega=1.1, **down)
    many = sweep(chain, setting, tol=1e-7, from_rest=from_rest)
    alone = solve(chain, setting, tol=1e-7, rung="auto" if from_rest else "harmonic_balance")
    assert [str(one) for one in many.outcome] == [str(one) for one in alone.outcome]
    assert many.phasor == pytest.approx(alone.phasor, rel=1e-6)
    assert many.locked.all()
    plain = Chain(6, 0.02, -1.0)
    same = sweep(plain, Setting.of(plain, epsilon=[5e-3, 1e-2], lam=0.015, omega=1.1), tol=1e-7, from_rest=from_rest)
    assert np.abs(many.phasor - same.phasor).max() > 1e-3 * np.abs(same.phasor).max()


def test_a_preload_that_sets_in_suddenly_can_throw_an_oscillator_out_of_its_well():
    """z/2 - z^3/4 = b has no answer past b = 0.2722, while the equilibrium of z - z^3 = b lasts up to 0.3849."""
    chain = Chain(1, 0.002, -1.0)
    setting = Setting.of(chain, epsilon=2e-5, lam=0, omega=0.77, preload=[0.1, 0.26, 0.28, 0.31])
    outcomes = solve(chain, setting, tol=1e-6).outcome.tolist()
    assert outcomes == [Outcome.OK, Outcome.OK, Outcome.ESCAPED, Outcome.ESCAPED]
