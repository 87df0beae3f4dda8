"""From a first guess to the nearest motion that can be held: Gauss-Newton on harmonic balance.

Whatever may be chosen - drive phasor, links, frequency - moves along the exact gradient; what leaves its range is
held at the end of it, so that the answer is the nearest within the range.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from chainsim import Chain, Outcome, Response, balance_near, gradient

from ..operating_point import OperatingPoint, setting_of

__all__ = ["FittedPoint", "Freedom", "MotionTarget", "fit", "response_to"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

# Harmonic balance's own error, relative to the largest amplitude.
TOL = 1e-9
STEPS = 25
# A step that changes the deviation by less, relative to the largest amplitude, is the last.
SMALL = 1e-9
# The largest share by which one step may change drive or links, and the largest change of omega.
LONGEST, FASTEST = 0.5, 0.01
# Damping (Levenberg, Marquardt) at first, at least, and at most; where phases are free there are valleys.
DAMPING, LEAST_DAMPING, MOST_DAMPING = 1e-4, 1e-8, 10.0
# Differences for rings, which have no gradient link by link.
DIFFERENCE = 1e-6
# A slope below this part of the largest is none.
NOTHING = 1e-9


@dataclass(frozen=True)
class MotionTarget:
    """A motion that is wished for.

    Attributes
    ----------
    phasor : complex128, shape (n,), dimensionless.
    phased : bool, shape (n,), where its phase is part of the wish.
    weight : float64, shape (n,), 0 = don't care.
    """

    phasor: Complexes
    phased: NDArray[np.bool_]
    weight: Floats

    def deviation(self, phasor: Complexes) -> Complexes:
        """Weighted deviation of motions of shape (..., n): complex where phases matter, else real."""
        moduli = np.abs(phasor) - np.abs(self.phasor)
        return np.asarray(np.where(self.phased, phasor - self.phasor, moduli) * self.weight)

    @property
    def scale(self) -> float:
        """The largest amplitude wished for."""
        return float(np.abs(self.phasor).max())

    def error(self, phasor: Complexes) -> float:
        """Worst deviation."""
        return float(np.abs(self.deviation(phasor)).max())

    def residual(self, phasor: Complexes) -> Floats:
        """What is squared and summed; real, shape (..., 2 n)."""
        away = self.deviation(phasor)
        return np.concatenate([away.real, away.imag], axis=-1)

    def slope(self, phasor: Complexes, change: Complexes) -> Floats:
        """Derivative of the residual at `phasor` for changes of it of shape (n, P); (2 n, P)."""
        size = np.where(np.abs(phasor) > 0, np.abs(phasor), 1.0)
        modulus = np.real(np.conj(phasor / size)[:, None] * change)
        along = np.where(self.phased[:, None], change, modulus) * self.weight[:, None]
        return np.concatenate([along.real, along.imag])


@dataclass(frozen=True)
class Freedom:
    """What may be chosen besides the drive, and in which range.

    lam : 0 where links are given, 1 where one serves all of them, n - 1 where each has its own.
    """

    lam: int
    lam_min: float
    lam_max: float
    omega_min: float
    omega_max: float
    omega: bool = True


@dataclass(frozen=True)
class FittedPoint:
    """An operating point, what is held there, and the worst deviation (infinite where nothing near it is held)."""

    point: OperatingPoint
    response: Response
    error: float

    @property
    def phasor(self) -> Complexes:
        """First harmonics, complex128, shape (n,)."""
        return np.asarray(self.response.phasor[0])

    @property
    def outcome(self) -> Outcome:
        """Whether it stands."""
        if not np.isfinite(self.error):
            return Outcome.NO_CONVERGENCE
        found = Outcome(self.response.outcome[0])
        return Outcome.UNSTABLE if found is Outcome.OK and not self.response.stable[0] else found


def response_to(chain: Chain, point: OperatingPoint, guess: Complexes) -> Response:
    """What a chain does at an operating point, near a known motion: complex128, shape (n,)."""
    return balance_near(chain, setting_of(chain, [point]), guess[None, :], tol=TOL)


def fit(chain: Chain, wanted: MotionTarget, start: OperatingPoint, freedom: Freedom) -> FittedPoint:
    """The settings nearest to the wish that can be walked to from `start`."""
    here = _tried(chain, wanted, _within(start, freedom), wanted.phasor)
    damping = DAMPING
    for _ in range(STEPS):
        if not np.isfinite(here.error):
            break
        jacobian = _jacobian(chain, wanted, here, freedom)
        if not np.isfinite(jacobian).all():
            break
        while damping <= MOST_DAMPING:
            step = _step(jacobian, wanted.residual(here.phasor), here.point, freedom, damping)
            after = _tried(chain, wanted, _within(_moved(here.point, step, freedom), freedom), here.phasor)
            if _merit(wanted, after) < _merit(wanted, here):
                break
            damping *= 10
        else:
            break
        damping = max(damping / 10, LEAST_DAMPING)
        settled = float(np.abs(after.phasor - here.phasor).max()) <= SMALL * wanted.scale
        here = after
        if settled or here.error <= SMALL * wanted.scale:
            break
    return here


def _tried(chain: Chain, wanted: MotionTarget, point: OperatingPoint, guess: Complexes) -> FittedPoint:
    response = response_to(chain, point, guess)
    phasor = response.phasor[0]
    known = response.outcome[0] in (Outcome.OK, Outcome.UNSTABLE) and bool(np.isfinite(phasor).all())
    return FittedPoint(point, response, wanted.error(phasor) if known else np.inf)


def _merit(wanted: MotionTarget, fitted: FittedPoint) -> float:
    return float(np.sum(wanted.residual(fitted.phasor) ** 2)) if np.isfinite(fitted.error) else np.inf


def _moved(point: OperatingPoint, step: Floats, freedom: Freedom) -> OperatingPoint:
    """Settings after a step in (log drive, phase, links, omega)."""
    lam = point.lam + step[2 : 2 + freedom.lam] if freedom.lam else point.lam
    omega = point.omega + (float(step[-1]) if freedom.omega else 0.0)
    return OperatingPoint(complex(point.epsilon * np.exp(step[0] + 1j * step[1])), lam, omega)


def _within(point: OperatingPoint, freedom: Freedom) -> OperatingPoint:
    if freedom.lam:
        point = replace(point, lam=np.clip(point.lam, freedom.lam_min, freedom.lam_max))
    if freedom.omega:
        point = replace(point, omega=float(np.clip(point.omega, freedom.omega_min, freedom.omega_max)))
    return point


def _jacobian(chain: Chain, wanted: MotionTarget, here: FittedPoint, freedom: Freedom) -> Floats:
    """Derivative of the residual by log drive, phase, links and omega, shape (2 n, P)."""
    if chain.feed_forward:
        slope = gradient(chain, setting_of(chain, [here.point]), here.response)
        of_drive, of_omega = slope.epsilon[0] * abs(here.point.epsilon), slope.omega[0]
        of_lam = slope.lam[0] if freedom.lam != 1 else slope.lam[0].sum(axis=1, keepdims=True)
        parts = [of_drive[:, None], 1j * here.phasor[:, None]]
        parts += [of_lam] if freedom.lam else []
        parts += [of_omega[:, None]] if freedom.omega else []
        change = np.concatenate(parts, axis=1)
    else:
        count = 2 + freedom.lam + int(freedom.omega)
        moved = [_moved(here.point, row, freedom) for row in DIFFERENCE * np.eye(count)]
        guess = np.repeat(here.phasor[None, :], count, axis=0)
        answer = balance_near(chain, setting_of(chain, moved), guess, tol=TOL)
        change = (answer.phasor - here.phasor).T / DIFFERENCE
        change[:, 1] = 1j * here.phasor
    return wanted.slope(here.phasor, change)


def _step(jacobian: Floats, residual: Floats, point: OperatingPoint, freedom: Freedom, damping: float) -> Floats:
    """A damped Gauss-Newton step; what stands at the end of its range and is pushed outwards stays there."""
    push = jacobian.T @ residual
    size = np.linalg.norm(jacobian, axis=0)
    # Where no phase is wanted turning the drive changes nothing, and its slope is rounding.
    free = np.asarray(size > NOTHING * size.max(initial=0.0))
    if freedom.lam:
        links, low, high = slice(2, 2 + freedom.lam), freedom.lam_min, freedom.lam_max
        lam = point.lam[: freedom.lam]
        free[links] &= ~(((lam <= low) & (push[links] > 0)) | ((lam >= high) & (push[links] < 0)))
    if freedom.omega:
        out = (point.omega <= freedom.omega_min and push[-1] > 0) or (point.omega >= freedom.omega_max and push[-1] < 0)
        free[-1] &= not out
    step = np.zeros(len(free))
    scale = np.maximum(np.linalg.norm(jacobian[:, free], axis=0), 1e-300)
    ridge = damping * np.eye(len(scale))
    right = np.concatenate([-residual, np.zeros(len(scale))])
    step[free] = np.linalg.lstsq(np.concatenate([jacobian[:, free] / scale, ridge]), right)[0] / scale
    share = float(np.abs(step[:2]).max()) / LONGEST
    if freedom.lam:
        share = max(share, float(np.max(np.abs(step[links]) / np.maximum(lam, 1e-4))) / LONGEST)
    if freedom.omega:
        share = max(share, abs(float(step[-1])) / FASTEST)
    return step / max(1.0, share)
