"""The nearest amplitudes that one lam and one drive can make, small motions."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from chainsim import Closure, Device

__all__ = ["Geometric", "nearest_geometric"]

Floats = NDArray[np.float64]

RATIOS = 400


class Geometric(NamedTuple):
    """Amplitudes ``first ratio^m``."""

    first: float
    ratio: float


def nearest_geometric(device: Device, target: Floats, most: float) -> Geometric:
    """The geometric amplitudes nearest to a target in least squares.

    With one lam and one drive a chain's small amplitudes are geometric, for any closure: A_m / A_{m-1} =
    lam / (kappa + lam + i delta omega) is the same at every stage. The ratio is at most lam / (delta omega), and
    at most 1 round a ring, which would otherwise grow by itself.

    Parameters
    ----------
    target : float64, shape (n,).
    most : the largest amplitude allowed, in the same unit.
    """
    steepest = device.coupling.lam.max / (device.delta * device.omega.min)
    if device.coupling.closure is Closure.RING:
        steepest = min(1.0, steepest)
    # 1 itself is among them: equal amplitudes are the commonest wish.
    ratios = np.append(np.linspace(0.0, steepest, RATIOS), min(1.0, steepest))
    shapes = ratios[:, None] ** np.arange(device.chain_length)
    heights = np.clip(shapes @ target / np.sum(shapes**2, axis=1), 0.0, most / shapes.max(axis=1))
    best = int(np.argmin(np.sum((heights[:, None] * shapes - target) ** 2, axis=1)))
    return Geometric(float(heights[best]), float(ratios[best]))
