"""How long the steps of an integration in time may be, and how far a motion may go before it has escaped."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..equations.scaled_chain import ScaledChain

__all__ = ["coarse_steps", "escape_amplitude", "steps_at"]

Floats = NDArray[np.float64]
Lanes = NDArray[np.int64]


def escape_amplitude(scaled: ScaledChain) -> float:
    """The |z| beyond which a motion counts as escaped: 50 of the farthest hilltop, or 1e9 where there is none."""
    softest = np.max(scaled.sign, initial=-np.inf, where=scaled.sign < 0)
    return 50.0 / math.sqrt(-softest) if np.isfinite(softest) else 1e9 * scaled.length


def coarse_steps(scaled: ScaledChain) -> Lanes:
    """Steps per period for transients: int64, shape (N,), eight per natural or drive period.

    Amplitude errors are then about 1e-7 at z^2 = 0.01 (chains of six, 300 periods, Q = 160).
    """
    return steps_at(scaled, np.zeros(len(scaled)))


def steps_at(scaled: ScaledChain, peak: Floats) -> Lanes:
    """The same for motions that reach z^2 + p^2 = `peak`, shape (N,): where beta > 0 they swing faster.

    Then z^4/4 is at most p^2/2, and the frequency squared is k + 3/4 z^2.
    """
    hardening = 0.75 * max(float(np.max(scaled.sign)), 0.0) * np.sqrt(2 * np.where(peak < 1e30, peak, 0.0))
    fastest = np.sqrt(np.maximum(np.max(scaled.k, axis=0) + hardening, 1.0))
    # The composition also steps backwards, where a strong damping grows.
    fastest = np.maximum(fastest, 0.5 * float(np.max(scaled.delta)))
    ratio = np.maximum(fastest * scaled.network.period / (2 * np.pi), 1.0)
    doublings = np.ceil(np.log2(ratio) - 0.5).clip(0, 40).astype(np.int64)
    steps: Lanes = 8 * 2**doublings
    return steps
