"""What a chain that is driven with a modulation really makes felt: the full equations, from rest."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from chainsim import Device, Modulation, beats_of, felt_modulation

from ..drive import play
from ..operating_point import OperatingPoint
from ..plan import Ramp

__all__ = ["felt_of"]

Floats = NDArray[np.float64]

# Beats that are listened to once the pattern stands.
LISTENED = 2


def felt_of(device: Device, modulation: Modulation, point: OperatingPoint, ramp: Ramp) -> Floats:
    """The felt levels of a chain after its way in; float64, shape (n,), NaN where it left its well."""
    rate = device.amplifier.rate_hz
    first = math.ceil(ramp.duration_s * rate)
    t_s = np.arange(first + math.ceil(LISTENED * rate / modulation.hz)) / rate
    z = play(device, point, ramp, t_s * device.tau_per_s)[first:]
    beats = beats_of(modulation)
    turns = 2 * np.pi * modulation.hz * np.outer(t_s[first:], np.arange(beats + 1))
    basis = np.concatenate([np.cos(turns), np.sin(turns[:, 1:])], axis=1)
    found = np.linalg.lstsq(basis, 2 * z**2)[0]
    square = found[1 : beats + 1] - 1j * found[beats + 1 :]
    return felt_modulation(square, modulation, device.full_scale)
