"""Which link feeds each actuator of a grid with a lam on every link, and how strong it is.

Every actuator that moves listens to one neighbour, its left or its upper one, so that the closed form of a chain's
stage holds for it (theory.md section 2.3). Actuators that nobody listens to may stay silent.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from chainsim import Chain, Device

from .grid import GridLinks
from .links import links_for

__all__ = ["routed", "tree_links"]

Floats = NDArray[np.float64]

# What it costs to pass a flat dot, which brings a stage near to its resonance, beside a raised one's 1.
FLAT = 10.0
DRIVE, LEFT, ABOVE, NOTHING = range(4)


def routed(device: Device, level: Floats, floor: float) -> Floats:
    """The levels with those flat dots that have to pass something on at `floor`, and all others silent.

    Parameters
    ----------
    level : float64, shape (rows, cols).
    """
    raised = level > floor
    source = _sources(device, np.where(raised, 1.0, FLAT))
    active = raised.copy()
    for row, col in reversed(list(np.ndindex(*level.shape))):
        if active[row, col] and source[row, col] == LEFT:
            active[row, col - 1] = True
        elif active[row, col] and source[row, col] == ABOVE:
            active[row - 1, col] = True
    return np.where(active, np.maximum(level, floor), 0.0)


def tree_links(device: Device, amplitude: Floats, floor: float, omega: float) -> GridLinks:
    """The links that hold amplitudes as `routed` gives them; NaN where no link can make a step.

    Parameters
    ----------
    amplitude : float64, shape (rows, cols), dimensionless, 0 where nothing moves.
    floor : the level of those that pass something on, dimensionless.
    """
    active = amplitude > 0
    source = _sources(device, np.where(active, np.where(amplitude > floor, 1.0, FLAT), np.inf))
    right, down = np.zeros(amplitude.shape), np.zeros(amplitude.shape)
    stage = Chain(n=2, delta=device.delta, beta=device.beta)
    for row, col in np.argwhere(active):
        if source[row, col] == LEFT:
            right[row, col] = links_for(stage, amplitude[row, [col - 1, col]], omega)[0]
        elif source[row, col] == ABOVE:
            down[row, col] = links_for(stage, amplitude[[row - 1, row], col], omega)[0]
        elif source[row, col] == NOTHING:
            right[row, col] = np.nan
    return GridLinks(right, down)


def _sources(device: Device, cost: Floats) -> NDArray[np.int64]:
    """Whom each actuator listens to, so that the way from a drive costs least; shape (rows, cols)."""
    driven = set(device.driven)
    way = np.full(cost.shape, np.inf)
    source = np.full(cost.shape, NOTHING)
    for at in np.ndindex(*cost.shape):
        ways: Iterable[tuple[float, int]] = [(0.0, DRIVE)] if at in driven else _beside(way, *at)
        cheapest = min(ways, default=(np.inf, NOTHING))
        way[at] = cheapest[0] + cost[at]
        source[at] = cheapest[1] if np.isfinite(cheapest[0]) else NOTHING
    return source


def _beside(way: Floats, row: int, col: int) -> list[tuple[float, int]]:
    left = [(float(way[row, col - 1]), LEFT)] if col else []
    return left + ([(float(way[row - 1, col]), ABOVE)] if row else [])
