"""What a controller's output makes felt, while it goes out: the full equations, integrated block by block."""

from __future__ import annotations

import math
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from chainsim import AsBuilt, Device

from ..channels import Role, channels_of
from .playout import OutputBlock

__all__ = ["FeltGrid", "GridMotion", "ProfileMotion", "VoltForces", "nominal_per_volt"]

Floats = NDArray[np.float64]

PERIODS = 4  # of the resonance, over which a level is taken


class GridMotion(Protocol):
    """A grid that moves under what goes out."""

    def move(self, block: OutputBlock) -> Floats:
        """Move through the samples of `block`; z at them, float64, shape (S, rows, cols)."""
        ...


class VoltForces:
    """What volts and links of a controller are to the actuators of a device.

    Parameters
    ----------
    per_volt : float64, shape (channels,), dimensionless force of each channel.
    lam_gain : what a link makes of the lam it is set to, float64, shape (rows, cols), or one number.
    """

    def __init__(self, device: Device, per_volt: Floats, lam_gain: Floats | float) -> None:
        self._device = device
        self._per_volt = per_volt
        self._lam_gain = lam_gain
        self._places = [(channel.index, channel.row, channel.col or 0) for channel in channels_of(device)]

    def force(self, block: OutputBlock) -> Floats:
        """Dimensionless force on every actuator, float64, shape (S, rows, cols)."""
        force = np.zeros((len(block.volts), self._device.rows, self._device.cols))
        for index, row, col in self._places:
            force[:, row, col] += block.volts[:, index] * self._per_volt[index]
        return force

    def lam(self, block: OutputBlock) -> Floats:
        """Links as they are, float64, shape (S, rows, cols); that which closes a ring is set with its first."""
        lam, n = block.lam, self._device.chain_length
        if self._device.chain.law.closed and n > 1:
            lam = lam.copy()
            lam[:, :, ::n] = lam[:, :, 1::n]
        return lam * self._lam_gain


class ProfileMotion:
    """The grid of a device as its profile says.

    Parameters
    ----------
    device : the hardware.
    rate_hz : samples per true second.
    """

    def __init__(self, device: Device, rate_hz: float) -> None:
        built = AsBuilt(device)
        self._forces = VoltForces(device, nominal_per_volt(device), built.lam_gain)
        self._grid = built.integrator(rate_hz)

    def move(self, block: OutputBlock) -> Floats:
        """As `GridMotion`."""
        return self._grid.advance(self._forces.force(block), self._forces.lam(block))


class FeltGrid:
    """What of a grid's motion is felt.

    Parameters
    ----------
    device : the hardware.
    rate_hz : samples per true second.
    motion : of the grid; None: as the device's profile says.
    """

    def __init__(self, device: Device, rate_hz: float, motion: GridMotion | None = None) -> None:
        self._device = device
        self._keep = max(8, math.ceil(PERIODS * rate_hz / device.f0_hz))
        self._recent: Floats = np.zeros((self._keep, device.rows, device.cols))
        self._motion = motion or ProfileMotion(device, rate_hz)

    def take(self, block: OutputBlock) -> Floats:
        """Move through the samples of `block`; z at them, float64, shape (S, rows, cols)."""
        z = self._motion.move(block)
        self._recent = np.concatenate([self._recent, z])[-self._keep :]
        return z

    def levels(self) -> Floats:
        """What is felt now in units of full scale: mean of a bias device, else amplitude; shape (rows, cols)."""
        if self._device.bias == "actuator":
            level = np.abs(self._recent.mean(axis=0))
        else:
            level = math.sqrt(2) * self._recent.std(axis=0)
        return np.asarray(level / self._device.full_scale)


def nominal_per_volt(device: Device) -> Floats:
    """Dimensionless force per volt of each channel, by the profile; float64, shape (channels,)."""
    drives = AsBuilt(device).drive_per_volt
    return np.array(
        [
            drives[channel.row, channel.col or 0] if channel.role is Role.DRIVE else device.bias_per_volt
            for channel in channels_of(device)
        ]
    )
