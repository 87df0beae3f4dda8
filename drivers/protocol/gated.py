"""Samples that nobody has checked before: each block held against the gate, then sent after the events within it."""

from __future__ import annotations

from collections.abc import Sequence
from heapq import merge

import numpy as np
from numpy.typing import NDArray

from chainsim import Device

from ..channels import channels_of
from ..safety import Gate, GateLimits, check_links
from ..waveform.coupling import CouplingEvent
from .messages import SamplesMessage
from .outgoing import Coder, Message, block_of, link_coupling
from .playout import Event
from .replies import Capabilities

__all__ = ["GatedStream"]


class GatedStream:
    """What goes to a controller while it is still being made, in order.

    Parameters
    ----------
    device : what its blocks are for.
    found : the controller.
    limits : of every sample and link.
    refused : how a refusal begins.

    Attributes
    ----------
    gate : what the samples went through.
    block : samples of a packet.
    """

    def __init__(self, device: Device, found: Capabilities, limits: GateLimits, *, refused: str) -> None:
        channels = channels_of(device)
        self.gate = Gate(limits, channels, found.rate_hz, refused=refused)
        self.block = block_of(found)
        self._coder = Coder(channels, found.full_volts)
        self._found, self._limits, self._refused = found, limits, refused
        self._events: list[Event] = []
        self._first = 0

    def expect(self, events: Sequence[Event], links: Sequence[CouplingEvent]) -> None:
        """What happens at samples to come, each by time; of one sample, `events` go before `links`.

        Raises
        ------
        GateRefusal
            When a link is over its limit: nothing of these is sent.
        """
        check_links(links, self._limits, refused=self._refused)
        moved = (link_coupling(link, self._found) for link in links)
        self._events = list(merge(self._events, events, moved, key=lambda event: event.at))

    def messages(self, volts: NDArray[np.float64]) -> list[Message]:
        """The next samples, float64, shape (S, channels), volts, after the events within them.

        Raises
        ------
        GateRefusal
            When one is over a limit: nothing of the block is sent.
        """
        self.gate.check(volts)
        first, self._first = self._first, self._first + len(volts)
        due = sum(event.at < self._first for event in self._events)
        events, self._events = self._events[:due], self._events[due:]
        return [*events, SamplesMessage(first, self._coder.codes(volts))]
