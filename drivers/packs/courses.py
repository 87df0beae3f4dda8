"""A plan's frames as what every channel and every row's links do, each curve fitted and kept once."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from chainsim import Device
from planner import DriveTone, FirstOrderHold, OperatingPoint, Ramp, tones_of

from ..channels import channels_of
from ..errors import LimitError
from ..protocol.measured import turns_of
from ..waveform.coupling import CouplingEvent, CouplingWriter
from ..waveform.sampling import bias_on_ramp
from ..waveform.timeline import PlacedFrame
from .curves import Curve, LinkCurve, TooLarge, cubics_of
from .layout import LINKS

__all__ = ["CurveShelf", "PackCourse", "RowPart"]

TOLERANCE = 1e-7  # of full volts; a chain of resonators makes some thousands of it

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]


class RowPart(NamedTuple):
    """What one place of a row does: `place` is a channel of it, or LINKS; `at` is where the curve stands."""

    place: int
    at: int


class _Kept(NamedTuple):
    """A curve that is in the file."""

    at: int
    stands: bool
    last: complex
    peak_volts: float


@dataclass
class CurveShelf:
    """Curves that were fitted, by what they are of; `keep` puts bytes into the file and says where."""

    device: Device
    keep: Callable[[bytes], int]
    pieces: int = 0
    _kept: dict[bytes, _Kept] = field(default_factory=dict)

    def of(self, key: bytes, turns: int, made: Callable[[], tuple[Complexes, complex | None]]) -> _Kept:
        """The curve that `key` stands for; `made` gives its samples, volts, and what stands behind them, if anything.

        Raises
        ------
        TooLarge
            At a sample over the amplifier's volts.
        """
        name = hashlib.sha256(key + turns.to_bytes(8, "little")).digest()
        if name not in self._kept:
            full = self.device.amplifier.volts
            values, held = made()
            # Rounded to 32 bits no point may be over full volts.
            pieces = list(cubics_of(values, TOLERANCE * full, full * (1 - 1e-7)))
            if held is not None:
                pieces += cubics_of(np.array([held]), 0.0, full * (1 + 1e-12), len(values))
            curve = Curve.of(turns, pieces)
            self.pieces += len(pieces)
            peak = float(np.abs(np.append(values, [] if held is None else held)).max())
            self._kept[name] = _Kept(self.keep(curve.packed()), curve.stands, curve.last, peak)
        return self._kept[name]

    def links(self, events: list[CouplingEvent], placed: PlacedFrame) -> int:
        """Where the links of a row that move so in a frame stand."""
        rate = self.device.amplifier.rate_hz
        at = np.array([round(event.t_s * rate) for event in events], dtype=np.int64)
        end = np.array([round((event.t_s + event.ramp_s) * rate) for event in events], dtype=np.int64)
        # What happens with the frame's end, by a rounding, happens with its last sample.
        at = at.clip(max=max(placed.first, placed.stop - 1))
        lam = np.array([event.lam for event in events])
        return self.keep(LinkCurve(at - placed.first, end - at, lam).packed())


class PackCourse:
    """What a session does, frame after frame; each part is told only where something changes.

    Attributes
    ----------
    peak_volts : largest so far of any channel.
    """

    def __init__(self, shelf: CurveShelf) -> None:
        self._shelf, self._device = shelf, shelf.device
        self._channels = channels_of(self._device)
        self._links = CouplingWriter(self._device, sampled=True)
        self._standing: dict[tuple[int, int], complex] = {}
        self.peak_volts = 0.0

    def parts(self, placed: PlacedFrame) -> list[list[RowPart]]:
        """The parts of every row in the next frame, by place.

        Raises
        ------
        LimitError
            When more is wanted than the amplifier's volts.
        """
        rows: list[list[RowPart]] = [[] for _ in range(self._device.rows)]
        per_row = self._device.chains_per_row
        for chain, (state, ramp) in enumerate(zip(placed.plan.states, placed.plan.ramps, strict=True)):
            row, number = divmod(chain, per_row)
            n = self._device.chain_length
            drives = self._drives(placed, state, ramp)
            rows[row] += (RowPart(number, at) for at in self._told(chain, placed, drives))
            for actuator in range(n if self._device.bias == "actuator" else 0):
                col = number * n + actuator
                channel = self._device.rows * per_row + row * self._device.cols + col
                bias = [(0, self._bias(placed, state, ramp, actuator))]
                rows[row] += (RowPart(per_row + col, at) for at in self._told(channel, placed, bias))
        for row, at in self._linked(placed):
            rows[row].append(RowPart(LINKS, at))
        return [sorted(row) for row in rows]

    def _told(
        self, channel: int, placed: PlacedFrame, wanted: Iterator[tuple[int, _Made]] | list[tuple[int, _Made]]
    ) -> Iterator[int]:
        """Where the curves of a channel stand that change something."""
        sounding, peak = set(), 0.0
        for turns, made in wanted:
            sounding.add(turns)
            kept = self._kept(channel, placed, turns, made)
            peak += kept.peak_volts
            if not kept.stands or kept.last != self._standing.get((channel, turns), 0j):
                yield kept.at
            self._standing[channel, turns] = kept.last
        if peak > self._device.amplifier.volts * (1 + 1e-6):
            raise self._over(channel, placed.plan.start_s, peak)
        self.peak_volts = max(self.peak_volts, peak)
        for (other, turns), last in list(self._standing.items()):
            if other == channel and last and turns not in sounding:
                self._standing[other, turns] = 0j
                yield self._kept(channel, placed, turns, _Made(b"", lambda: (np.empty(0, complex), 0j))).at

    def _kept(self, channel: int, placed: PlacedFrame, turns: int, made: _Made) -> _Kept:
        try:
            return self._shelf.of(made.key, turns, made.samples)
        except TooLarge as error:
            time_s = placed.plan.start_s + error.at / self._device.amplifier.rate_hz
            raise self._over(channel, time_s, error.volts) from None

    def _over(self, channel: int, time_s: float, volts: float) -> LimitError:
        limit, place = self._device.amplifier.volts, self._channels[channel]
        return LimitError(
            f"{place}: {volts:.6g} V at {time_s:.6g} s is over the amplifier's {limit:g} V; "
            "lower full_scale or lengthen the ramp",
            channel=place, time_s=time_s, value=volts, limit=limit,
        )  # fmt: skip

    def _drives(self, placed: PlacedFrame, state: OperatingPoint, ramp: Ramp | None) -> Iterator[tuple[int, _Made]]:
        dtau = self._device.tau_per_s / self._device.amplifier.rate_hz
        for tone in tones_of(state, ramp):
            yield turns_of(tone.omega, dtau), self._drive(placed, tone, FirstOrderHold.of(tone.omega, dtau))

    def _drive(self, placed: PlacedFrame, tone: DriveTone, hold: FirstOrderHold) -> _Made:
        device = self._device
        since_s = self._instants(placed, tone.end_s)

        def samples() -> tuple[Complexes, complex | None]:
            rising = tone.on_ramp(since_s, hold, device.tau_per_s)
            values = np.zeros(len(since_s), np.complex128)
            if rising is not None:
                values += rising / device.epsilon_per_volt
            held = hold.gain * tone.held / device.epsilon_per_volt
            return values, self._held(placed, since_s, held)

        return _Made(_key(since_s, tone.t_s, tone.values, tone.slopes, tone.held, placed), samples)

    def _bias(self, placed: PlacedFrame, state: OperatingPoint, ramp: Ramp | None, actuator: int) -> _Made:
        moves = ramp is not None and ramp.bias is not None
        since_s = self._instants(placed, ramp.duration_s if ramp is not None and moves else -math.inf)
        per_volt, held = self._device.bias_per_volt, float(state.bias[actuator])

        def samples() -> tuple[Complexes, complex | None]:
            values = np.zeros(len(since_s), complex)
            if ramp is not None and moves:
                values += bias_on_ramp(ramp, actuator, since_s) / per_volt
            return values, self._held(placed, since_s, held / per_volt)

        if ramp is None or ramp.bias is None:
            return _Made(_key(since_s, None, None, None, held, placed), samples)
        slopes = None if ramp.bias_slope is None else ramp.bias_slope[:, actuator]
        return _Made(_key(since_s, ramp.t_s, ramp.bias[:, actuator], slopes, held, placed), samples)

    def _instants(self, placed: PlacedFrame, end_s: float) -> Floats:
        """Seconds since the frame's start, of its samples before `end_s`."""
        rate, count = self._device.amplifier.rate_hz, placed.stop - placed.first
        beside_s = round(placed.first / rate - placed.plan.start_s, 9)
        most = 0 if end_s < 0 else min(count, math.ceil((end_s - beside_s) * rate) + 1)
        since_s = np.arange(max(0, most)) / rate + beside_s
        return since_s[: np.searchsorted(since_s, end_s)]

    def _held(self, placed: PlacedFrame, since_s: Floats, volts: complex) -> complex | None:
        return volts if len(since_s) < placed.stop - placed.first else None

    def _linked(self, placed: PlacedFrame) -> Iterator[tuple[int, int]]:
        of_row: dict[int, list[CouplingEvent]] = {}
        for event in self._links.events(placed.plan):
            of_row.setdefault(event.row, []).append(event)
        for row, events in of_row.items():
            yield row, self._shelf.links(events, placed)


class _Made(NamedTuple):
    """A curve to be: what tells it from others, and how its samples are had."""

    key: bytes
    samples: Callable[[], tuple[Complexes, complex | None]]


def _key(
    since_s: Floats, nodes: Floats | None, values: NDArray[np.generic] | None, slopes: NDArray[np.generic] | None,
    held: complex, placed: PlacedFrame,
) -> bytes:  # fmt: skip
    """What the samples hang on; equal ramps are equal wherever they stand."""
    ends = len(since_s) == placed.stop - placed.first
    head = np.array([len(since_s), since_s[0] if len(since_s) else 0.0, ends, held.real, held.imag])
    parts = [b"" if part is None else part.tobytes() for part in (nodes, values, slopes)]
    return b"|".join([head.tobytes(), *(len(part).to_bytes(8, "little") for part in parts), *parts])
