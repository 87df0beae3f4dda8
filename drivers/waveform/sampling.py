"""Volts per channel as a function of time, sampled in blocks at the very end."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from chainsim import Device
from planner import DriveTone, FirstOrderHold, FramePlan, OperatingPoint, Plan, Ramp, curve, tones_of

from ..channels import Channel, Role, channels_of
from .shaping import Shaper
from .timeline import stretches

__all__ = ["Converter", "Waveform", "bias_on_ramp", "volts_of"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

# Samples of all channels computed at once: about a megabyte of float64, which stays in the cache.
CHUNK_VALUES = 1 << 17
BLOCK = 4096


@dataclass(frozen=True)
class Waveform:
    """The amplifier voltages that carry out a plan.

    The drive of a chain is ``Re(E(t) e^{i omega tau}) / epsilon_per_volt`` volts, summed over its tones,
    tau = 2 pi f0_hz t, with E the ramp's envelope while it lasts and the state's epsilon after it; the bias of an
    actuator is ``b(t) / bias_per_volt``. The time of sample k is k / rate_hz, counted from the start of the plan.
    Where the converter has steps, drives are rounded to them with the error pushed up in frequency (`Shaper`), constant
    voltages to the nearest.

    Attributes
    ----------
    device : the hardware.
    channels : what each column of a block is.
    frames : the plan's frames; they are drawn as the samples are asked for.
    """

    device: Device
    channels: tuple[Channel, ...]
    frames: Iterable[FramePlan]

    @classmethod
    def of(cls, plan: Plan) -> Waveform:
        """The waveform of `plan`; nothing is computed yet."""
        return cls(plan.device, channels_of(plan.device), plan.frames)

    @property
    def rate_hz(self) -> int:
        """Samples per second and channel."""
        return self.device.amplifier.rate_hz

    def samples(self, start_s: float, stop_s: float) -> Floats:
        """The samples from `start_s` until before `stop_s`; what lies before is computed too.

        Returns
        -------
        float64, shape (S, channels), volts; fewer where the plan ends earlier.

        Raises
        ------
        ValueError
            When the times do not rise from 0.
        WaveformError
            As `blocks`.
        """
        if not 0 <= start_s <= stop_s:
            raise ValueError(f"samples: expected times that rise from 0, got {start_s} to {stop_s}")
        first, stop = (math.ceil(time_s * self.rate_hz - 1e-6) for time_s in (start_s, stop_s))
        pieces, position = [np.empty((0, len(self.channels)))], 0
        for block in self.blocks(BLOCK):
            if position >= stop:
                break
            pieces.append(block[max(0, first - position) : stop - position])
            position += len(block)
        return np.concatenate(pieces)

    def blocks(self, block: int) -> Iterator[Floats]:
        """The samples from the start, `block` at a time; the last block may be shorter.

        The values do not depend on `block`, to the last bit. Memory is that of one block and one chunk,
        however long the plan or a frame.

        Yields
        ------
        float64, shape (S, channels), volts, read-only.

        Raises
        ------
        ValueError
            When block < 1.
        WaveformError
            When a frame does not fit the device or the frame before it.
        """
        if block < 1:
            raise ValueError(f"block: expected a whole number >= 1, got {block}")
        return self._reblocked(block)

    def _reblocked(self, block: int) -> Iterator[Floats]:
        # Channels are contiguous in memory: they are computed, filled and checked one by one.
        pending, filled = np.empty((len(self.channels), block)), 0
        for chunk in self._chunks():
            taken = 0
            while taken < chunk.shape[1]:
                count = min(block - filled, chunk.shape[1] - taken)
                pending[:, filled : filled + count] = chunk[:, taken : taken + count]
                filled, taken = filled + count, taken + count
                if filled == block:
                    yield _finished(pending)
                    pending, filled = np.empty((len(self.channels), block)), 0
        if filled:
            yield _finished(pending[:, :filled])

    def _chunks(self) -> Iterator[Floats]:
        # Chunks are cut at the same samples for every block size, so that vector instructions meet the same
        # numbers at the same places and round them in the same way.
        size = max(256, CHUNK_VALUES // len(self.channels))
        converter = Converter(self.device)
        for stretch in stretches(self.device, self.frames):
            for first in range(stretch.first, stretch.stop, size):
                index = np.arange(first, min(first + size, stretch.stop))
                yield converter.round(volts_of(self.device, stretch.plan, index))


class Converter:
    """The steps of a device's converter, where it has any; drives are rounded with the error pushed up in frequency."""

    def __init__(self, device: Device) -> None:
        self._step = device.amplifier.volt_step
        self._drives = sum(channel.role is Role.DRIVE for channel in channels_of(device))
        self._shaper = Shaper(self._drives)

    def round(self, volts: Floats) -> Floats:
        """The next samples as they go out, in place; float64, shape (channels, S), volts."""
        if self._step:
            drives = self._drives
            volts /= self._step
            volts[:drives] = self._shaper.round(volts[:drives])
            np.rint(volts[drives:], out=volts[drives:])
            volts *= self._step
        return volts


def volts_of(device: Device, frame: FramePlan, index: NDArray[np.intp]) -> Floats:
    """What a frame asks of the channels at samples `index` of the whole plan, none before its start, rising.

    Returns
    -------
    float64, shape (channels, S), volts.
    """
    time_s = index / device.amplifier.rate_hz
    since_s = time_s - frame.start_s
    biases = device.rows * device.cols if device.bias == "actuator" else 0
    driven = len(device.driven)
    out = np.zeros((driven + biases, len(index)))
    carriers: dict[float, _Carrier] = {}
    equal: dict[tuple[int, int, int], int] = {}
    for number, (row, col) in enumerate(device.driven):
        # A grid is one chain with several drives; of all other chains the first actuator is driven.
        chain, place = (0, row * device.cols + col) if device.grid else (number, 0)
        state, ramp = frame.states[chain], frame.ramps[chain]
        # Equal rows come from the planner's cache as the same objects: sampled once, then copied.
        first = equal.setdefault((id(state), id(ramp), place), number)
        if first < number:
            out[number] = out[first]
        else:
            for tone in tones_of(state, ramp, place):
                if tone.omega not in carriers:
                    carriers[tone.omega] = _Carrier.of(tone.omega, device.tau_per_s * time_s, device)
                _drive(tone, since_s, carriers[tone.omega], out[number])
    drives = out[:driven]
    drives /= device.epsilon_per_volt
    if biases:
        stills = out[driven:].reshape(len(frame.states), device.chain_length, -1)
        for state, ramp, rows in zip(frame.states, frame.ramps, stills, strict=True):
            _bias(state, ramp, since_s, device.bias_per_volt, rows)
    return out


@dataclass(frozen=True)
class _Carrier:
    """cos and sin of omega tau at the samples of a chunk, float64, shape (S,), and what the hold takes away."""

    cos: Floats
    sin: Floats
    hold: FirstOrderHold
    tau_per_s: float

    @classmethod
    def of(cls, omega: float, tau: Floats, device: Device) -> _Carrier:
        hold = FirstOrderHold.of(omega, device.tau_per_s / device.amplifier.rate_hz)
        return cls(np.cos(omega * tau), np.sin(omega * tau), hold, device.tau_per_s)


def _ramp_samples(ramp: Ramp | None, since_s: Floats) -> int:
    """How many of the sample times lie before the end of the ramp."""
    return 0 if ramp is None else int(np.searchsorted(since_s, ramp.duration_s))


def _drive(tone: DriveTone, since_s: Floats, carrier: _Carrier, out: Floats) -> None:
    """Add one tone of the dimensionless drive force of one chain to `out`, shape (S,)."""
    end = int(np.searchsorted(since_s, tone.end_s))
    envelope = tone.on_ramp(since_s[:end], carrier.hold, carrier.tau_per_s)
    if envelope is not None:
        out[:end] += envelope.real * carrier.cos[:end] - envelope.imag * carrier.sin[:end]
    if tone.held and end < len(out):
        held = carrier.hold.gain * tone.held
        out[end:] += held.real * carrier.cos[end:] - held.imag * carrier.sin[end:]


def _bias(state: OperatingPoint, ramp: Ramp | None, since_s: Floats, per_volt: float, out: Floats) -> None:
    """Put the bias volts of one chain's actuators into `out`, shape (n, S), which is zero."""
    end = _ramp_samples(ramp, since_s) if ramp is not None and ramp.bias is not None else 0
    for actuator, row in enumerate(out):
        if end and ramp is not None:
            row[:end] = bias_on_ramp(ramp, actuator, since_s[:end]) / per_volt
        if state.bias[actuator]:
            row[end:] = state.bias[actuator] / per_volt


def bias_on_ramp(ramp: Ramp, actuator: int, since_s: Floats) -> Floats | float:
    """The force of the bias of one actuator of a chain at instants of a ramp that has one, dimensionless."""
    assert ramp.bias is not None
    nodes = ramp.bias[:, actuator]
    slopes = None if ramp.bias_slope is None else ramp.bias_slope[:, actuator]
    if np.all(nodes == nodes[0]) and (slopes is None or not np.any(slopes)):
        return float(nodes[0])
    return curve(since_s, ramp.t_s, nodes, slopes)


def _finished(rows: Floats) -> Floats:
    rows.flags.writeable = False
    return rows.T
