"""What the actuators of a chain really are, learned from the pages they show: a linear estimate, stage by stage."""

from __future__ import annotations

from dataclasses import dataclass, replace
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
# Of what moves besides a harmonic so much is seen in it, and in what the cubic term makes of it.
LEAK = 0.03
# A number may leave what was known by so many standard deviations: what lies farther off is no actuator of the device.
FARTHEST = 10.0


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
    rate : complex128, shape (n,), by how much each phasor changes in tau; None where the page has settled.
    rest : float64, shape (n,), mean square of what moves besides, dimensionless; None as of `rate`.
    """

    epsilon: float
    lam: Floats
    omega: float
    phasor: Complexes
    rate: Complexes | None = None
    rest: Floats | None = None

    def noise(self, sensor: SensorNoise) -> Floats:
        """Standard deviation of each phasor, relative to it; float64, shape (n,)."""
        whole = sensor.of(self.phasor)
        if self.rest is not None:
            with np.errstate(divide="ignore", invalid="ignore"):
                whole = np.hypot(whole, LEAK * np.sqrt(self.rest) / np.abs(self.phasor))
        return np.asarray(whole)

    @property
    def growth(self) -> Complexes:
        """Rate of each phasor over itself, complex128, shape (n,)."""
        if self.rate is None:
            return np.zeros_like(self.phasor)
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(self.rate / self.phasor)

    @property
    def square(self) -> Floats:
        """What beta makes a stage stiffer by; what moves at other frequencies counts twice. float64, shape (n,)."""
        own = 0.75 * np.abs(self.phasor) ** 2
        return own if self.rest is None else own + 3 * self.rest

    @property
    def wanted(self) -> Complexes:
        """What `terms` times the numbers of a stage are; complex128, shape (n,)."""
        return np.asarray(self.omega**2 - 2j * self.omega * self.growth)

    @property
    def terms(self) -> Complexes:
        """Derivatives of each stage's balance by its four numbers; complex128, shape (n, 4)."""
        with np.errstate(divide="ignore", invalid="ignore"):
            links = self.lam * (self.phasor[:-1] / self.phasor[1:] - 1)
            pull = np.concatenate([[self.epsilon / self.phasor[0]], links])
        one = np.ones(len(pull))
        return np.stack([one, 1j * self.omega + self.growth, self.square, -pull], axis=1)

    @property
    def force(self) -> Complexes:
        """What feeds each actuator at a gain of 1, over its own phasor; complex128, shape (n,)."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(np.concatenate([[self.epsilon], self.lam * self.phasor[:-1]]) / self.phasor)


@dataclass(frozen=True)
class ChainEstimate:
    """The numbers of n actuators as far as they are known; normal.

    Every stage balances by itself: ``k + (i omega + g) delta + (3/4) |A|^2 beta - gain pull = omega^2 - 2 i omega g``
    with ``pull = lam (A_before/A - 1)``, of the first ``epsilon/A``, and ``g = A'/A`` while it still changes. That is
    linear in the four numbers, so each page is one step of Kalman's filter (Kalman, J. Basic Eng. 82, 1960), and needs
    no guess to start from.

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
        rows, off = self._balances(page, noise)
        if not len(rows):
            return self
        spread = self.covariance @ rows.T
        gain = np.linalg.solve(rows @ spread + np.eye(len(rows)), spread.T).T
        # Joseph's form: it stays symmetric and positive.
        kept = np.eye(self.mean.size) - gain @ rows
        covariance = kept @ self.covariance @ kept.T + gain @ gain.T
        return ChainEstimate(self.mean + (gain @ off).reshape(self.mean.shape), covariance)

    def surprise(self, page: ChainPage, noise: SensorNoise) -> float:
        """How far a page is from what was expected: mean square, in its own deviations; about 1 where all is known."""
        rows, off = self._balances(page, noise)
        if not len(rows):
            return 0.0
        return float(off @ np.linalg.solve(rows @ self.covariance @ rows.T + np.eye(len(rows)), off)) / len(rows)

    def faded(self, prior: ChainEstimate, share: float) -> ChainEstimate:
        """As much surer than `prior` as is left when a share of it has faded; the numbers stay."""
        return replace(self, covariance=(1 - share) * self.covariance + share * prior.covariance)

    def believed(self, prior: ChainEstimate) -> Floats:
        """The numbers within what can be believed given what was known before any page; float64, shape (n, 4)."""
        before, wide = prior.mean, prior.deviation
        low = before - FARTHEST * wide
        # No stiffness, damping or gain changes its sign.
        low = np.where(np.array(NUMBERS) == "beta", low, np.maximum(low, 0.1 * before))
        return np.asarray(np.clip(self.mean, low, before + FARTHEST * wide))

    def _balances(self, page: ChainPage, noise: SensorNoise) -> tuple[Floats, Floats]:
        """What the numbers do to the balances that are known, and what these lack, each with a noise of 1."""
        rates = self._rates(page)
        with np.errstate(divide="ignore", invalid="ignore"):
            off = (page.wanted - np.einsum("mk,mk->m", page.terms, self.mean)) / (self.mean[:, 3] * page.force)
        known = np.isfinite(off) & np.isfinite(rates).all(axis=1)
        if not known.any():
            return np.empty((0, self.mean.size)), np.empty(0)
        rates, off = (whitened(part, known, page.noise(noise)) for part in (rates, off[:, None]))
        return np.concatenate([rates.real, rates.imag]), np.concatenate([off.real, off.imag])[:, 0]

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
