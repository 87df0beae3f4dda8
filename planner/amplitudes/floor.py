"""At which levels the unraised dots of a vibrating chain idle."""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import NDArray

__all__ = ["EQUAL", "LOWER", "idle_profiles"]

Floats = NDArray[np.float64]

# The lower of the two levels an unraised dot may take, in units of the floor: half of it, or the same.
LOWER, EQUAL = 0.5, 1.0
# Up to so many unraised dots every mix of levels is offered.
MOST_MIXED = 8


def idle_profiles(target: Floats, floor: float, lower: float) -> Floats:
    """Profiles that differ in how deep the unraised dots of `target` idle: at the floor, or at `lower` times that.

    An unraised dot before a raised one stays at the floor: a step up by twice the contrast would bring its
    stage's resonance too near the drive.

    Parameters
    ----------
    target : float64, shape (n,), in units of full scale.

    Returns
    -------
    float64, shape (choices, n); the first has every dot at the floor, the last as many as possible below.
    """
    unraised = target < floor
    if lower == EQUAL:
        return np.maximum(target, floor)[None, :]
    free = np.flatnonzero(unraised & np.append(unraised[1:], True))
    if len(free) > MOST_MIXED:
        mixes = np.array([np.ones(len(free)), np.where(np.arange(len(free)) % 2 == 0, 1.0, lower)])
    else:
        mixes = np.array(list(product((1.0, lower), repeat=len(free))))
    profiles = np.repeat(np.maximum(target, floor)[None, :], len(mixes), axis=0)
    profiles[:, free] = mixes * floor
    return profiles
