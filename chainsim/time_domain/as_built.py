"""A device actuator by actuator: what was measured where it was, else the profile."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..model.device import Device
from .integrate import GridIntegrator

__all__ = ["AsBuilt"]

Floats = NDArray[np.float64]


class AsBuilt:
    """What the device is made of: float64, shape (rows, cols), or a number for all actuators where none was measured.

    Attributes
    ----------
    stiffness, delta, beta : of every oscillator, as in `Chain`.
    drive_per_volt : dimensionless force per volt, shape (rows, cols); counts for the first actuator of each chain.
    lam_gain : what a link makes of the lam it is set to; counts for all but the first.
    """

    def __init__(self, device: Device) -> None:
        self._device = device
        self.stiffness: Floats | float = 1.0
        self.delta: Floats | float = device.delta
        self.beta: Floats | float = device.beta
        self.lam_gain: Floats | float = 1.0
        shape, n = (device.rows, device.cols), device.chain_length
        self.drive_per_volt = np.full(shape, device.epsilon_per_volt)
        if not device.actuators:
            return
        places = [(row, index) for row in range(device.rows) for index in range(device.chains_per_row)]
        chains = [device.chain_at(*place) for place in places]

        def grid(each: Iterable[ArrayLike]) -> Floats:
            return np.concatenate([np.broadcast_to(one, n) for one in each]).reshape(shape)

        self.stiffness = grid(chain.stiffness for chain in chains)
        self.delta, self.beta = grid(chain.deltas for chain in chains), grid(chain.betas for chain in chains)
        self.lam_gain = grid(np.append(1.0, device.lam_gain(*place)) for place in places)
        self.drive_per_volt = grid(device.drive_per_volt(*place) for place in places)

    def integrator(self, rate_hz: float) -> GridIntegrator:
        """The whole grid at rest, to be moved under `rate_hz` samples a second."""
        device = self._device
        return GridIntegrator(
            shape=(device.rows, device.cols),
            chain_length=device.cols if device.grid else device.chain_length,
            down=device.grid,
            delta=self.delta,
            beta=self.beta,
            stiffness=self.stiffness,
            ring=device.chain.law.closed,
            both_ways=device.chain.law.both_ways,
            dtau=device.tau_per_s / rate_hz,
        )
