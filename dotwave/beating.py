"""What a frame makes felt that never settles: its envelope while it is shown, judged by its statistics."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from planner import AMPLITUDE_ERROR_LIMIT

__all__ = ["RowEnvelope"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

# Periods of the drive that are one look at the envelope.
LOOK = 4
# What the loudest may be off, relative to it.
LOUD_OFF = 0.1


class RowEnvelope:
    """The amplitudes of one row, collected block by block.

    Parameters
    ----------
    rate : of the drive in radians per second.
    length_s : of the frame while its pattern stands.
    cols : actuators.
    """

    def __init__(self, rate: float, length_s: float, cols: int) -> None:
        self._rate, self._look_s = rate, LOOK * 2 * np.pi / rate
        looks = int(length_s / self._look_s)
        self._sums: Complexes = np.zeros((looks + 1, cols), dtype=np.complex128)
        self._counts = np.zeros(looks + 1)

    def take(self, t_s: Floats, z: Floats) -> None:
        """Collect samples at seconds from the start of the frame, float64, shape (S,) and (S, cols)."""
        at = np.minimum((t_s / self._look_s).astype(np.intp), len(self._counts) - 1)
        np.add.at(self._sums, at, z * np.exp(-1j * self._rate * t_s)[:, None])
        np.add.at(self._counts, at, 1.0)

    def judged(self, loud: Floats, beats: tuple[float, float], full_scale: float) -> tuple[Floats, Floats]:
        """The loudest of each actuator, in units of full scale, and how far off it all is.

        An error at the limit for amplitudes means that the loudest, the depth or the period is off by as much as it may
        be.

        Parameters
        ----------
        loud : float64, shape (cols,), the loudest that is aimed at, dimensionless.
        beats : depth and period in seconds that are asked.
        """
        from planner import beats_of, beats_off

        if len(self._counts) < 10:
            nothing = np.full(len(loud), np.nan)
            return nothing, nothing
        # The last look is not whole.
        amplitude = 2 * np.abs(self._sums[:-1] / np.maximum(self._counts[:-1, None], 1.0))
        found = beats_of(amplitude, self._look_s)
        off = float(beats_off(found, *beats))
        each = np.maximum(np.abs(found.loud / np.maximum(loud, 1e-300) - 1) / LOUD_OFF, off)
        return found.loud / full_scale, AMPLITUDE_ERROR_LIMIT * each
