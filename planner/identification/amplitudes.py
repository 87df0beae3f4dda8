"""The numbers of actuators from amplitudes alone, where a sensor tells no phases: a fit over the last pages."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from .stages import EACH, ChainEstimate, ChainPage, SensorNoise, whitened

__all__ = ["PAGES_KEPT", "fit_amplitudes"]

Floats = NDArray[np.float64]

# A page says one thing of an actuator here, not two: so many are fitted together.
PAGES_KEPT = 8
# A fit ends when a step changes nothing by more than this share of a standard deviation.
SMALL = 1e-6


def fit_amplitudes(prior: ChainEstimate, pages: Sequence[ChainPage], noise: SensorNoise) -> ChainEstimate:
    """The likeliest numbers given what was known before any page, and the amplitudes of the last pages.

    The modulus of a stage's balance needs the amplitudes at both its ends alone: ``|k - omega^2 + (3/4) |A|^2 beta +
    gain lam + i omega delta| = gain lam |A_before| / |A|``, of the first ``... = gain epsilon / |A|`` without the link.
    It is not linear in the numbers and has two answers for each page, on both sides of the resonance; the one next to
    what was known is taken.

    Parameters
    ----------
    prior : what was known before.
    pages : the last `PAGES_KEPT` of them count; phases are not looked at.
    """
    from scipy.optimize import least_squares

    balances = [_Balance(page, noise) for page in pages[-PAGES_KEPT:]]
    free = np.flatnonzero(np.diag(prior.covariance) > 0)
    root = np.linalg.cholesky(prior.covariance[np.ix_(free, free)])

    def at(y: Floats) -> Floats:
        # In standard deviations of what was known.
        x = prior.mean.ravel().copy()
        x[free] += root @ y
        return x.reshape(-1, EACH)

    def residual(y: Floats) -> Floats:
        return np.concatenate([*(one.off(at(y)) for one in balances), y])

    def jacobian(y: Floats) -> Floats:
        return np.concatenate([*(one.slope(at(y))[:, free] @ root for one in balances), np.eye(len(free))])

    y = least_squares(residual, np.zeros(len(free)), jacobian, method="lm", xtol=SMALL).x
    slope = jacobian(y)
    covariance = np.zeros_like(prior.covariance)
    covariance[np.ix_(free, free)] = root @ np.linalg.inv(slope.T @ slope) @ root.T
    return ChainEstimate(at(y), covariance)


class _Balance:
    """The moduli of one page's balances, of the stages whose amplitudes are known at both ends."""

    def __init__(self, page: ChainPage, noise: SensorNoise) -> None:
        self._noise = page.noise(noise)
        size = np.abs(page.phasor)
        self._omega, self._cubic = page.omega, 0.75 * size**2
        self._lam = np.append(0.0, page.lam)
        with np.errstate(divide="ignore", invalid="ignore"):
            self._force = np.append(page.epsilon, page.lam * size[:-1]) / size
            self._known = np.isfinite(np.log(self._force))

    def off(self, x: Floats) -> Floats:
        """Logarithms of the moduli over what was measured, put together; float64, shape (stages,)."""
        off = np.log(np.abs(self._balance(x)) / (x[:, 3] * self._force))
        return np.asarray(whitened(off, self._known, self._noise))

    def slope(self, x: Floats) -> Floats:
        """Derivatives of `off`; float64, shape (stages, 4n)."""
        n = len(x)
        one = np.ones(n)
        own = np.real(np.stack([one, 1j * self._omega * one, self._cubic, self._lam], 1) / self._balance(x)[:, None])
        own[:, 3] -= 1 / x[:, 3]
        along = np.zeros((n, n, EACH))
        along[np.arange(n), np.arange(n)] = own
        return np.asarray(whitened(along.reshape(n, -1), self._known, self._noise))

    def _balance(self, x: Floats) -> NDArray[np.complex128]:
        stiffness, delta, beta, gain = x.T
        real = stiffness - self._omega**2 + self._cubic * beta + gain * self._lam
        return np.asarray(real + 1j * self._omega * delta)
