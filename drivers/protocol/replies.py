"""What a controller says: one dataclass a kind, with its payload's bytes; all numbers little-endian."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from enum import IntEnum, IntFlag
from typing import ClassVar

from .packet import Kind, Packet

__all__ = ["Ack", "Capabilities", "Flag", "Marked", "Refused", "State"]


ABILITIES_SINCE = 3  # the version from which on CAPABILITIES has a byte of flags before the name
MEASURES = 1  # its bit
OPEN_SINCE = 4  # the version from which on sessions may be open and start early


class State(IntEnum):
    """What the controller's output does."""

    IDLE = 0
    FILLING = 1
    PLAYING = 2
    HELD = 3
    DONE = 4
    STOPPED = 5


class Flag(IntFlag):
    """What an ACK also says: with GAP, packets were thrown away because they came too early."""

    GAP = 1


@dataclass(frozen=True)
class Capabilities:
    """What a controller can do, and where its session stands.

    Attributes
    ----------
    version : the newest that it and the host know.
    rows, cols, channels, rate_hz : the grid and its outputs.
    bits : of a sample; 16.
    buffer_samples, event_slots : room for samples (per channel) and for events.
    max_payload : bytes.
    full_volts : volts of sample code 32767.
    lam_step : lam of coupling code 1;
    lam_max : the largest lam.
    watchdog_ms : silence after which the output is at zero;
    ramp_ms : how long the ramp to zero takes.
    session : of the host it is serving, 0 for none.
    next_number : the ordered packet it waits for.
    name : for people.
    measures : whether it answers MEASURE; said from version 3 on.
    """

    version: int
    rows: int
    cols: int
    channels: int
    rate_hz: int
    bits: int
    buffer_samples: int
    event_slots: int
    max_payload: int
    full_volts: float
    lam_step: float
    lam_max: float
    watchdog_ms: int
    ramp_ms: int
    session: int
    next_number: int
    name: str = ""
    measures: bool = False

    _struct: ClassVar = struct.Struct("<HHHHIBIHHfffHHII")

    def packet(self) -> Packet:
        """As bytes."""
        numbers = (
            self.version, self.rows, self.cols, self.channels, self.rate_hz, self.bits, self.buffer_samples,
            self.event_slots, self.max_payload, self.full_volts, self.lam_step, self.lam_max, self.watchdog_ms,
            self.ramp_ms, self.session, self.next_number,
        )  # fmt: skip
        abilities = bytes([self.measures]) if self.version >= ABILITIES_SINCE else b""
        return Packet(Kind.CAPABILITIES, 0, self._struct.pack(*numbers) + abilities + self.name.encode()[:80])

    @classmethod
    def of(cls, packet: Packet) -> Capabilities:
        """From bytes."""
        numbers, rest = cls._struct.unpack_from(packet.payload), packet.payload[cls._struct.size :]
        told = 1 if numbers[0] >= ABILITIES_SINCE else 0
        measures = bool(int.from_bytes(rest[:told]) & MEASURES)
        return cls(*(*numbers, rest[told:].decode("utf-8", "replace"), measures))


@dataclass(frozen=True)
class Ack:
    """Where the controller stands. Credits are absolute, so a lost or repeated ACK does no harm.

    Attributes
    ----------
    next_number : the ordered packet it waits for; all before it are safe.
    accept_samples : it has room for samples before this one.
    accept_events : and for events before this one of the session's (START, END and SAMPLES are none).
    received, played : samples so far.
    underruns : how often the buffer ran dry.
    bad : frames that were no packet.
    held_ms : time spent at zero, waiting for the host, since sample 0.
    clock_us : its clock.
    kept : from version 2 on, bit i for packet ``next_number + 1 + i``, which is here before its turn.
    """

    session: int
    next_number: int
    accept_samples: int
    accept_events: int
    received: int
    played: int
    state: State
    flags: Flag
    underruns: int
    bad: int
    held_ms: int
    clock_us: int
    kept: int | None = None

    _struct: ClassVar = struct.Struct("<IIQIQQBBIIIQ")

    def packet(self) -> Packet:
        """As bytes."""
        values = (
            self.session, self.next_number, self.accept_samples, self.accept_events, self.received, self.played,
            self.state, self.flags, self.underruns, self.bad, self.held_ms, self.clock_us,
        )  # fmt: skip
        kept = b"" if self.kept is None else self.kept.to_bytes(4, "little")
        return Packet(Kind.ACK, 0, self._struct.pack(*values) + kept)

    @classmethod
    def of(cls, packet: Packet) -> Ack | None:
        """From bytes; None when the state is not known."""
        values = [*cls._struct.unpack_from(packet.payload), None]
        if values[6] not in State.__members__.values():
            return None
        values[6], values[7] = State(values[6]), Flag(values[7] & Flag.GAP)
        if kept := packet.payload[cls._struct.size :][:4]:
            values[12] = int.from_bytes(kept, "little")
        return cls(*values)


@dataclass(frozen=True)
class Marked:
    """The mark of `frame` went out as sample `at`, when the controller's clock read `clock_us`."""

    frame: int
    at: int
    clock_us: int

    _struct: ClassVar = struct.Struct("<IQQ")

    def packet(self) -> Packet:
        """As bytes."""
        return Packet(Kind.MARKED, 0, self._struct.pack(self.frame, self.at, self.clock_us))

    @classmethod
    def of(cls, packet: Packet) -> Marked:
        """From bytes."""
        return cls(*cls._struct.unpack(packet.payload))


@dataclass(frozen=True)
class Refused:
    """The ordered packet `number` was whole but cannot be carried out; `why` is one line."""

    number: int
    why: str

    def packet(self) -> Packet:
        """As bytes."""
        return Packet(Kind.REFUSED, 0, struct.pack("<I", self.number) + self.why.encode()[:200])

    @classmethod
    def of(cls, packet: Packet) -> Refused:
        """From bytes."""
        return cls(struct.unpack_from("<I", packet.payload)[0], packet.payload[4:].decode("utf-8", "replace"))
