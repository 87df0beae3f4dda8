"""Samples of what stands and of ways to what comes, one after another, without an end."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from chainsim import Device
from planner import FramePlan

from ..channels import channels_of
from ..waveform.sampling import Converter, volts_of

__all__ = ["LiveWave"]

Floats = NDArray[np.float64]


class LiveWave:
    """What goes out, block after block: nothing, until the first way is put on.

    Attributes
    ----------
    position : samples that were given.
    """

    def __init__(self, device: Device) -> None:
        self._device = device
        self._rate = device.amplifier.rate_hz
        self._converter = Converter(device)
        self._channels = len(channels_of(device))
        self._plan: FramePlan | None = None
        self._settled = 0
        self._held: Floats | None = None
        self.position = 0

    @property
    def settled(self) -> bool:
        """Whether what comes next is no part of a way."""
        return self.position >= self._settled

    def placed(self, way: FramePlan) -> FramePlan:
        """The way with its times, when it begins with the next sample; `end_s` is where its pattern stands."""
        start_s = self.position / self._rate
        settled_s = start_s + (way.settled_s - way.start_s)
        return replace(way, start_s=start_s, settled_s=settled_s, end_s=settled_s)

    def ahead(self, placed: FramePlan, standing: int) -> Floats:
        """What a way that is placed would give from the next sample on, with `standing` samples of its pattern.

        Returns
        -------
        float64, shape (S, channels), volts.
        """
        stop = self._settled_at(placed) + standing
        return volts_of(self._device, placed, np.arange(self.position, stop)).T

    def begin(self, placed: FramePlan) -> None:
        """Go the way that was placed last."""
        self._plan, self._held = placed, None
        self._settled = self._settled_at(placed)

    def _settled_at(self, placed: FramePlan) -> int:
        return math.ceil(placed.settled_s * self._rate)

    def block(self, count: int) -> Floats:
        """The next samples; float64, shape (count, channels), volts, read-only."""
        volts = self._volts(count)
        self.position += count
        return volts

    def _volts(self, count: int) -> Floats:
        if self._plan is None:
            return np.zeros((count, self._channels))
        if self.settled and not any(state.moving for state in self._plan.states):
            # What stands still is worked out once.
            if self._held is None:
                one = volts_of(self._device, self._plan, np.array([self.position]))
                self._held = self._converter.round(one).T
            return np.broadcast_to(self._held, (count, self._channels))
        index = np.arange(self.position, self.position + count)
        return self._converter.round(volts_of(self._device, self._plan, index)).T
