"""Curves through the nodes of a ramp: cubic Hermite where slopes are given, straight lines where not."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

__all__ = ["curve"]

Floats = NDArray[np.float64]
Numbers = TypeVar("Numbers", NDArray[np.float64], NDArray[np.complex128])


def curve(at_s: Floats, t_s: Floats, values: Numbers, slopes: Numbers | None) -> Numbers:
    """Values between nodes; before the first and after the last node, that node's value.

    Parameters
    ----------
    at_s : float64, shape (S,), seconds. t_s : float64, shape (K,), the nodes, not falling.
    values : float64 or complex128, shape (K,), at the nodes. slopes : the same per second, or None for
        straight lines.

    Returns
    -------
    Of the dtype of `values`, shape (S,).
    """
    if slopes is None or len(t_s) == 1:
        straight: Numbers = np.interp(at_s, t_s, values)
        return straight
    k = np.clip(np.searchsorted(t_s, at_s, side="right") - 1, 0, len(t_s) - 2)
    width, rise = np.diff(t_s), np.diff(values)
    begin, end = width * slopes[:-1], width * slopes[1:]
    # Hermite in powers of s = (t - t_k) / width; two nodes at one time (a jump) leave no room to divide by.
    s = np.clip((at_s - t_s[k]) / np.where(width > 0, width, 1.0)[k], 0.0, 1.0)
    square, cube = 3 * rise - 2 * begin - end, begin + end - 2 * rise
    smooth: Numbers = ((cube[k] * s + square[k]) * s + begin[k]) * s + values[:-1][k]
    return smooth
