"""What the skin takes of a carrier that is too fast for it: the square of its envelope, at the frequencies it feels."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .device import Device, Modulation

__all__ = ["beats_of", "felt_modulation", "sideband_gain", "skin_gain"]

Floats = NDArray[np.float64]

# The threshold of vibration under large contactors: flat to 40 Hz, from there 12 dB an octave down to 250 Hz (Verrillo
# 1963, as told by Gescheider and Verrillo, doi 10.1007/978-1-4613-3039-4_10). The same slope beyond it is assumed.
FLAT_HZ, BEST_HZ, DB_PER_OCTAVE = 40.0, 250.0, 12.0
# Beyond this nothing is counted as felt, and of slow beats no more harmonics than these.
LAST_HZ, MOST_BEATS = 1000.0, 8


def skin_gain(hz: ArrayLike) -> Floats:
    """How strongly the skin takes a vibration of one size, over the frequency it takes best.

    Parameters
    ----------
    hz : frequencies, any shape.

    Returns
    -------
    float64, of that shape, from 0 to 1.
    """
    octaves = np.abs(np.log2(np.maximum(np.asarray(hz, dtype=np.float64), FLAT_HZ) / BEST_HZ))
    return np.asarray(10 ** (-DB_PER_OCTAVE * octaves / 20))


def beats_of(modulation: Modulation) -> int:
    """How many harmonics of a modulation are counted as felt: two, or all up to 1000 Hz, at most eight."""
    return int(np.clip(LAST_HZ // modulation.hz, 2, MOST_BEATS))


def felt_modulation(square: NDArray[np.complex128], modulation: Modulation, full_scale: float) -> Floats:
    """The felt level of envelopes: their square without its mean, heard through the skin.

    Radiation pressure goes with the energy of a sound, so with the square of a carrier's amplitude. Harmonics add up
    as powers do. Level 1 is what an envelope of the asked depth makes felt whose peak is `full_scale`.

    Parameters
    ----------
    square : complex128, shape (beats, ...), the amplitudes of the envelope's square at 1, 2, .. times `modulation.hz`.
    full_scale : dimensionless amplitude.

    Returns
    -------
    float64, shape (...).
    """
    depth, beats = modulation.depth, len(square)
    gain = skin_gain(modulation.hz * np.arange(1, beats + 1))
    plain = np.zeros(beats)
    plain[:2] = np.array([2 * depth, depth**2 / 2]) * (full_scale / (1 + depth)) ** 2
    return np.asarray(np.linalg.norm(np.abs(square.T) * gain, axis=-1).T / np.linalg.norm(plain * gain))


def sideband_gain(device: Device, hz: float) -> float:
    """What a resonance leaves of a modulation of its drive: the depth of a single actuator's envelope over the drive's.

    Small motions at resonance; the half width of the resonance is ``delta f0 / 2``.
    """
    return float(1 / np.hypot(1.0, 2 * hz / (device.delta * device.f0_hz)))
