"""What a way does under the full equations, from rest or from a standing motion, and in the time after."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from chainsim import Chain

from ..drive import FirstOrderHold, closed, cubic, cubic_slope, felt, full_motion, smooth_step

__all__ = ["Orbit", "Passage", "Way", "travel"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

SAMPLES_PER_PERIOD = 64
# Periods in which a standing motion is set up; what that leaves of a transient is below 1e-6 of the motion.
PRELUDE = 24


@dataclass(frozen=True)
class Way:
    """A ramp in tau: cubic Hermite between the drive's nodes, straight between those of the links, then constant.

    Attributes
    ----------
    tau : float64, shape (K,).
    epsilon, epsilon_slope : complex128, shape (K,), slope in tau.
    lam_tau : float64, shape (L,).
    lam : float64, shape (L, n-1).
    """

    tau: Floats
    epsilon: Complexes
    epsilon_slope: Complexes
    lam_tau: Floats
    lam: Floats

    def drive(self, tau: Floats) -> tuple[Complexes, Complexes]:
        """Envelope and its derivative at instants `tau`."""
        nodes = self.tau, self.epsilon, self.epsilon_slope
        return cubic(tau, *nodes), cubic_slope(tau, *nodes)

    def then(self, other: Way) -> Way:
        """This way and another behind it, which begins where this one ends."""
        end = float(self.tau[-1])
        return Way(
            np.concatenate([self.tau, end + other.tau[1:]]),
            np.concatenate([self.epsilon, other.epsilon[1:]]),
            np.concatenate([self.epsilon_slope, other.epsilon_slope[1:]]),
            np.concatenate([self.lam_tau, end + other.lam_tau[1:]]),
            np.concatenate([self.lam, other.lam[1:]]),
        )

    def links(self, tau: Floats) -> Floats:
        """Links at instants `tau`: float64, shape (len(tau), n-1)."""
        out = np.empty((len(tau), self.lam.shape[1]))
        for m, link in enumerate(self.lam.T):
            out[:, m] = np.interp(tau, self.lam_tau, link)
        return out


@dataclass(frozen=True)
class Orbit:
    """A periodic motion ``z = Re(sum_k harmonics[k - 1] e^{i k omega tau})``.

    Attributes
    ----------
    harmonics : complex128, shape (H, n).
    lam : float64, shape (n-1,), the links it stands under.
    omega : over f0.
    """

    harmonics: Complexes
    lam: Floats
    omega: float

    def turned(self, angle: float) -> Orbit:
        """The orbit with its phase advanced by an angle in radians."""
        factor = np.exp(1j * angle * np.arange(1, len(self.harmonics) + 1))
        return Orbit(np.asarray(self.harmonics * factor[:, None]), self.lam, self.omega)

    def at(self, tau: Floats) -> Floats:
        """Positions at instants `tau`: float64, shape (len(tau), n)."""
        rate = 1j * self.omega * np.arange(1, len(self.harmonics) + 1)
        return np.asarray((np.exp(np.multiply.outer(tau, rate)) @ self.harmonics).real)

    def prelude(self, chain: Chain, dtau: float, phase: float) -> Floats:
        """Forces on every actuator that lead from rest onto the orbit, up to one sample before its `phase`.

        The motion is chosen, the orbit times a smooth step, and the equations say which forces that takes.

        Returns
        -------
        float64, shape (samples, n), every `dtau`.
        """
        count = PRELUDE * SAMPLES_PER_PERIOD
        length = count * dtau
        x = np.arange(count) / count
        step, _, bend = smooth_step(x)
        # Multiplied in this order: what a stop magnifies is the last digit too.
        slope = 30 * (x * (1 - x)) ** 2
        rate = 1j * self.omega * np.arange(1, len(self.harmonics) + 1)
        turning = np.exp(rate * (x[:, None] - 1) * length + rate / self.omega * phase)
        z, v, a = ((turning * rate**k @ self.harmonics).real for k in range(3))
        moved = step[:, None] * z
        force = (
            step[:, None] * a + slope[:, None] * (2 * v + chain.deltas * z) / length + bend[:, None] * z / length**2
            + step[:, None] * chain.deltas * v + chain.stiffness * moved + chain.betas * moved**3
        )  # fmt: skip
        pulled = np.zeros_like(moved)
        chain.law.pull(pulled, moved, closed(chain, self.lam))
        return np.asarray(force - pulled)


@dataclass(frozen=True)
class Passage:
    """How it went from P phases of the carrier.

    Attributes
    ----------
    felt : complex128, shape (P, periods, n), first harmonics in each whole period after the way.
    peak : largest |z| of all.
    """

    felt: Complexes
    peak: float


def travel(chain: Chain, omega: float, way: Way, start: Orbit | None, periods: int, phases: Sequence[float]) -> Passage:
    """Follow a way from rest or from an orbit, then stand for so many periods.

    Parameters
    ----------
    phases : of the carrier when the way begins, and of the orbit, radians; all are followed side by side.
    """
    dtau = 2 * math.pi / omega / SAMPLES_PER_PERIOD
    steps = math.ceil(float(way.tau[-1]) / dtau)
    tau = dtau * np.arange(steps + periods * SAMPLES_PER_PERIOD, dtype=np.float64)
    carrier = np.exp(1j * np.add.outer(omega * tau, phases))
    envelope = FirstOrderHold.of(omega, dtau).raised(*way.drive(tau))
    lam = closed(chain, way.links(tau))[:, None]
    before = None
    if start is not None:
        forces = np.stack([start.prelude(chain, dtau, phase) for phase in phases], axis=1)
        before = forces / FirstOrderHold.of(start.omega, dtau).passed, closed(chain, start.lam)
    z = full_motion(chain, dtau, (envelope[:, None] * carrier).real, lam, before=before)
    after = felt(z[steps:], carrier[steps:, :, None], SAMPLES_PER_PERIOD)
    return Passage(after.transpose(1, 0, 2), float(np.abs(z).max()))
