"""What a host says: one dataclass a kind, with its payload's bytes; all numbers little-endian."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from .packet import MAX_PAYLOAD, Kind, Packet

__all__ = [
    "FULL_CODE",
    "VERSION",
    "Bias",
    "Codes",
    "LinkCoupling",
    "Links",
    "Mark",
    "SamplesMessage",
    "StartMessage",
    "Tones",
    "WireTone",
]

Codes = NDArray[np.int16]

VERSION = 6  # the newest spoken here; a controller and a host speak the newest that both know
PARAMETRIC, PREFILL = 1, 2  # bits of START's mode
FULL_CODE = 32767  # the sample code of full_volts; -32768 is not used


@dataclass(frozen=True)
class StartMessage:
    """A session begins: `total` samples will come (or, `parametric`, tones and biases for as long).

    Attributes
    ----------
    total : samples; 0, from version 4 on: open, until END says how many there were.
    note : for people and recorders (JSON); a controller may pass over it.
    prefill : from version 4 on, so many samples in store are enough to play; 0: half of the buffer.
    """

    session: int
    parametric: bool
    rate_hz: int
    total: int
    note: bytes = b""
    prefill: int = 0

    _struct: ClassVar = struct.Struct("<IBIQ")
    _prefill: ClassVar = struct.Struct("<I")

    def packet(self, number: int) -> Packet:
        """As bytes."""
        mode = PARAMETRIC * self.parametric | PREFILL * (self.prefill > 0)
        head = self._struct.pack(self.session, mode, self.rate_hz, self.total)
        prefill = self._prefill.pack(self.prefill) if self.prefill else b""
        return Packet(Kind.START, number, head + prefill + self.note)

    @classmethod
    def of(cls, packet: Packet) -> StartMessage | None:
        """From bytes; None when it ends before the prefill that it announces."""
        session, mode, rate_hz, total = cls._struct.unpack_from(packet.payload)
        rest, prefill = packet.payload[cls._struct.size :], 0
        if mode & PREFILL:
            if len(rest) < cls._prefill.size:
                return None
            (prefill,), rest = cls._prefill.unpack_from(rest), rest[cls._prefill.size :]
        return cls(session, bool(mode & PARAMETRIC), rate_hz, total, rest, prefill)


@dataclass(frozen=True)
class LinkCoupling:
    """From sample `at` the links of `row` move to `codes` (times lam_step), linearly over `ramp` samples."""

    at: int
    row: int
    ramp: int
    codes: tuple[int, ...]

    _struct: ClassVar = struct.Struct("<QHI")

    def packet(self, number: int) -> Packet:
        """As bytes."""
        codes = struct.pack(f"<{len(self.codes)}H", *self.codes)
        return Packet(Kind.COUPLING, number, self._struct.pack(self.at, self.row, self.ramp) + codes)

    @classmethod
    def of(cls, packet: Packet) -> LinkCoupling:
        """From bytes."""
        at, row, ramp = cls._struct.unpack_from(packet.payload)
        rest = packet.payload[cls._struct.size :]
        return cls(at, row, ramp, struct.unpack(f"<{len(rest) // 2}H", rest))


@dataclass(frozen=True)
class Links:
    """The same in numbers that a controller need not round: from version 6 on.

    Attributes
    ----------
    lam : cols - 1 numbers.
    """

    at: int
    row: int
    ramp: int
    lam: tuple[float, ...]

    _struct: ClassVar = struct.Struct("<QHI")

    def packet(self, number: int) -> Packet:
        """As bytes."""
        lam = struct.pack(f"<{len(self.lam)}f", *self.lam)
        return Packet(Kind.LINKS_TO, number, self._struct.pack(self.at, self.row, self.ramp) + lam)

    @classmethod
    def of(cls, packet: Packet) -> Links:
        """From bytes."""
        rest = packet.payload[cls._struct.size :]
        return cls(*(*cls._struct.unpack_from(packet.payload), struct.unpack(f"<{len(rest) // 4}f", rest)))


@dataclass(frozen=True)
class Bias:
    """From sample `at` the constant part of `channel` moves to `volts`, linearly over `ramp` samples."""

    at: int
    channel: int
    ramp: int
    volts: float

    _struct: ClassVar = struct.Struct("<QHIf")

    def packet(self, number: int) -> Packet:
        """As bytes."""
        return Packet(Kind.BIAS, number, self._struct.pack(self.at, self.channel, self.ramp, self.volts))

    @classmethod
    def of(cls, packet: Packet) -> Bias:
        """From bytes."""
        return cls(*cls._struct.unpack(packet.payload))


@dataclass(frozen=True)
class WireTone:
    """``volts * cos(2 pi hz t + phase)``, t in seconds from sample 0 of the session, phase in radians."""

    volts: float
    hz: float
    phase: float


@dataclass(frozen=True)
class Tones:
    """From sample `at` the tones of `channel` give way to these: cross-faded linearly over `ramp` samples."""

    at: int
    channel: int
    ramp: int
    tones: tuple[WireTone, ...]

    _struct: ClassVar = struct.Struct("<QHI")
    _tone: ClassVar = struct.Struct("<fff")

    def packet(self, number: int) -> Packet:
        """As bytes."""
        tones = b"".join(self._tone.pack(tone.volts, tone.hz, tone.phase) for tone in self.tones)
        return Packet(Kind.TONES, number, self._struct.pack(self.at, self.channel, self.ramp) + tones)

    @classmethod
    def of(cls, packet: Packet) -> Tones:
        """From bytes."""
        rest = packet.payload[cls._struct.size :]
        tones = tuple(WireTone(*values) for values in cls._tone.iter_unpack(rest))
        return cls(*(*cls._struct.unpack_from(packet.payload), tones))


@dataclass(frozen=True)
class Mark:
    """When sample `at` goes out, say so; `note` is for people and recorders (JSON)."""

    at: int
    frame: int
    note: bytes = b""

    _struct: ClassVar = struct.Struct("<QI")

    def packet(self, number: int) -> Packet:
        """As bytes."""
        return Packet(Kind.MARK, number, self._struct.pack(self.at, self.frame) + self.note)

    @classmethod
    def of(cls, packet: Packet) -> Mark:
        """From bytes."""
        return cls(*(*cls._struct.unpack_from(packet.payload), packet.payload[cls._struct.size :]))


@dataclass(frozen=True)
class SamplesMessage:
    """The samples from `first` on; int16, shape (S, channels), full_volts / 32767 volts a step."""

    first: int
    codes: Codes

    _struct: ClassVar = struct.Struct("<QH")

    @staticmethod
    def most(channels: int, max_payload: int) -> int:
        """How many samples of all channels fit into one packet; 0 when not even one does."""
        return (min(max_payload, MAX_PAYLOAD) - SamplesMessage._struct.size) // (2 * channels)

    def packet(self, number: int) -> Packet:
        """As bytes."""
        head = self._struct.pack(self.first, len(self.codes))
        return Packet(Kind.SAMPLES, number, head + self.codes.astype("<i2").tobytes())

    @classmethod
    def of(cls, packet: Packet, channels: int) -> SamplesMessage | None:
        """From bytes; None when there are not `count` samples of `channels` channels."""
        first, count = cls._struct.unpack_from(packet.payload)
        flat = np.frombuffer(packet.payload, dtype="<i2", offset=cls._struct.size)
        if not count or len(flat) != count * channels:
            return None
        return cls(first, flat.reshape(count, channels).astype(np.int16, copy=False))
