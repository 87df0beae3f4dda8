"""What every way of making patterns on a device supplies, and which one a device gets."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from chainsim import Closure, Device

from .plan import ChainState, Ramp

__all__ = ["Strategy", "strategy_for"]

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
    def states(self, targets: Floats) -> list[ChainState]:
        """What chains hold for `targets`, float64, shape (P, n), in units of full scale."""

    @abstractmethod
    def ramps(self, before: list[ChainState], after: list[ChainState]) -> list[Ramp | None]:
        """How chains get from state to state; None where nothing has to change."""

    @abstractmethod
    def held(self, target: Floats, started: bool) -> Floats:
        """The target a chain really holds for a wish of shape (n,); `started`: it is not at rest."""

    def note(self) -> str:
        """One sentence on what the device lacks when states come out unreachable."""
        return ""


def strategy_for(
    device: Device, contrast_db: float, kinds: Sequence[Device] = (), whole: Strategy | None = None
) -> Strategy | None:
    """The strategy for amplitude patterns that `device` offers most with; None where it has none for any pattern.

    A bias per actuator makes any pattern statically; a lam per link, or no coupling at all, any pattern by
    vibration; anything else makes only waves.

    Parameters
    ----------
    kinds : the chains of a device whose chains have numbers of their own, each as a device. whole : the strategy of
        such a device when `device` is one of them.
    """
    if device.bias == "actuator":
        from .levels.deflection import Deflection

        return Deflection(device)
    if device.chain_length == 1 or (device.coupling.scope == "link" and device.coupling.closure is Closure.OPEN):
        from .levels.vibration import Vibration

        return Vibration(device, contrast_db, kinds, whole if isinstance(whole, Vibration) else None)
    return None
