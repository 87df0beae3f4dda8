"""How a carrier swells in each row of a frame: the square of its motion, at the beats that the skin feels."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from chainsim import Device, beats_of, felt_modulation

__all__ = ["Swelling"]

Floats = NDArray[np.float64]


class Swelling:
    """Least squares of 1 and of the beats over twice the square of motions: its carrier averages out.

    Nothing is known here of the carrier, its tones or its links.
    """

    def __init__(self, device: Device, rate_hz: int) -> None:
        assert device.modulation is not None
        self._device, self._modulation, self._rate_hz = device, device.modulation, rate_hz
        size = 1 + 2 * beats_of(self._modulation)
        self._gram, self._load = np.zeros((size, size)), np.zeros((size, device.rows, device.cols))

    def take(self, index: NDArray[np.intp], z: Floats) -> None:
        """Collect samples; `z` of shape (S, rows, cols)."""
        turns = 2 * np.pi * self._modulation.hz * np.arange(1, 1 + beats_of(self._modulation))
        angle = np.multiply.outer(turns, index / self._rate_hz)
        basis = np.concatenate([np.ones((1, len(index))), np.cos(angle), np.sin(angle)])
        self._gram += basis @ basis.T
        self._load += np.tensordot(basis, 2 * z**2, 1)

    def felt(self) -> Floats:
        """The felt levels, float64, shape (rows, cols), in units of full scale; NaN where they cannot be told."""
        beats = beats_of(self._modulation)
        load = self._load.reshape(len(self._gram), -1)
        known = np.isfinite(load).all(axis=0)
        parts = np.linalg.lstsq(self._gram, np.where(known, load, 0.0))[0]
        square = parts[1 : 1 + beats] - 1j * parts[1 + beats :]
        felt = felt_modulation(square, self._modulation, self._device.full_scale)
        return np.where(known, felt, np.nan).reshape(self._load.shape[1:])
