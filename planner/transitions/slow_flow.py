"""The slow flow of a chain under drive and links that vary, many drives at once.

With z_m = Re(A_m e^{i omega tau}), a stage of an open chain obeys ``A'' + D A' + K A = F`` with
``D = 2 i omega + delta``, ``K = 1 - omega^2 + i delta omega + lam + (3/4) beta |A|^2 + (3/128) beta^2 |A|^4`` (the
last term is the third harmonic's way back) and ``F = lam A_{m-1}``, or the drive. The chain's law says what else pulls
at it, in a ring or from behind. Second order: A'' is the derivative of the first order, ``A' = (F - K A) / D``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from chainsim import Chain

__all__ = ["DriveCourse", "follow_course"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]


@dataclass(frozen=True)
class DriveCourse:
    """What is done to a chain on the way, at the 2 N + 1 ends and middles of N equal steps.

    Attributes
    ----------
    epsilon, epsilon_slope : complex128, shape (2 N + 1, P), P drive envelopes and their derivatives in tau.
    lam, lam_slope : float64, shape (2 N + 1, n), the links, alike for all P; ``lam[:, 0]`` closes a ring or is 0.
    lent : float64, shape (2 N + 1, n), squares of amplitudes whose stiffness is lent where the flow is linear.
    """

    epsilon: Complexes
    epsilon_slope: Complexes
    lam: Floats
    lam_slope: Floats
    lent: Floats


@dataclass(frozen=True)
class _Links:
    """Links at so many instants as their law has them: from the one before, from the one behind, and back; (S, n)."""

    before: Floats
    behind: Floats | None
    back: Floats

    @classmethod
    def of(cls, chain: Chain, lam: Floats) -> _Links:
        return cls(lam, chain.law.second(lam, None), chain.law.stiffness(np.zeros(1), lam, None))

    def pulled(self, at: int, here: Complexes) -> Complexes:
        """What they do to actuators at `here`, shape (n, P), without the terms that stiffen them."""
        force: Complexes = self.before[at, :, None] * np.roll(here, 1, axis=0)
        if self.behind is not None:
            force += self.behind[at, :, None] * np.roll(here, -1, axis=0)
        return force


def follow_course(
    chain: Chain, omega: float, duration: float, course: DriveCourse, start: Complexes, softness: float
) -> Complexes:
    """Amplitudes on the way, by Runge and Kutta's fourth-order steps.

    Parameters
    ----------
    duration : in tau.
    start : complex128, shape (n,), amplitudes to begin with.
    softness : at 1 the stiffness is the chain's, at 0 what is lent instead: the flow is then linear and, if what is
        lent is its amplitude there, stands at the same end.

    Returns
    -------
    complex128, shape (N + 1, n, P), dimensionless; not finite where a motion grows without bound.
    """
    damping = 2j * omega + chain.delta
    cubic, quintic = softness * 0.75 * chain.beta, softness * 3 / 128 * chain.beta**2
    lent = (1 - softness) * course.lent * (0.75 * chain.beta + 3 / 128 * chain.beta**2 * course.lent)
    still = 1.0 - omega**2 + 1j * chain.delta * omega + lent
    links, slopes = _Links.of(chain, course.lam), _Links.of(chain, course.lam_slope)

    def slope(at: int, here: Complexes) -> Complexes:
        square = here.real**2 + here.imag**2
        stiff = (still[at, :, None] + links.back[at, :, None]) + square * (cubic + quintic * square)
        force = links.pulled(at, here)
        force[0] += course.epsilon[at]
        first = (force - stiff * here) / damping
        turning = slopes.pulled(at, here) + links.pulled(at, first)
        turning[0] += course.epsilon_slope[at]
        stiffening = 2 * cubic * (here.real * first.real + here.imag * first.imag) + slopes.back[at, :, None]
        second = (turning - stiff * first - stiffening * here) / damping
        return np.asarray(first - second / damping)

    steps = (len(course.lam) - 1) // 2
    h = duration / steps
    here = np.repeat(start[:, None], course.epsilon.shape[1], axis=1)
    trace = np.empty((steps + 1, *here.shape), dtype=np.complex128)
    trace[0] = here
    for k in range(steps):
        a = slope(2 * k, here)
        b = slope(2 * k + 1, here + h / 2 * a)
        c = slope(2 * k + 1, here + h / 2 * b)
        d = slope(2 * k + 2, here + h * c)
        here = here + h / 6 * (a + 2 * (b + c) + d)
        trace[k + 1] = here
    return trace
