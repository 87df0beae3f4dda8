"""A line to a controller within this program, which plays to nobody at the pace of a clock."""

from __future__ import annotations

import time
from collections.abc import Callable

from ..protocol.virtual_controller import VirtualController

__all__ = ["LoopLine"]


class LoopLine:
    """Bytes to and from a virtual controller, as from a serial port.

    Parameters
    ----------
    wait : lets seconds pass.
    """

    def __init__(
        self, controller: VirtualController, clock: Callable[[], float], wait: Callable[[float], None] = time.sleep
    ) -> None:
        self._controller, self._clock, self._wait = controller, clock, wait

    def read(self, wait_s: float) -> bytes:
        """What the controller says; waits `wait_s` when it says nothing."""
        said = self._said()
        if said or not wait_s:
            return said
        self._wait(wait_s)
        return self._said()

    def _said(self) -> bytes:
        self._controller.tick(self._clock())
        return self._controller.outgoing()

    def write(self, data: bytes) -> None:
        """Give bytes to the controller."""
        self._controller.receive(data, self._clock())

    def close(self) -> None:
        """Nothing is left open."""
