"""Chains fitted to simulated measurements: exact recovery, intervals that cover, outliers, folds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray

from chainsim import Chain, Outcome, Setting, solve
from planner.identification.calibration import FEWEST_POINTS, ChainFit, Sweep, SweepError, fit_chain
from planner.robustness.batch_march import BatchParts, march

Floats = NDArray[np.float64]

BAND = np.linspace(0.96, 1.04, 61)


@dataclass(frozen=True)
class Truth:
    """natural, delta, beta, feed: shape (4, n)."""

    numbers: Floats

    @classmethod
    def random(cls, n: int, seed: int) -> Truth:
        rng = np.random.default_rng(seed)
        feed = np.append(2e-3, 5e-3 * rng.normal(1, 0.05, n - 1))
        return cls(np.stack([rng.normal(1, 0.01, n), 5.3e-3 * rng.normal(1, 0.1, n), -rng.normal(1, 0.1, n), feed]))

    def sweep(self, volts: tuple[float, ...], band: Floats = BAND) -> Sweep:
        """Up and down at each drive, every point on the branch of the one before while it lasts."""
        natural, delta, beta, feed = self.numbers[:, :, None]
        n = len(natural)
        parts = BatchParts(natural**2, delta, beta, np.ones((n, 1)))
        lam = np.concatenate([np.zeros((1, 1)), feed[1:]])
        shots = []
        for drive in volts:
            force = np.zeros((n, 1), dtype=np.complex128)
            force[0] = feed[0] * drive
            for way in (band, band[::-1]):
                here = None
                for omega in way:
                    here = march(parts, force, lam, np.array([omega]), near=here).phasor
                    shots.append((omega, drive, here[:, 0]))
        return Sweep(*(np.array(column) for column in zip(*shots, strict=True)))


def noisy(sweep: Sweep, share: float, rng: np.random.Generator) -> Sweep:
    """Noise on either part of every phasor, as a share of the actuator's largest amplitude."""
    size = share * np.abs(sweep.phasor).max(axis=0)
    noise = rng.standard_normal(sweep.phasor.shape) + 1j * rng.standard_normal(sweep.phasor.shape)
    return Sweep(sweep.omega, sweep.volts, sweep.phasor + size * noise)


def numbers(fit: ChainFit) -> Floats:
    return np.stack([fit.natural, fit.delta, fit.beta, fit.feed])


@pytest.mark.parametrize("n", [1, 2, 6])
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_sweep_without_noise_gives_the_numbers_back(n: int, seed: int) -> None:
    truth = Truth.random(n, seed)
    fit = fit_chain(truth.sweep((0.1, 0.5)))
    assert fit.outcome is Outcome.OK
    np.testing.assert_allclose(numbers(fit)[[0, 1, 3]], truth.numbers[[0, 1, 3]], rtol=1e-6)
    # The last actuators move by a thousandth, where the cubic force is a millionth of the linear one.
    np.testing.assert_allclose(fit.beta, truth.numbers[2], rtol=1e-3)
    assert fit.used.all()
    assert all(not array.flags.writeable for array in (fit.natural, fit.error, fit.covariance, fit.used))


def test_the_sweep_has_a_fold_and_both_branches_are_fitted() -> None:
    truth = Truth.random(2, 3)
    sweep = truth.sweep((0.6,))
    up, down = sweep.phasor[: len(BAND)], sweep.phasor[: len(BAND) - 1 : -1]
    apart = np.abs(np.abs(up) - np.abs(down))[:, 0]
    assert apart.max() > 0.3 * np.abs(up).max()
    fit = fit_chain(noisy(sweep, 0.01, np.random.default_rng(0)))
    assert fit.outcome is Outcome.OK
    assert np.all(np.abs(numbers(fit) - truth.numbers) < 4.5 * fit.error)
    # Only with the upper branch is the cubic term known so well.
    assert fit.error[2, 0] < 0.02


@pytest.mark.parametrize("n", [2, 3])
def test_the_intervals_cover_the_truth_as_often_as_they_say(n: int) -> None:
    truth, rng = Truth.random(n, 5), np.random.default_rng(6)
    clean = truth.sweep((0.2, 0.6))
    hits = []
    for _ in range(80):
        fit = fit_chain(noisy(clean, 0.01, rng))
        assert fit.outcome is Outcome.OK
        hits.append(np.abs(numbers(fit) - truth.numbers) <= fit.half_width(0.95))
    covered = np.array(hits).mean(axis=0)
    # Of 80 draws with 95 %: below 85 % once in ten thousand.
    assert covered.min() > 0.85
    assert 0.92 <= covered.mean() <= 0.98


def test_noise_is_found_and_intervals_shrink_with_it() -> None:
    truth, rng = Truth.random(3, 8), np.random.default_rng(9)
    clean = truth.sweep((0.2, 0.6))
    fits = [fit_chain(noisy(clean, share, rng)) for share in (0.001, 0.01)]
    peak = np.abs(clean.phasor).max(axis=0)
    for fit, share in zip(fits, (0.001, 0.01), strict=True):
        np.testing.assert_allclose(fit.noise, share * peak, rtol=0.12)
    np.testing.assert_allclose(fits[1].error / fits[0].error, 10, rtol=0.2)
    np.testing.assert_allclose(np.sqrt(np.diag(fits[0].covariance)).reshape(3, 4).T, fits[0].error)
    assert fits[0].half_width(0.95)[0, 0] == pytest.approx(1.95996 * fits[0].error[0, 0], rel=1e-4)


def test_outliers_are_left_out_and_pull_nothing() -> None:
    truth, rng = Truth.random(3, 10), np.random.default_rng(11)
    sweep = noisy(truth.sweep((0.2, 0.6)), 0.01, rng)
    spoilt = sweep.phasor.copy()
    bad = rng.random(spoilt.shape) < 0.05
    spoilt[bad] += 0.5 * np.abs(sweep.phasor).max() * np.exp(1j * rng.uniform(0, 6, bad.sum()))
    fit = fit_chain(Sweep(sweep.omega, sweep.volts, spoilt))
    assert fit.outcome is Outcome.OK
    assert not fit.used[bad].any()
    assert fit.used[~bad].mean() > 0.99
    assert np.all(np.abs(numbers(fit) - truth.numbers) < 4.5 * fit.error)


def test_points_that_were_not_measured_are_no_points() -> None:
    truth, rng = Truth.random(3, 12), np.random.default_rng(13)
    sweep = noisy(truth.sweep((0.2, 0.6)), 0.005, rng)
    holes = sweep.phasor.copy()
    missing = rng.random(holes.shape) < 0.3
    holes[missing] = np.nan
    fit = fit_chain(Sweep(sweep.omega, sweep.volts, holes))
    assert np.array_equal(fit.measured, ~missing)
    assert np.all(np.abs(numbers(fit) - truth.numbers) < 4.5 * fit.error)


def test_a_chain_simulated_by_harmonic_balance_is_found() -> None:
    """Nothing of the measurement comes from the planner; amplitudes stay where one harmonic is enough."""
    natural, delta = np.array([1.004, 0.993, 1.01]), np.array([5e-3, 6e-3, 4.5e-3])
    beta, lam, per_volt = np.array([-1.1, -0.9, -1.0]), np.array([6e-3, 4e-3]), 2e-3
    chain = Chain.of(3, delta=delta, beta=beta, stiffness=natural**2)
    omega = np.tile(BAND, 2)
    volts = np.repeat([0.1, 0.2], len(BAND))
    setting = Setting.of(chain, epsilon=per_volt * volts, lam=[lam], omega=omega)
    response = solve(chain, setting, tol=1e-9, rung="harmonic_balance", start="rest")
    assert set(response.outcome) == {Outcome.OK}
    fit = fit_chain(Sweep(omega, volts, response.phasor))
    assert fit.outcome is Outcome.OK
    np.testing.assert_allclose(fit.natural, natural, rtol=1e-5)
    np.testing.assert_allclose(fit.delta, delta, rtol=1e-3)
    np.testing.assert_allclose(fit.feed, [per_volt, *lam], rtol=1e-3)
    np.testing.assert_allclose(fit.beta[:2], beta[:2], rtol=5e-3)


def test_another_unit_of_volts_changes_the_gain_alone() -> None:
    sweep = noisy(Truth.random(2, 14).sweep((0.2, 0.6)), 0.01, np.random.default_rng(15))
    volts, millivolts = fit_chain(sweep), fit_chain(Sweep(sweep.omega, 1e3 * sweep.volts, sweep.phasor))
    expected = numbers(volts)
    expected[3, 0] /= 1e3
    np.testing.assert_allclose(numbers(millivolts), expected, rtol=1e-4)


def test_points_that_no_chain_makes_are_no_fit() -> None:
    rng = np.random.default_rng(16)
    sweep = Truth.random(2, 17).sweep((0.2, 0.6))
    jumbled = np.stack([rng.permutation(column) for column in sweep.phasor.T], axis=1)
    try:
        fit = fit_chain(Sweep(sweep.omega, sweep.volts, jumbled))
    except SweepError:
        return
    peak = np.abs(sweep.phasor).max(axis=0)
    assert fit.outcome is not Outcome.OK or np.all(fit.noise > 0.05 * peak)


def test_bad_sweeps_say_what_is_lacking() -> None:
    sweep = Truth.random(2, 18).sweep((0.2, 0.6))
    short = Sweep(sweep.omega[:5], sweep.volts[:5], sweep.phasor[:5])
    with pytest.raises(SweepError, match=f"actuator 0 of the chain: at least {FEWEST_POINTS} points"):
        fit_chain(short)
    with pytest.raises(SweepError, match="drive_v is 0 throughout"):
        fit_chain(Sweep(sweep.omega, 0 * sweep.volts, sweep.phasor))
    still = sweep.phasor.copy()
    still[:, 1] = 0
    with pytest.raises(SweepError, match="actuator 1 of the chain: its amplitude, or that before it, is 0 throughout"):
        fit_chain(Sweep(sweep.omega, sweep.volts, still))
    apart = sweep.phasor.copy()
    apart[::2, 0] = apart[1::2, 1] = np.nan
    with pytest.raises(SweepError, match="actuator 1 of the chain: too few points at which the one before it"):
        fit_chain(Sweep(sweep.omega, sweep.volts, apart))
    one = Sweep(np.full(20, 1.0), np.full(20, 0.2), np.repeat(sweep.phasor[:1], 20, axis=0))
    with pytest.raises(SweepError, match="does not determine every number: measure across each"):
        fit_chain(one)
