"""What the actuators of a chain really are, fitted to measured frequency sweeps, with confidence intervals."""

from __future__ import annotations

from dataclasses import dataclass
from statistics import NormalDist
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chainsim import Outcome

from ..errors import PlanError
from ..robustness.batch_march import BatchMotion, BatchParts, march

__all__ = ["FEWEST_POINTS", "ChainFit", "Sweep", "SweepError", "fit_chain"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
Mask = NDArray[np.bool_]

# Numbers fitted to each actuator: natural frequency, damping, cubic term, and what feeds it.
EACH = 4
# Two real numbers a point: this leaves as many to judge the fit by as it has unknowns.
FEWEST_POINTS = 2 * EACH
START_STEPS, REWEIGHTINGS = 12, 3
# Standard deviations from the fit beyond which a point is no noise (a jump at a fold, a slipped contact).
OUTLYING = 5.0
# Of a normal distribution: standard deviation over median absolute deviation.
PER_MEDIAN = 1.4826
# A fit that disowns more of an actuator's points than this is no fit.
MOST_OUTLYING = 0.2
# Noise assumed, of the largest amplitude, until the fit has told how large it is; and the least that is believed: the
# equations themselves are no better, and a point is no outlier for what one harmonic leaves out.
FIRST_NOISE, LEAST_NOISE = 0.02, 1e-4
# The search ends within so many standard errors of its goal.
NEAR = 1e-3
MOST_STEPS = 200
FIRST_DAMPING, EASE, MOST_DAMPING = 1e-3, 0.2, 1e8
# Natural frequencies lie within this factor of f0; links, cubic forces and drives are at most so many times the linear
# force of the largest amplitude.
STRONGEST = 10.0
# Damping of anything that has been seen to settle.
SLACKEST = 1e-9


class SweepError(PlanError, ValueError):
    """A sweep does not determine the actuators.

    Examples: too few points for an actuator; a drive of zero throughout; frequencies so far from a resonance, or
    amplitudes so small, that damping or the cubic term leaves no trace.
    """


@dataclass(frozen=True)
class Sweep:
    """Measured steady vibrations of the first n actuators of an open chain, in S settings of the drive.

    Attributes
    ----------
    omega : float64, shape (S,), drive frequency over the device's f0.
    volts : float64, shape (S,), drive amplitude.
    phasor : complex128, shape (S, n), z = Re(phasor e^{i omega tau}) under volts cos(omega tau), dimensionless; NaN
        where nothing was measured. Up and down sweeps may differ at one setting: the branch is taken from here.
    """

    omega: Floats
    volts: Floats
    phasor: Complexes


@dataclass(frozen=True)
class ChainFit:
    """The numbers of n actuators, dimensionless in units of the device's f0, with their standard errors.

    Attributes
    ----------
    natural : float64, shape (n,), natural frequency over the device's f0.
    delta, beta : float64, shape (n,).
    feed : float64, shape (n,); the first is the drive's epsilon per volt, the others are lam.
    error : float64, shape (4, n), standard errors of natural, delta, beta and feed.
    covariance : float64, shape (4n, 4n), actuator by actuator.
    noise : float64, shape (n,), standard deviation of the real and of the imaginary part of a measured phasor.
    measured, used : bool, shape (S, n), points that were measured; those of them that are no outliers.
    outcome : no_convergence when the search did not end, or too many points lie far from the fit.
    """

    natural: Floats
    delta: Floats
    beta: Floats
    feed: Floats
    error: Floats
    covariance: Floats
    noise: Floats
    measured: Mask
    used: Mask
    outcome: Outcome

    def half_width(self, confidence: float) -> Floats:
        """Half widths of confidence intervals (normal), float64, shape (4, n); `confidence` such as 0.95."""
        return np.asarray(NormalDist().inv_cdf((1 + confidence) / 2) * self.error)


def fit_chain(sweep: Sweep) -> ChainFit:
    """Least squares between measured phasors and those of the chain in one harmonic, all actuators together.

    A linear fit of each oscillator's own balance gives the start; the joint fit then weighs points by the noise found
    at their actuator, on the branch next to what was measured, and leaves out what lies far off. Standard errors come
    from the Jacobian there. Harmonics left out bias a fit by about (beta a^2)^2/40 over the distance to resonance.

    Raises
    ------
    SweepError
        When the points cannot determine every number.
    """
    measured = np.isfinite(sweep.phasor)
    few = np.flatnonzero(measured.sum(axis=0) < FEWEST_POINTS)
    if few.size:
        raise SweepError(f"actuator {few[0]} of the chain: at least {FEWEST_POINTS} points are needed to fit it")
    if not np.any(sweep.volts):
        raise SweepError("drive_v is 0 throughout: nothing moves, measure under a drive")
    x = _starts(sweep)
    fit = _Fit(sweep)
    noise = FIRST_NOISE * fit.peak
    for _ in range(REWEIGHTINGS):
        x, converged = fit.search(x, noise, measured, robust=True)
        noise = fit.noise(x, measured)
    used = measured & (np.abs(np.nan_to_num(fit.off(fit.motion(x)))) <= OUTLYING * noise)
    x, converged = fit.search(x, noise, used, robust=False)
    kept = used.sum(axis=0) >= (1 - MOST_OUTLYING) * measured.sum(axis=0)
    return fit.result(x, used, converged and bool(kept.all()))


def _starts(sweep: Sweep) -> Floats:
    """Where the search starts, shape (n, 4): the first actuator, which moves most, lends the others its cubic term."""
    first = _start(sweep, 0, None)
    return np.array([first, *(_start(sweep, m, first[2]) for m in range(1, sweep.phasor.shape[1]))])


def _start(sweep: Sweep, m: int, beta: float | None) -> Floats:
    """Linear least squares of ``nu^2 A + i omega delta A + 3/4 beta |A|^2 A - feed F = omega^2 A``; shape (4,).

    F is the volts, or the difference of the phasors at both ends of the link. A point's weight is the inverse of what
    the balance makes of its noise, by the fit before, and less for an outlier.
    """
    here = sweep.phasor[:, m]
    feed = sweep.volts + 0j if m == 0 else sweep.phasor[:, m - 1] - here
    known = np.isfinite(here) & np.isfinite(feed)
    if known.sum() < FEWEST_POINTS:
        raise SweepError(f"actuator {m} of the chain: too few points at which the one before it was measured as well")
    here, feed, omega = here[known], feed[known], sweep.omega[known]
    square = 0.75 * np.abs(here) ** 2
    terms = np.stack([here, 1j * omega * here, -feed, *([square * here] if beta is None else [])], axis=1)
    right = (omega**2 - square * (beta or 0.0)) * here
    weight = np.ones(len(here))
    for _ in range(START_STEPS):
        nu2, delta, strength, *cubic = found = _solved(terms * weight[:, None], right * weight, m)
        curved = cubic[0] if beta is None else beta
        impedance = nu2 - omega**2 + 2 * curved * square + 1j * delta * omega
        weight = 1 / np.hypot(np.abs(impedance), strength if m else 0.0)
        # What is left, as a change of the phasor; the farther off a point is, the less it counts.
        off = np.abs(terms @ found - right) * weight
        weight /= 1 + (off / (OUTLYING * max(float(np.median(off)), LEAST_NOISE * float(np.abs(here).max())))) ** 2
    return np.array([np.sqrt(max(nu2, 0.01)), max(delta, 1e-6), curved, max(strength, 1e-6)])


def _solved(terms: NDArray[Any], right: NDArray[Any], m: int) -> Floats:
    rows = np.concatenate([terms.real, terms.imag])
    size = np.linalg.norm(rows, axis=0)
    if np.any(size == 0):
        raise SweepError(f"actuator {m} of the chain: its amplitude, or that before it, is 0 throughout")
    found = np.linalg.lstsq(rows / size, np.concatenate([right.real, right.imag]))[0]
    return np.asarray(found / size)


class _Fit:
    """The joint problem; its unknowns are an array of shape (n, 4): natural frequency, damping, cubic term, feed."""

    def __init__(self, sweep: Sweep) -> None:
        self.sweep, self.n = sweep, sweep.phasor.shape[1]
        self.peak: Floats = np.nanmax(np.abs(sweep.phasor), axis=0)
        one, cubic = np.ones(self.n), STRONGEST / self.peak**2
        feed = np.append(STRONGEST * self.peak[0] / sweep.volts.max(), STRONGEST * one[1:])
        self.low = np.stack([one / STRONGEST, SLACKEST * one, -cubic, 0 * one], axis=1)
        self.high = np.stack([one * STRONGEST, one, cubic, feed], axis=1)

    def motion(self, x: Floats) -> BatchMotion:
        """The chain at every setting of the sweep: phasors of shape (n, S)."""
        natural, delta, beta, feed = x.T[:, :, None]
        force = np.zeros((self.n, len(self.sweep.omega)), dtype=np.complex128)
        force[0] = feed[0] * self.sweep.volts
        lam = np.concatenate([np.zeros((1, 1)), feed[1:]])
        parts = BatchParts(natural**2, delta, beta, np.ones((self.n, 1)))
        return march(parts, force, lam, self.sweep.omega, near=self.sweep.phasor.T)

    def slopes(self, x: Floats, motion: BatchMotion) -> Complexes:
        """Derivatives of the phasors; complex128, shape (n, 4n, S)."""
        here, omega = motion.phasor, self.sweep.omega
        own = np.zeros((self.n, EACH * self.n, len(omega)), dtype=np.complex128)
        for m in range(self.n):
            first = EACH * m
            own[m, first] = -2 * x[m, 0] * here[m]
            own[m, first + 1] = -1j * omega * here[m]
            own[m, first + 2] = -0.75 * np.abs(here[m]) ** 2 * here[m]
            own[m, first + 3] = self.sweep.volts if m == 0 else here[m - 1] - here[m]
        return motion.tangent(own)

    def off(self, motion: BatchMotion) -> Complexes:
        """Phasors of the fit minus those measured; complex128, shape (S, n)."""
        return np.asarray(motion.phasor.T - self.sweep.phasor)

    def noise(self, x: Floats, measured: Mask) -> Floats:
        """Standard deviation of either part of a phasor, from the median distance to the fit; shape (n,)."""
        off = self.off(self.motion(x))
        parts = [np.abs(np.concatenate([o[k].real, o[k].imag])) for o, k in zip(off.T, measured.T, strict=True)]
        return np.maximum(PER_MEDIAN * np.array([np.median(part) for part in parts]), self.least_noise())

    def least_noise(self) -> Floats:
        """The least noise that is believed; float64, shape (n,)."""
        return np.asarray(LEAST_NOISE * self.peak)

    def search(self, x: Floats, noise: Floats, points: Mask, *, robust: bool) -> tuple[Floats, bool]:
        """The unknowns that fit best near `x`, and whether the search ended: Levenberg's and Marquardt's method.

        Robust: a residual r costs ``2 (sqrt(1 + r^2) - 1)`` instead of its square, so that outliers pull little.
        """
        x, damping = np.clip(x, self.low, self.high), FIRST_DAMPING
        motion = self.motion(x)
        cost, rest = self._cost(motion, noise, points, robust)
        slope, curvature = self._bends(x, motion, rest, noise, points, robust)
        for _ in range(MOST_STEPS):
            size = np.sqrt(np.maximum(np.diag(curvature), np.finfo(np.float64).tiny))
            scaled = curvature / np.outer(size, size) + damping * np.eye(len(size))
            step = np.linalg.lstsq(scaled, -slope / size)[0] / size
            trial = np.clip(x + step.reshape(x.shape), self.low, self.high)
            # slope.step is the square of how many standard errors the goal is away.
            near = float(-slope @ step) <= NEAR**2
            motion = self.motion(trial)
            found, rest = self._cost(motion, noise, points, robust)
            if found <= cost:
                x, cost = trial, found
                if near:
                    return x, True
                slope, curvature = self._bends(x, motion, rest, noise, points, robust)
                damping *= EASE
            elif near or damping > MOST_DAMPING:
                return x, near
            else:
                damping = max(damping, FIRST_DAMPING) / EASE
        return x, False

    def _cost(self, motion: BatchMotion, noise: Floats, points: Mask, robust: bool) -> tuple[float, Floats]:
        """The cost, infinite where there is no answer, and the residuals."""
        rest = _stacked((self.off(motion) / noise)[None], points)[0]
        cost = np.sum(2 * (np.sqrt(1 + rest**2) - 1) if robust else rest**2)
        return float(cost) if np.isfinite(cost) else np.inf, rest

    def _bends(
        self, x: Floats, motion: BatchMotion, rest: Floats, noise: Floats, points: Mask, robust: bool
    ) -> tuple[Floats, Floats]:
        """Half of the cost's gradient and of its second derivatives (Gauss and Newton's)."""
        slopes = self.jacobian(x, motion, noise, points)
        weighed = slopes / np.sqrt(1 + rest**2) if robust else slopes
        return weighed @ rest, weighed @ slopes.T

    def jacobian(self, x: Floats, motion: BatchMotion, noise: Floats, points: Mask) -> Floats:
        """Derivatives of the residuals of `points`, in standard deviations; shape (4n, 2 points).

        A point just at a fold has none, and counts as if it stood still.
        """
        with np.errstate(divide="ignore", invalid="ignore"):
            slopes = self.slopes(x, motion).transpose(1, 2, 0) / noise
        found = _stacked(slopes, points)
        found[:, ~np.isfinite(found).all(axis=0)] = 0.0
        return found

    def result(self, x: Floats, used: Mask, converged: bool) -> ChainFit:
        """Numbers, standard errors and noise of the finished fit."""
        motion = self.motion(x)
        off = np.where(used, self.off(motion), 0)
        freedom = 2.0 * used.sum(axis=0) - EACH
        spread = np.sqrt(np.sum(np.abs(off) ** 2, axis=0) / np.maximum(freedom, 1))
        noise = np.maximum(spread, self.least_noise())
        covariance = _inverse(self.jacobian(x, motion, noise, used))
        error = np.sqrt(np.diag(covariance)).reshape(self.n, EACH).T
        return ChainFit(
            natural=_frozen(x[:, 0]),
            delta=_frozen(x[:, 1]),
            beta=_frozen(x[:, 2]),
            feed=_frozen(x[:, 3]),
            error=_frozen(error),
            covariance=_frozen(covariance),
            noise=_frozen(noise),
            measured=_frozen(np.isfinite(self.sweep.phasor)),
            used=_frozen(used),
            outcome=Outcome.OK if converged else Outcome.NO_CONVERGENCE,
        )


def _frozen(values: NDArray[Any]) -> NDArray[Any]:
    kept = values.copy()
    kept.flags.writeable = False
    return kept


def _stacked(values: Complexes, points: Mask) -> Floats:
    """Real and imaginary parts at `points`, one after another; from shape (D, S, n) to (D, 2 points)."""
    picked = values[:, points]
    return np.concatenate([picked.real, picked.imag], axis=1)


def _inverse(slopes: Floats) -> Floats:
    """(J^T J)^-1 for J of shape (unknowns, residuals), by the eigenvalues of the matrix for rows of equal size.

    Raises
    ------
    SweepError
        When a direction in the unknowns leaves the residuals as they are.
    """
    size = np.linalg.norm(slopes, axis=1)
    if np.all(size > 0):
        values, vectors = np.linalg.eigh((slopes @ slopes.T) / np.outer(size, size))
        if values[0] > slopes.shape[1] * np.finfo(np.float64).eps * values[-1]:
            return np.asarray(vectors / values @ vectors.T / np.outer(size, size))
    raise SweepError(
        "the sweep does not determine every number: measure across each actuator's resonance, with links above 0, at a "
        "second, larger drive level; and see that phases are radians, negative where the motion lags"
    )
