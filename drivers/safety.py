"""The safety gate: what actuators and amplifiers bear, held against every sample before a byte leaves."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from copy import copy
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from chainsim import Device

from .channels import Channel
from .errors import DriverError
from .formats.samples import SampleReader
from .waveform.coupling import CouplingEvent
from .waveform.manifest import Manifest

__all__ = ["Gate", "GateLimits", "GateRefusal", "GateReport", "check_links", "pass_gate"]

Floats = NDArray[np.float64]

BLOCK = 4096
ROUND_OFF = 1e-6  # a file of float32 or 24-bit samples rounds what was planned for exactly the limit
WINDOW_PARTS = 4
REFUSED = "refused, nothing was sent"


@dataclass(frozen=True)
class GateLimits:
    """What must not be exceeded.

    Attributes
    ----------
    volts : modulus.
    slew_v_per_s : change between neighbouring samples times the rate; before the first sample and after the last the
        outputs are at 0 V.
    dc_volts : modulus of the mean over any window.
    duty : share of any window above `duty_level` of `volts`.
    current_a : capacitance times slew, one channel.
    supply_a : the same, all channels together.
    energy_j : heat in one actuator in any window, loss tangent times the energy that goes in and out of it.
    window_s : length of the windows, which begin every quarter of it; time outside the waveform counts as 0 V.
    capacitance_f, loss : of one actuator.
    lam_max : of every link.
    """

    volts: float
    slew_v_per_s: float
    dc_volts: float
    duty: float
    current_a: float
    supply_a: float
    energy_j: float
    lam_max: float
    duty_level: float = 0.9
    window_s: float = 1.0
    capacitance_f: float = 60e-9
    loss: float = 0.02

    @classmethod
    def of(cls, device: Device, channels: int) -> GateLimits:
        """The limits of a device.

        Volts, slew and lam are the profile's. The others are assumed, for no profile says them: an actuator of
        60 nF with a loss tangent of 0.02 (a PZT-5A bimorph of the paper's size), an amplifier that can charge it
        at its full slew on every channel at once, 20 mJ of heat a second. A mean voltage is the purpose of a
        device with biases and a fault on any other, where 5 % of the range is allowed.
        """
        volts, slew = device.amplifier.volts, device.amplifier.slew_v_per_s
        current = 60e-9 * slew
        return cls(
            volts=volts, slew_v_per_s=slew, dc_volts=volts if device.bias == "actuator" else 0.05 * volts,
            duty=1.0, current_a=current, supply_a=current * channels, energy_j=0.02,
            lam_max=device.coupling.lam.max,
        )  # fmt: skip


class GateRefusal(DriverError, ValueError):
    """A waveform is not safe to play. Nothing has been sent.

    Examples: a ramp of 120 V on a 100 V amplifier; a step that draws 50 mA; a constant voltage on a drive.

    Attributes
    ----------
    quantity : volts, slew, dc, duty, current, supply, energy or lam.
    channel : index, -1 for all together.
    time_s : when.
    value, limit : in the unit of the message.
    """

    def __init__(self, message: str, *, quantity: str, channel: int, time_s: float, value: float, limit: float) -> None:
        super().__init__(message)
        self.quantity = quantity
        self.channel = channel
        self.time_s = time_s
        self.value = value
        self.limit = limit


@dataclass(frozen=True)
class GateReport:
    """How near the limits a waveform comes: the largest of each quantity, in the units of `GateLimits`."""

    volts: float
    slew_v_per_s: float
    dc_volts: float
    duty: float
    current_a: float
    supply_a: float
    energy_j: float


class Gate:
    """Checks blocks of one waveform in order; `finish` checks its end.

    Parameters
    ----------
    limits : what must not be exceeded.
    channels : what each column is.
    rate_hz : samples per second.
    refused : how a refusal begins.
    """

    def __init__(
        self, limits: GateLimits, channels: Sequence[Channel], rate_hz: int, *, refused: str = REFUSED
    ) -> None:
        self._refused = refused
        self._limits = limits
        self._channels = channels
        self._rate = rate_hz
        self._last: Floats = np.zeros(len(channels))
        self._done = 0
        self._part = max(1, round(limits.window_s * rate_hz / WINDOW_PARTS))
        # Sums of a quarter window each: volts, samples that are high, squares that were charged or discharged.
        self._parts = [np.zeros((3, len(channels)))] * WINDOW_PARTS
        self._sums = np.zeros((3, len(channels)))
        self._largest: dict[str, float] = dict.fromkeys(
            ("volts", "slew", "dc", "duty", "current", "supply", "energy"), 0.0
        )

    def check(self, block: Floats) -> None:
        """Check the next samples; float64, shape (S, channels), volts.

        Raises
        ------
        GateRefusal
            At the first quantity that is over its limit, with channel, time, value and limit.
        """
        while len(block):
            room = self._part - self._done % self._part
            self._check_part(block[:room])
            block = block[room:]

    def trial(self) -> Gate:
        """A gate that goes on from here, for what may come; this one stays as it is."""
        other = copy(self)
        other._sums, other._largest = self._sums.copy(), dict(self._largest)
        return other

    def stay(self, count: int) -> None:
        """Check that the last sample comes `count` times more; raises as `check`, at no cost for many."""
        level = np.abs(self._last)
        high = level > self._limits.duty_level * self._limits.volts
        each = np.stack([self._last, high.astype(np.float64), np.zeros_like(self._last)])
        while count > 0:
            some = min(count, self._part - self._done % self._part)
            self._sums += some * each
            self._done += some
            count -= some
            if self._done % self._part == 0:
                self._end_part()

    def finish(self) -> GateReport:
        """Check the step to 0 V after the last sample and the last windows.

        Raises
        ------
        GateRefusal
            As `check`.
        """
        self._check_part(np.zeros((1, len(self._channels))))
        for _ in range(WINDOW_PARTS):
            self._end_part()
        peak = self._largest
        return GateReport(
            peak["volts"], peak["slew"], peak["dc"], peak["duty"], peak["current"], peak["supply"], peak["energy"]
        )

    def _check_part(self, block: Floats) -> None:
        limits, level = self._limits, np.abs(block)
        self._compare("volts", "V", level, limits.volts)
        before = np.concatenate([self._last[np.newaxis], block[:-1]])
        slew = np.abs(block - before) * self._rate
        self._compare("slew", "V/s", slew, limits.slew_v_per_s)
        current = slew * limits.capacitance_f
        self._compare("current", "A", current, limits.current_a)
        self._compare("supply", "A", current.sum(axis=1, keepdims=True), limits.supply_a)
        high = level > limits.duty_level * limits.volts
        self._sums += np.stack([block.sum(0), high.sum(0), np.abs(block**2 - before**2).sum(0)])
        self._last = block[-1].copy()
        self._done += len(block)
        if self._done % self._part == 0:
            self._end_part()

    def _end_part(self) -> None:
        limits = self._limits
        self._parts = [*self._parts[1:], self._sums]
        self._sums = np.zeros_like(self._sums)
        volts, high, squares = np.sum(self._parts, axis=0)
        window = WINDOW_PARTS * self._part
        self._compare("dc", "V", np.abs(volts[np.newaxis]) / window, limits.dc_volts)
        self._compare("duty", "of the time", high[np.newaxis] / window, limits.duty)
        heat = limits.loss * limits.capacitance_f / 2 * squares[np.newaxis]
        self._compare("energy", "J", heat, limits.energy_j)

    def _compare(self, quantity: str, unit: str, values: Floats, limit: float) -> None:
        if np.all(values <= limit * (1 + ROUND_OFF)):
            self._largest[quantity] = max(self._largest[quantity], float(values.max(initial=0.0)))
            return
        sample, channel = np.argwhere(~(values <= limit * (1 + ROUND_OFF)))[0]
        self._refuse(quantity, unit, int(channel), int(sample), float(values[sample, channel]), limit)

    def _refuse(self, quantity: str, unit: str, channel: int, sample: int, value: float, limit: float) -> NoReturn:
        place = "all channels" if quantity == "supply" else str(self._channels[channel])
        time_s = (self._done + sample) / self._rate
        raise GateRefusal(
            f"{self._refused}: {quantity} of {place} is {value:.4g} {unit} at {time_s:.6g} s; "
            f"the limit is {limit:.4g} {unit}; {CURES[quantity]}",
            quantity=quantity, channel=-1 if quantity == "supply" else channel, time_s=time_s, value=value,
            limit=limit,
        )  # fmt: skip


def check_links(events: Iterable[CouplingEvent], limits: GateLimits, *, refused: str = REFUSED) -> None:
    """Hold links against their limit; `refused` is how a refusal begins.

    Raises
    ------
    GateRefusal
        At the first that is over it.
    """
    for event in events:
        worst = max(event.lam, key=abs, default=0.0)
        if not 0 <= worst <= limits.lam_max * (1 + ROUND_OFF):
            raise GateRefusal(
                f"{refused}: lam of row {event.row} is {worst:.4g} at {event.t_s:.6g} s; "
                f"the limit is {limits.lam_max:.4g}; plan for the device that is connected",
                quantity="lam", channel=event.row, time_s=event.t_s, value=worst, limit=limits.lam_max,
            )  # fmt: skip


CURES = {
    "volts": "lower full_scale or lengthen the ramps",
    "slew": "lengthen the ramps",
    "dc": "drive without a constant part",
    "duty": "lower full_scale or leave pauses",
    "current": "lengthen the ramps or lower the frequency",
    "supply": "drive fewer rows at once",
    "energy": "lower full_scale, lower the frequency or leave pauses",
}


def pass_gate(
    manifest: Manifest, reader: SampleReader, limits: GateLimits, *, progress: Callable[[float], None] | None = None
) -> GateReport:
    """Hold a whole written waveform against `limits`: links first, then every sample.

    `progress` is called with the seconds checked so far.

    Raises
    ------
    GateRefusal
        At the first quantity over its limit.
    FileError, UnreadableWaveform
        When the samples cannot be read or are not those the manifest was written for.
    """
    manifest.check_digest(Path(reader.path))
    check_links(manifest.coupling, limits)
    gate = Gate(limits, manifest.channels, manifest.rate_hz)
    done = 0
    for block in reader.blocks(BLOCK):
        gate.check(block)
        done += len(block)
        if progress is not None:
            progress(done / manifest.rate_hz)
    return gate.finish()
