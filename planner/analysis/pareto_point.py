"""One way to make a frame, what it costs, and which of many no other beats."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chainsim import ActuatorSpread

from ..errors import PlanError

__all__ = ["SIGMA", "ParetoError", "ParetoFront", "ParetoPoint", "front_of"]

Floats = NDArray[np.float64]

SIGMA = ActuatorSpread(frequency=0.01)
# Differences below this share, or this size (time, drive, error, spread, gain), are none: a front of measured numbers
# would otherwise keep everything.
ALIKE = 0.02
RESOLUTION = np.array([0.0, 1e-3, 1e-3, 1e-3, 0.0])


class ParetoError(PlanError, ValueError):
    """A frame cannot be traded.

    Examples: bars that walk; waves round a ring; amplitudes that one lam cannot make; nothing that is felt.
    """


@dataclass(frozen=True)
class ParetoPoint:
    """One way to make a frame.

    Attributes
    ----------
    omega : drive frequency over f0, 0 for deflections.
    ramp_s : length of the way in.
    contrast_db : of raised and unraised dots; infinite where unraised ones rest.
    error : worst deviation from the wish after the way in, unraised dots included, in units of full scale.
    made : the same from what the settings were made for, with the unraised dots at their level.
    drive : peak of the drive or of any bias, on the way and after it, over the amplifier's.
    noise_gain : as in `Margins`.
    spread : deviation that 1 % spread (1 sigma) of the natural frequencies makes at the worst actuator, full scale.
    """

    omega: float
    ramp_s: float
    contrast_db: float
    error: float
    made: float
    drive: float
    noise_gain: float
    spread: float

    def as_dict(self) -> dict[str, Any]:
        """Plain JSON types; null where not finite."""
        return {name: value if math.isfinite(value) else None for name, value in vars(self).items()}


@dataclass(frozen=True)
class ParetoFront:
    """The points no other beats in everything, the quickest first, of `tried`; `unfit` were beyond the limits."""

    device: str
    points: tuple[ParetoPoint, ...]
    tried: int
    unfit: int

    def as_dict(self) -> dict[str, Any]:
        """Plain JSON types."""
        return {
            "device": self.device, "tried": self.tried, "unfit": self.unfit,
            "points": [point.as_dict() for point in self.points],
        }  # fmt: skip


def front_of(points: Sequence[ParetoPoint]) -> tuple[ParetoPoint, ...]:
    """Those that none is as good as in everything, but for `ALIKE` and `RESOLUTION`; the quickest first."""
    # In this order no later point can be better in everything than an earlier one.
    costs = sorted(
        ((one.ramp_s, one.drive, one.error, one.spread, one.noise_gain), at) for at, one in enumerate(points)
    )
    kept: list[tuple[Floats, int]] = []
    for cost, at in costs:
        here = (1 + ALIKE) * np.array(cost) + RESOLUTION
        if not any(np.all(other <= here) for other, _ in kept):
            kept.append((np.array(cost), at))
    return tuple(points[at] for _, at in kept)
