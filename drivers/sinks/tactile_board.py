"""The board of 36 DRV2667 behind six multiplexers: a waveform becomes what each chip plays, and what that costs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from chainsim import Device

from ..formats.samples import SampleReader
from ..waveform.manifest import FrameMark, Manifest
from .drv2667 import STEP_HZ, BoardRefusal, SynthRecord, frequency_byte, gain_for, load_writes, synth_records

__all__ = ["BoardFrame", "BoardPlan", "Socket", "plan_board", "socket_of"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

ROWS = COLS = 6
I2C_HZ = 400_000
SELECT_BITS = 20  # start, address, port mask, stop
WRITE_BITS = 29  # start, address, register, value, stop
MOST_PHASE_RAD = np.deg2rad(20.0)
AUDIBLE_VOLTS = 0.05  # half a step of the amplitude byte at the least gain
MOST_RESIDUE = 0.05  # share of a drive's power that is not its tone
BLOCK = 8192


class Socket(NamedTuple):
    """Where an actuator's chip is: multiplexer 0..5 (the Braille cell), port 0..5 (the dot less one)."""

    mux: int
    port: int


def socket_of(row: int, col: int) -> Socket:
    """The chip of the actuator in `row`, `col` of the 6 x 6 grid."""
    return Socket(row // 3 * 3 + col // 2, row % 3 + 3 * (col % 2))


@dataclass(frozen=True)
class BoardFrame:
    """What the board does for one frame.

    Attributes
    ----------
    start_s, duration_s : when and for how long.
    dots : bool, shape (6, 6), read-only, what `~` lines can say.
    records : socket -> what its chip plays; silent chips are left out.
    load_s : time the I2C bus takes to load it.
    skew_s : from the first chip that starts to the last.
    """

    start_s: float
    duration_s: float
    dots: NDArray[np.bool_]
    records: dict[Socket, tuple[SynthRecord, ...]]
    load_s: float
    skew_s: float

    def writes(self, gain: int) -> Iterator[tuple[Socket, list[tuple[int, int]]]]:
        """The register writes that load it, chip by chip."""
        for socket, records in sorted(self.records.items()):
            yield socket, load_writes(records, gain)


@dataclass(frozen=True)
class BoardPlan:
    """A waveform as the board can play it.

    Attributes
    ----------
    gain : register 0x01.
    frequency_error_hz : largest difference to the planned drive.
    level_error : largest error of the felt level from the amplitude byte, in units of full scale.
    """

    frames: tuple[BoardFrame, ...]
    gain: int
    frequency_error_hz: float
    level_error: float

    @property
    def load_s(self) -> float:
        """The longest time to load a frame."""
        return max((frame.load_s for frame in self.frames), default=0.0)

    @property
    def skew_s(self) -> float:
        """The longest time from the first chip that starts to the last."""
        return max((frame.skew_s for frame in self.frames), default=0.0)


@dataclass(frozen=True)
class _Tone:
    """What one frame needs: frequency byte, and for each actuator volts at that frequency; shape (6, 6)."""

    mark: FrameMark
    frequency: int
    volts: Floats
    level_per_volt: Floats


def plan_board(manifest: Manifest, reader: SampleReader, *, ramp_s: float = 0.032) -> BoardPlan:
    """Turn the steady part of every frame into synthesiser records.

    The frequency goes to the nearest step of 7.8125 Hz; the volts are changed so that the actuator, at its
    level, answers there as it was meant to at the planned frequency (one harmonic).

    Raises
    ------
    BoardRefusal
        When the waveform needs what the board lacks: another grid, coupling, phase, more volts, quicker loading.
    FileError, UnreadableWaveform
        When the samples cannot be read.
    """
    device = manifest.device
    if (device.rows, device.cols) != (ROWS, COLS):
        raise BoardRefusal(f"{device.name} has {device.rows} x {device.cols} actuators, the board {ROWS} x {COLS}")
    if device.chain_length > 1 or device.bias != "none":
        raise BoardRefusal(
            f"{device.name} works by coupled chains or biases, the board drives every actuator on its own; "
            "plan for independent-6x6"
        )
    tones = [
        _tone(device, number, mark, drive)
        for number, (mark, drive) in enumerate(zip(manifest.frames, _drives(manifest, reader), strict=True))
    ]
    gain = gain_for(max((float(tone.volts.max()) for tone in tones), default=0.0))
    frames = tuple(_frame(number, tone, gain, ramp_s) for number, tone in enumerate(tones))
    return BoardPlan(
        frames=frames,
        gain=gain,
        frequency_error_hz=max((_off_hz(device, tone) for tone in tones), default=0.0),
        level_error=max(
            (_off_level(tone, frame, gain) for tone, frame in zip(tones, frames, strict=True)), default=0.0
        ),
    )


def _drives(manifest: Manifest, reader: SampleReader) -> Iterator[Complexes]:
    """The drive phasor of every actuator while each frame stands, volts; complex128, shape (6, 6)."""
    fits = [_Fit(manifest, number) for number in range(len(manifest.frames))]
    at = done = 0
    for block in reader.blocks(BLOCK):
        for fit in fits[done:]:
            fit.take(at, block)
        at += len(block)
        while done < len(fits) and fits[done].stop <= at:
            yield fits[done].phasor()
            done += 1
    yield from (fit.phasor() for fit in fits[done:])


class _Fit:
    """Least squares of cosine and sine at the frame's drive frequency."""

    def __init__(self, manifest: Manifest, number: int) -> None:
        self._number, self._manifest = number, manifest
        mark, rate = manifest.frames[number], manifest.rate_hz
        self._first, self.stop = round(mark.settled_s * rate), round(mark.end_s * rate)
        self._tau_per_sample = manifest.device.tau_per_s / rate
        self._gram = np.zeros((2, 2))
        self._load = np.zeros((2, len(manifest.channels)))
        self._power = np.zeros(len(manifest.channels))

    def take(self, first: int, block: Floats) -> None:
        """Collect the samples of a block that belong to the frame."""
        part = slice(max(0, self._first - first), max(0, self.stop - first))
        samples = block[part]
        if not len(samples):
            return
        angle = self._omega() * self._tau_per_sample * (first + part.start + np.arange(len(samples)))
        basis = np.stack([np.cos(angle), -np.sin(angle)])
        self._gram += basis @ basis.T
        self._load += basis @ samples
        self._power += (samples**2).sum(axis=0)

    def phasor(self) -> Complexes:
        """Of V(t) = Re(phasor e^{i omega tau}); refuses what is no single tone."""
        parts = np.linalg.lstsq(self._gram, self._load)[0]
        left = self._power - (parts * self._load).sum(axis=0)
        if np.any(left > MOST_RESIDUE * self._power + 1e-6):
            raise BoardRefusal(f"frame {self._number}: its drive is not one steady tone, which is all a chip makes")
        grid = np.zeros((ROWS, COLS), dtype=np.complex128)
        for channel, value in zip(self._manifest.channels, parts[0] + 1j * parts[1], strict=True):
            grid[channel.row, channel.col or 0] = value
        return grid

    def _omega(self) -> float:
        mark = self._manifest.frames[self._number]
        if len(set(mark.omega[mark.omega > 0].tolist())) > 1:
            raise BoardRefusal(f"frame {self._number}: rows are driven at different frequencies; plan one for all")
        return _omega(mark)


def _omega(mark: FrameMark) -> float:
    """The frequency of those rows that move; f0 where none does."""
    return float(mark.omega.max()) or 1.0


def _tone(device: Device, number: int, mark: FrameMark, drive: Complexes) -> _Tone:
    omega = _omega(mark)
    frequency = frequency_byte(omega * device.f0_hz)
    wanted = frequency * STEP_HZ / device.f0_hz
    stiff, stiff_there = (_stiffness(device, mark.target, w) for w in (omega, wanted))
    heard = np.abs(drive) > AUDIBLE_VOLTS
    phases = np.angle(drive[heard] / stiff[heard])
    if len(phases) and np.abs(np.angle(np.exp(1j * (phases - phases[0])))).max() > MOST_PHASE_RAD:
        raise BoardRefusal(
            f"frame {number}: the pattern needs actuators at different phases, and chips that start one by one "
            "over milliseconds keep none; show amplitudes only, or use coupled chains"
        )
    volts = np.abs(drive) * np.abs(stiff_there / stiff)
    per_volt = device.epsilon_per_volt / np.abs(stiff_there) / device.full_scale
    return _Tone(mark, frequency, volts, per_volt)


def _stiffness(device: Device, target: Floats, omega: float) -> Complexes:
    """epsilon / A of one actuator at its wanted level, one harmonic."""
    level = target * device.full_scale
    return np.asarray(1 - omega**2 + 0.75 * device.beta * level**2 + 1j * device.delta * omega)


def _frame(number: int, tone: _Tone, gain: int, ramp_s: float) -> BoardFrame:
    mark = tone.mark
    duration_s = mark.end_s - mark.start_s
    records: dict[Socket, tuple[SynthRecord, ...]] = {}
    for row in range(ROWS):
        for col in range(COLS):
            played = synth_records(float(tone.volts[row, col]), tone.frequency, duration_s, gain=gain, ramp_s=ramp_s)
            if played:
                records[socket_of(row, col)] = played
    muxes = len({socket.mux for socket in records})
    writes = sum(len(load_writes(played, gain)) for played in records.values())
    load_s = (writes * WRITE_BITS + (len(records) + muxes) * SELECT_BITS) / I2C_HZ
    fire_s = (SELECT_BITS + 2 * WRITE_BITS) / I2C_HZ
    skew_s = max(0, len(records) - 1) * fire_s + max(0, muxes - 1) * SELECT_BITS / I2C_HZ
    if load_s + skew_s > duration_s:
        raise BoardRefusal(
            f"frame {number}: loading takes {1e3 * load_s:.0f} ms of I2C, the frame lasts {1e3 * duration_s:.0f} ms; "
            "show frames longer"
        )
    dots = mark.wish.raised
    dots.flags.writeable = False
    return BoardFrame(mark.start_s, duration_s, dots, records, load_s, skew_s)


def _off_hz(device: Device, tone: _Tone) -> float:
    return abs(tone.frequency * STEP_HZ - _omega(tone.mark) * device.f0_hz)


def _off_level(tone: _Tone, frame: BoardFrame, gain: int) -> float:
    played = np.zeros((ROWS, COLS))
    for row in range(ROWS):
        for col in range(COLS):
            records = frame.records.get(socket_of(row, col))
            played[row, col] = records[0].volts(gain) if records else 0.0
    return float(np.max(np.abs(played - tone.volts) * tone.level_per_volt))
