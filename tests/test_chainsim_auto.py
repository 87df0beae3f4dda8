"""`auto`: its error estimate against the true error, over random systems, settings and tolerances."""

import numpy as np
import pytest

from chainsim import Chain, Outcome, Setting, balance_near, solve, steady_from_rest


def drawn(rng):
    """A random question: a chain of 1 to 6, weakly or strongly driven, a quarter of them under constant forces."""

    def logarithmic(low, high):
        return float(np.exp(rng.uniform(np.log(low), np.log(high))))

    n, closure = int(rng.integers(1, 7)), str(rng.choice(["open", "open", "open", "ring", "bidirectional"]))
    chain = Chain(n, logarithmic(2e-3, 0.2), float(rng.choice([-1.0, -1.0, 1.0, -30.0])), closure)
    lam = chain.delta * rng.uniform(0.1, 1) if closure == "ring" else logarithmic(1e-3, 0.5)
    length, still = np.sqrt(abs(chain.beta)), rng.random() < 0.25
    setting = Setting.of(
        chain, epsilon=logarithmic(1e-5, 0.05) / length, lam=lam, omega=rng.uniform(0.8, 1.6),
        preload=still * rng.uniform(-0.1, 0.1) / length, bias=still * rng.uniform(-0.05, 0.05, n) / length,
    )  # fmt: skip
    return chain, setting, 10 ** -rng.uniform(2, 10)


def error_over_estimate(response, truth):
    size = max(np.abs(truth.phasor).max(), np.abs(truth.mean).max())
    away = max(np.abs(truth.phasor - response.phasor).max(), np.abs(truth.mean - response.mean).max())
    # The truth itself is known to 1e-12.
    return (away / size - max(truth.error_estimate[0], 1e-12)) / response.error_estimate[0]


def judged(seed, count, true_answer):
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
    assert len(ratios) > 0.85 * count
    assert met.all()
    assert (ratios > 1).mean() <= 0.01
    assert ratios.max() <= 10


def test_the_estimate_covers_the_true_error():
    honest(*judged(1, 150, finest_balance), 150)


@pytest.mark.slow
def test_the_estimate_covers_the_distance_to_an_integration_over_a_thousand_settings():
    honest(*judged(2, 1000, integration), 1000)
