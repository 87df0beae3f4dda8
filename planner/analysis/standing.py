"""How far patterns of standing dots may be off, by what acts on the piezos and stays the same: modes, creep, loop."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from chainsim import Device, surroundings_of

from ..operating_point import OperatingPoint
from .effects import Linearisation

__all__ = ["standing_error"]


def standing_error(device: Device, states: Sequence[OperatingPoint], held_s: float) -> float:
    """Largest deviation of an actuator of the chains that stand still, in units of full scale.

    It is the sum of what higher modes, creep and hysteresis do alone, each on a force that the others have made
    larger; known to first order, and so taken a little larger than the sum. A vibration is not looked at.

    Parameters
    ----------
    held_s : how long the forces have been held at most, seconds.
    """
    around = surroundings_of(device)
    worst = 0.0
    for state in states:
        chain = Linearisation(device.chain, state)
        if state.moving or chain.scale == 0:
            continue
        found = (
            chain.with_modes(around.modes), chain.creeping(around, device.tau_per_s, held_s),
            chain.with_hysteresis(around),
        )  # fmt: skip
        off = sum(float(np.abs(lines[0]).max()) for lines in found)
        worst = max(worst, off * (1 + off / chain.scale))
    return worst / device.full_scale if math.isfinite(worst) else math.inf
