"""What is felt of a pattern that travels while it is on its way, held against the way it is to go."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from chainsim import Device
from drivers import FrameMark
from encoders import crossing

__all__ = ["PassingFit"]

Floats = NDArray[np.float64]

# Shares of a way at which it is looked at; before and after them next to nothing changes.
SHARES = (0.25, 0.375, 0.5, 0.625, 0.75)
# Periods of the resonance that each look takes.
PERIODS = 2


class PassingFit:
    """Levels at five moments of a way: least squares of what is felt and of its slope over two periods around each.

    What is wanted there is fitted in the same manner, so that bends of the way make no difference.
    """

    def __init__(self, device: Device, before: FrameMark, mark: FrameMark, rate_hz: int) -> None:
        self._device, self._rate_hz = device, rate_hz
        self._before, self._mark = before.target, mark.target
        self._start_s, self._length_s = mark.start_s, mark.end_s - mark.start_s
        # A row that goes to rest moves as it did before.
        self._omega = np.where(mark.omega > 0, mark.omega, before.omega)
        half = PERIODS / device.f0_hz / 2
        centres = [mark.start_s + share * self._length_s for share in SHARES]
        self._windows = [(round((one - half) * rate_hz), round((one + half) * rate_hz), one) for one in centres]
        self._gram = np.zeros((len(SHARES), device.rows, 4, 4))
        self._load = np.zeros((len(SHARES), device.rows, 4, device.cols))
        self._wanted = [(np.zeros((2, 2)), np.zeros(2)) for _ in SHARES]

    def take(self, index: NDArray[np.intp], z: Floats) -> None:
        """Collect the samples of a block, displacements of shape (S, rows, cols), that belong to the looks."""
        for number, (first, stop, centre) in enumerate(self._windows):
            inside = slice(*np.searchsorted(index, [first, stop]))
            if inside.start == inside.stop:
                continue
            time_s = index[inside] / self._rate_hz
            # In units of the window, which is well conditioned.
            since = (time_s - centre) * self._device.f0_hz / PERIODS
            line, nothing = np.stack([np.ones_like(since), since]), np.zeros_like(since)
            gram, load = self._wanted[number]
            gram += line @ line.T
            load += line @ crossing((time_s - self._start_s) / self._length_s)
            for row, omega in enumerate(self._omega):
                angle = omega * self._device.tau_per_s * time_s
                wave = np.stack([np.cos(angle), np.sin(angle)]) if omega else np.stack([line[0], nothing])
                basis = np.concatenate([wave, since * wave])
                self._gram[number, row] += basis @ basis.T
                self._load[number, row] += basis @ z[inside, row]

    def error(self) -> float:
        """The largest deviation of any actuator from its way, in units of full scale."""
        worst = 0.0
        for number, (gram, load) in enumerate(self._wanted):
            done = float(np.linalg.lstsq(gram, load)[0][0])
            wanted = self._before + (self._mark - self._before) * done
            for row, omega in enumerate(self._omega):
                parts = np.linalg.lstsq(self._gram[number, row], self._load[number, row])[0] / self._device.full_scale
                felt = np.hypot(parts[0], parts[1]) if omega else parts[0]
                worst = max(worst, float(np.abs(felt - wanted[row]).max()))
        return worst
