"""What chains hold whose actuators act on each other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Self

import numpy as np

from chainsim import Device

from ..family import PatternFamily
from ..operating_point import OperatingPoint
from ..targets import ChainTarget, WaveTarget
from .joint_fit import with_floor
from .wave_state import Waves

__all__ = ["Joint"]


class Joint(Waves):
    """Waves and amplitudes; with a lam on every link flat dots idle where the links hold them."""

    def __init__(self, device: Device, contrast_db: float) -> None:
        super().__init__(device)
        self._contrast_db = contrast_db

    @classmethod
    def of(
        cls, device: Device, contrast_db: float, kinds: Sequence[Device] = (), whole: PatternFamily | None = None
    ) -> Self:
        """The family on a device."""
        return cls(device, contrast_db)

    def _point(self, target: ChainTarget) -> OperatingPoint:
        linked = self.device.coupling.scope == "link"
        if linked and isinstance(target, WaveTarget) and np.count_nonzero(~np.isnan(target.phases)) <= 1:
            floor = with_floor(self.device, target.levels, self._contrast_db)
            target = replace(target, amplitude=tuple(floor.tolist()))
        return super()._point(target)
