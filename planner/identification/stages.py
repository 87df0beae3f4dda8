"""What the actuators of a chain really are, learned from the pages they show: a linear estimate, stage by stage."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["EACH", "NUMBERS", "ChainEstimate", "ChainPage", "SensorNoise", "whitened"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

# What is estimated of each actuator, in this order.
NUMBERS = ("stiffness", "delta", "beta", "gain")
EACH = len(NUMBERS)
# Noise that is left to the balance of one harmonic even where nothing is measured wrongly, relative: it leaves out
# about (beta a^2)^2/40.
LEAST_NOISE = 1e-5


class SensorNoise(NamedTuple):
    """Standard deviations of the real and of the imaginary part of a measured phasor.

    Attributes
    ----------
    relative : to its modulus.
    absolute : dimensionless, as the phasor.
    """

    relative: float
    absolute: float = 0.0

    def of(self, phasor: Complexes) -> Floats:
        """Both together, relative to each phasor; float64, of its shape."""
        with np.errstate(divide="ignore", invalid="ignore"):
            whole = np.hypot(max(self.relative, LEAST_NOISE), self.absolute / np.abs(phasor))
        return np.asarray(whole)


class ChainPage(NamedTuple):
    """What a chain was set to while a page stood, and how it moved.

    Attributes
    ----------
    epsilon : amplitude of the drive's force, in units of the profile.
    lam : float64, shape (n-1,), what the links were set to.
    omega : drive frequency over f0.
    phasor : complex128, shape (n,), dimensionless, phases against the drive; NaN where nothing was measured.
    """

    epsilon: float
    lam: Floats
    omega: float
    phasor: Complexes

    @property
    def terms(self) -> Complexes:
        """Derivatives of each stage's balance by its four numbers; complex128, shape (n, 4)."""
        with np.errstate(divide="ignore", invalid="ignore"):
            links = self.lam * (self.phasor[:-1] / self.phasor[1:] - 1)
            pull = np.concatenate([[self.epsilon / self.phasor[0]], links])
        one = np.ones(len(pull))
        return np.stack([one, 1j * self.omega * one, 0.75 * np.abs(self.phasor) ** 2, -pull], axis=1)

    @property
    def force(self) -> Complexes:
        """What feeds each actuator at a gain of 1, over its own phasor; complex128, shape (n,)."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(np.concatenate([[self.epsilon], self.lam * self.phasor[:-1]]) / self.phasor)


@dataclass(frozen=True)
class ChainEstimate:
    """The numbers of n actuators as far as they are known; normal.

    Every stage balances by itself: ``k + i omega delta + (3/4) |A|^2 beta - gain pull = omega^2`` with
    ``pull = lam (A_before/A - 1)``, of the first ``epsilon/A``. That is linear in the four numbers, so each page is one
    step of Kalman's filter (Kalman, J. Basic Eng. 82, 1960), and needs no guess to start from.

    Attributes
    ----------
    mean : float64, shape (n, 4), stiffness (natural frequency squared over f0's), delta, beta, and gain: what the link
        into the actuator makes of the lam it is set to, of the first what the drive makes of a volt over the profile's.
    covariance : float64, shape (4n, 4n), actuator by actuator.
    """

    mean: Floats
    covariance: Floats

    @property
    def deviation(self) -> Floats:
        """Standard deviations, float64, shape (n, 4)."""
        return np.asarray(np.sqrt(np.diag(self.covariance)).reshape(-1, EACH))

    def expected(self, page: ChainPage) -> Floats:
        """Standard deviation of each amplitude on a page, relative to it; float64, shape (n,).

        What the cubic term makes of a changed amplitude is left out.
        """
        rate = np.cumsum(self._rates(page), axis=0).real
        return np.asarray(np.sqrt(np.einsum("mk,kl,ml->m", rate, self.covariance, rate)))

    def after(self, page: ChainPage, noise: SensorNoise) -> ChainEstimate:
        """The estimate after one more page.

        Actuators that did not move, or were not measured, or follow one that was not, stay as they are.
        """
        rates = self._rates(page)
        with np.errstate(divide="ignore", invalid="ignore"):
            off = (page.omega**2 - np.einsum("mk,mk->m", page.terms, self.mean)) / (self.mean[:, 3] * page.force)
        known = np.isfinite(off) & np.isfinite(rates).all(axis=1)
        if not known.any():
            return self
        rates, off = (whitened(part, known, noise.of(page.phasor)) for part in (rates, off[:, None]))
        rows = np.concatenate([rates.real, rates.imag])
        spread = self.covariance @ rows.T
        gain = np.linalg.solve(rows @ spread + np.eye(len(rows)), spread.T).T
        # Joseph's form: it stays symmetric and positive.
        kept = np.eye(self.mean.size) - gain @ rows
        step = gain @ np.concatenate([off.real, off.imag])[:, 0]
        covariance = kept @ self.covariance @ kept.T + gain @ gain.T
        return ChainEstimate(self.mean + step.reshape(self.mean.shape), covariance)

    def _rates(self, page: ChainPage) -> Complexes:
        """What the numbers of each stage do to its phasor over that before it, relative; complex128, shape (n, 4n).

        An error turns and stretches it by ``terms / (gain force)``, and all phasors after it alike.
        """
        n = len(self.mean)
        rates = np.zeros((n, n, EACH), dtype=np.complex128)
        with np.errstate(divide="ignore", invalid="ignore"):
            rates[np.arange(n), np.arange(n)] = page.terms / (self.mean[:, 3] * page.force)[:, None]
        return rates.reshape(n, -1)


def whitened(values: NDArray[Any], known: NDArray[np.bool_], noise: Floats) -> NDArray[Any]:
    """Balances of the stages that are `known` put together so that each has a noise of its own, of 1.

    Relative to its force, a balance has the noise of its own phasor less that of the one before. Where all are known
    the sums along the chain have one each.

    Parameters
    ----------
    values : shape (n, ...), relative to each stage's force.
    noise : float64, shape (n,), of each phasor, relative.
    """
    # A phasor that was not measured is in no balance that is known.
    each = (np.eye(len(known)) - np.eye(len(known), k=-1))[known] * np.where(np.isfinite(noise), noise, 0.0)
    return np.asarray(np.linalg.solve(np.linalg.cholesky(each @ each.T), values[known]))
