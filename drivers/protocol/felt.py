"""What a controller's output makes felt, while it goes out: the full equations, integrated block by block."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from chainsim import AsBuilt, Device

from ..channels import Role, channels_of
from .playout import OutputBlock

__all__ = ["FeltGrid"]

Floats = NDArray[np.float64]

PERIODS = 4  # of the resonance, over which a level is taken


class FeltGrid:
    """The grid of a device under the volts that go out.

    Parameters
    ----------
    device : the hardware.
    rate_hz : samples per true second.
    """

    def __init__(self, device: Device, rate_hz: float) -> None:
        self._device = device
        self._channels = channels_of(device)
        self._keep = max(8, math.ceil(PERIODS * rate_hz / device.f0_hz))
        self._recent: Floats = np.zeros((self._keep, device.rows, device.cols))
        self._built = AsBuilt(device)
        self._grid = self._built.integrator(rate_hz)

    def take(self, block: OutputBlock) -> None:
        """Move through the samples of `block`."""
        device = self._device
        force = np.zeros((len(block.volts), device.rows, device.cols))
        for channel in self._channels:
            row, col = channel.row, channel.col or 0
            driven = channel.role is Role.DRIVE
            per_volt = self._built.drive_per_volt[row, col] if driven else device.bias_per_volt
            force[:, row, col] += block.volts[:, channel.index] * per_volt
        z = self._grid.advance(force, block.lam * self._built.lam_gain)
        self._recent = np.concatenate([self._recent, z])[-self._keep :]

    def levels(self) -> Floats:
        """What is felt now in units of full scale: mean of a bias device, else amplitude; shape (rows, cols)."""
        if self._device.bias == "actuator":
            level = np.abs(self._recent.mean(axis=0))
        else:
            level = math.sqrt(2) * self._recent.std(axis=0)
        return np.asarray(level / self._device.full_scale)
