"""Surroundings as the kernel takes them: plays, modes and creeps, and what the amplifier makes of common volts."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..effects.effects import Creep, Play
from ..model.device import Device
from ..model.parts import Surroundings
from .lanes import PLAYS

__all__ = ["CREEP_DECADES", "CommonAmplifier", "creep_of", "plays_of"]

Floats = NDArray[np.float64]

CREEP_DECADES = 3
# The loop of a piezo saturates exponentially. The plays part such a curve in four, finer where forces are small; edges
# in units of the force at which it bends, saturation over hysteresis.
_EDGES = np.array([0.0, 0.1, 0.4, 1.2, np.inf])


def plays_of(around: Surroundings) -> Play:
    """Four plays whose first loading is e - h, h following ``saturation (1 - exp(-hysteresis e/saturation))``.

    Share of small forces and saturation are exact, the curve between them is a broken line. Where the loop has no end,
    or is none, h is `hysteresis` times e, and the plays have no weight.
    """
    if not around.hysteresis or math.isinf(around.largest_loop):
        return Play((0.0,) * PLAYS, (0.0,) * PLAYS, 1 - around.hysteresis)
    left = np.exp(-_EDGES)
    weight = left[:-1] - left[1:]
    # (edge + 1) exp(-edge), with its limit 0 at infinity.
    moment = (np.append(_EDGES[:-1], 0.0) + 1) * left
    radius = (moment[:-1] - moment[1:]) / weight * around.largest_loop / around.hysteresis
    shares = around.hysteresis * weight
    return Play(tuple(radius.tolist()), tuple(shares.tolist()), 1 - around.hysteresis)


def creep_of(around: Surroundings, tau_per_s: float) -> Creep | None:
    """Creep in tau, or None."""
    first = around.creep_first_s * tau_per_s
    if not around.creep_per_decade:
        return None
    return Creep(around.creep_per_decade, first, first * 10.0**CREEP_DECADES)


class CommonAmplifier:
    """Converter and bandwidth, on the volts that all devices share; block by block.

    The bandwidth is of first order, exact for volts that are linear between samples, and begins at the first of them.
    """

    def __init__(self, device: Device, around: Surroundings) -> None:
        bits = around.converter_bits
        self._step = 0.0 if bits is None else device.amplifier.volts / (2 ** (bits - 1) - 1)
        self._kept, self._old, self._new = 0.0, 0.0, 1.0
        if around.bandwidth_hz is not None:
            decay = 2 * math.pi * around.bandwidth_hz / device.amplifier.rate_hz
            self._kept = math.exp(-decay)
            self._old = (1 - self._kept) / decay - self._kept
            self._new = 1 - (1 - self._kept) / decay
        self._given: Floats | None = None
        self._out: Floats | None = None

    def advance(self, volts: Floats) -> Floats:
        """What comes out: float64, shape (S, channels), volts."""
        from scipy.signal import lfilter

        if self._step:
            volts = self._step * np.rint(volts / self._step)
        if not self._kept or not len(volts):
            return volts
        if self._given is None or self._out is None:
            self._given = self._out = volts[0]
        state = self._old * self._given + self._kept * self._out
        made, _ = lfilter([self._new, self._old], [1.0, -self._kept], volts, axis=0, zi=state[None])
        self._given, self._out = volts[-1], made[-1]
        return np.asarray(made)
