"""What every way of making patterns on a device supplies."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np
from numpy.typing import NDArray

from chainsim import Device

from .operating_point import OperatingPoint
from .plan import Ramp

__all__ = ["Strategy"]

Floats = NDArray[np.float64]


class Strategy(ABC):
    """One way to make amplitude patterns on one device. This text is the guide to writing another.

    A newcomer supplies `states`, what chains hold for wanted targets, and `ramps`, how chains get from one
    state to another; both for many chains at once, pure functions of their arguments, so that their
    results can be kept. `stand_in` says which target a chain holds while nothing is wanted of it;
    `ramp_s` is an upper bound of its ramps.
    """

    def __init__(self, device: Device) -> None:
        self.device = device

    @property
    @abstractmethod
    def ramp_s(self) -> float:
        """Longest ramp in seconds."""

    @abstractmethod
    def states(self, targets: Floats) -> list[OperatingPoint]:
        """What chains hold for `targets`, float64, shape (P, n), in units of full scale."""

    @abstractmethod
    def ramps(self, before: list[OperatingPoint], after: list[OperatingPoint]) -> list[Ramp | None]:
        """How chains get from state to state; None where nothing has to change."""

    @abstractmethod
    def held(self, target: Floats, started: bool) -> Floats:
        """The target a chain really holds for a wish of shape (n,); `started`: it is not at rest."""

    def note(self) -> str:
        """One sentence on what the device lacks when states come out unreachable."""
        return ""
