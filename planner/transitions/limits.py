"""What a way may use, and whether what is asked for makes sense."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from chainsim import Chain

from ..errors import PlanError
from ..operating_point import OperatingPoint
from .check import Way

__all__ = ["WayError", "WayLimits", "checked"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]


class WayError(PlanError, ValueError):
    """A way was asked for that makes no sense.

    Examples: a grid; links of another shape than the chain; a phasor that is not finite; a `lam_min` above `lam_max`.
    """


@dataclass(frozen=True)
class WayLimits:
    """What a way may use.

    Attributes
    ----------
    epsilon_max : largest dimensionless drive.
    slew_per_s : its fastest change, carrier included, per second.
    lam_min, lam_max : range of the links.
    lam_scope : whether links may move on the way, and whether one by one (`link`) or all alike (`chain`); `fixed` keeps
        them at their steady values.
    well_share : largest part of the hilltop amplitude sqrt(1/|beta|) that may be passed through (beta < 0).

    Raises
    ------
    WayError
        With the field and its value.
    """

    epsilon_max: float
    lam_min: float
    lam_max: float
    lam_scope: Literal["fixed", "chain", "link"]
    slew_per_s: float
    well_share: float

    def __post_init__(self) -> None:
        for name in ("epsilon_max", "slew_per_s", "well_share"):
            if not getattr(self, name) > 0:
                raise WayError(f"limits.{name}: expected a number > 0, got {getattr(self, name)}")
        if not 0 <= self.lam_min <= self.lam_max < math.inf:
            raise WayError(f"limits.lam_min, lam_max: expected 0 <= min <= max, got {self.lam_min}, {self.lam_max}")
        if self.lam_scope not in ("fixed", "chain", "link"):
            raise WayError(f"limits.lam_scope: expected fixed, chain or link, got {self.lam_scope!r}")

    def hilltop(self, chain: Chain) -> float:
        """Largest |z| allowed."""
        return self.well_share / math.sqrt(-chain.beta) if chain.beta < 0 else math.inf

    def unfit(self, lam: Floats) -> str:
        """Why the links of a steady motion are not to be had, "" when they are."""
        if lam.size and (lam.min() < self.lam_min or lam.max() > self.lam_max):
            links, allowed = f"{lam.min():.3g}..{lam.max():.3g}", f"{self.lam_min:.3g}..{self.lam_max:.3g}"
            return f"its links of {links} are outside {allowed}; it lacks range of lam"
        return ""

    def exceeded(self, way: Way, omega: float, tau_per_s: float) -> str:
        """What the drive of a way takes too much of, "" when nothing."""
        strongest = float(np.abs(way.epsilon).max())
        fastest = tau_per_s * float(np.abs(way.epsilon_slope + 1j * omega * way.epsilon).max())
        if strongest > self.epsilon_max:
            return f"it takes a drive of {strongest:.3g}, the amplifier gives {self.epsilon_max:.3g}; it lacks volts"
        if fastest > self.slew_per_s:
            return f"its drive changes by {fastest:.3g} per s, the amplifier's by {self.slew_per_s:.3g}; it lacks slew"
        return ""


def checked(
    chain: Chain, epsilon: complex, lam: Floats, omega: float, phasor: Complexes, limits: WayLimits, tau_per_s: float
) -> OperatingPoint:
    """The motion to go to, or from.

    Raises
    ------
    WayError
        With the argument and its value.
    """
    links, motion = np.asarray(lam, dtype=np.float64), np.asarray(phasor, dtype=np.complex128)
    if chain.rows > 1 or chain.spread is not None or not chain.law.back:
        raise WayError("chain: expected one chain of equal actuators over resistors")
    if links.shape != (chain.n - 1,) or not np.all(np.isfinite(links) & (links >= 0)):
        raise WayError(f"lam: expected {chain.n - 1} finite numbers >= 0, got {links}")
    if motion.shape != (chain.n,) or not np.isfinite(motion).all() or not motion.any():
        raise WayError(f"phasor: expected {chain.n} finite numbers that are not all 0, got {motion}")
    for name, value in (("omega", omega), ("tau_per_s", tau_per_s), ("|epsilon|", abs(epsilon))):
        if not (value > 0 and math.isfinite(value)):
            raise WayError(f"{name}: expected a finite number > 0, got {value}")
    if limits.lam_scope == "chain" and links.size and np.ptp(links) > 0:
        raise WayError(f"lam: the limits allow one for the whole chain, got {links}")
    return OperatingPoint(complex(epsilon), links, omega, motion)
