"""The amplifier's volt and slew limits, held against every sample that is written."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from chainsim import Amplifier

from ..channels import Channel
from ..errors import LimitError

__all__ = ["LimitCheck"]

Floats = NDArray[np.float64]

# A drive planned for exactly the limit may exceed it by the rounding of its last few operations.
ROUND_OFF = 1e-12


class LimitCheck:
    """Checks blocks of one waveform in order; keeps the peaks and the last sample.

    The outputs are taken to rest at 0 V before the first sample. Slew is the difference of neighbouring
    samples times the rate, across blocks too.

    Attributes
    ----------
    samples : how many were checked.
    peak_volts : float64, shape (channels,), largest modulus so far, volts.
    peak_slew_v_per_s : largest slew of any channel so far.
    """

    def __init__(self, amplifier: Amplifier, channels: Sequence[Channel]) -> None:
        self._amplifier = amplifier
        self._channels = channels
        self._last: Floats = np.zeros(len(channels))
        self.samples = 0
        self.peak_volts: Floats = np.zeros(len(channels))
        self.peak_slew_v_per_s = 0.0

    def check(self, block: Floats) -> None:
        """Check the next samples; float64, shape (S, channels), volts.

        Raises
        ------
        LimitError
            At the first sample in time that is over a limit (or not a number).
        """
        if not len(block):
            return
        rows = block.T
        top, bottom = rows.max(axis=1), rows.min(axis=1)
        peak = np.maximum(top, -bottom)
        if not np.all(peak <= self._amplifier.volts * (1 + ROUND_OFF)):
            self._refuse_volts(block)
        moving = np.flatnonzero(top != bottom)
        steps = [np.abs(rows[:, 0] - self._last).max(), *(np.abs(np.diff(rows[m])).max() for m in moving)]
        slew = float(max(steps)) * self._amplifier.rate_hz
        if slew > self._amplifier.slew_v_per_s * (1 + ROUND_OFF):
            self._refuse_slew(block)
        self._last = np.array(rows[:, -1])
        self.samples += len(block)
        self.peak_volts = np.maximum(self.peak_volts, peak)
        self.peak_slew_v_per_s = max(self.peak_slew_v_per_s, slew)

    def _refuse_volts(self, block: Floats) -> None:
        limit = self._amplifier.volts
        sample, index = np.argwhere(~(np.abs(block) <= limit * (1 + ROUND_OFF)))[0]
        channel, value = self._channels[index], float(block[sample, index])
        time_s = (self.samples + int(sample)) / self._amplifier.rate_hz
        raise LimitError(
            f"{channel}: {value:.6g} V at {time_s:.6g} s is over the amplifier's {limit:g} V; "
            "lower full_scale or lengthen the ramp",
            channel=channel, time_s=time_s, value=value, limit=limit,
        )  # fmt: skip

    def _refuse_slew(self, block: Floats) -> None:
        rate, limit = self._amplifier.rate_hz, self._amplifier.slew_v_per_s
        slew = np.diff(block, axis=0, prepend=self._last[np.newaxis]) * rate
        sample, index = np.argwhere(np.abs(slew) > limit * (1 + ROUND_OFF))[0]
        channel, value = self._channels[index], float(slew[sample, index])
        time_s = (self.samples + int(sample)) / rate
        raise LimitError(
            f"{channel}: {value:.6g} V/s at {time_s:.6g} s is over the amplifier's {limit:g} V/s; "
            "lengthen the ramp or lower full_scale",
            channel=channel, time_s=time_s, value=value, limit=limit,
        )  # fmt: skip
