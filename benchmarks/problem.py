"""The settings every contender solves, and how an error is counted."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from chainsim import Chain, Setting

__all__ = ["CHAIN", "PERIODS", "SETTLED", "median_error", "settings", "states_error"]

CHAIN = Chain(6, 6.1e-3, -1.0)
PERIODS = 300
# Drive periods from rest until a chain of six with Q = 163 is within 4e-7 of its steady state.
SETTLED = 1300


def settings(size: int) -> Setting:
    """Random settings: epsilon log-uniform in 3e-5..6e-4, lam in 3e-3..9e-3, omega in 0.985..1.015.

    The first of many are the same as few.
    """
    first, second, third = np.random.default_rng(1).uniform(size=(size, 3)).T
    return Setting.of(CHAIN, epsilon=3e-5 * 20**first, lam=(3e-3 + 6e-3 * second)[:, None], omega=0.985 + 0.03 * third)


def states_error(found: NDArray[np.float64], wanted: NDArray[np.float64]) -> NDArray[np.float64]:
    """Worst oscillator of each chain, in its phase plane, relative to its own radius; states are z then v."""
    n = found.shape[1] // 2
    apart = np.hypot(found[:, :n] - wanted[:, :n], found[:, n:] - wanted[:, n:])
    worst: NDArray[np.float64] = (apart / np.hypot(wanted[:, :n], wanted[:, n:])).max(axis=1)
    return worst


def median_error(found: NDArray[np.float64], wanted: NDArray[np.float64]) -> float:
    """Median over chains of `states_error`."""
    return float(np.median(states_error(found, wanted)))
