"""Keys beside the grid: how a controller tells of them until the host has them, each once and in order."""

from __future__ import annotations

import struct
from collections import deque
from dataclasses import dataclass
from enum import IntEnum
from typing import ClassVar

from .packet import Kind, Packet

__all__ = ["GridKey", "KeyEvent", "KeyHearing", "KeyPacket", "KeyWaiting", "keyed"]

RELEASED = 0x8000
ROUTING = 0x100  # the key over cell k is ROUTING + k
MOST_WAITING = 16
AGAIN_S = 0.05
WRAP = 1 << 32


class GridKey(IntEnum):
    """Keys that have a meaning; further codes below 256 are a controller's own."""

    PREVIOUS = 1
    NEXT = 2
    HOME = 3
    UP = 4
    DOWN = 5
    STOP = 6


@dataclass(frozen=True)
class KeyEvent:
    """A key went down, or up.

    Attributes
    ----------
    code : a `GridKey`, another number below 256, or 256 + k for the key over cell k (0 to 32511).
    down : False when it was released.
    """

    code: int
    down: bool = True

    @property
    def cell(self) -> int | None:
        """Over which cell it is, counted in reading order; None for the others."""
        return self.code - ROUTING if self.code >= ROUTING else None

    @classmethod
    def over(cls, cell: int, down: bool = True) -> KeyEvent:
        """The key over a cell."""
        return cls(ROUTING + cell, down)

    @property
    def wire(self) -> int:
        """As 16 bits."""
        return self.code | (0 if self.down else RELEASED)

    @classmethod
    def of(cls, wire: int) -> KeyEvent:
        """From 16 bits."""
        return cls(wire & ~RELEASED, not wire & RELEASED)


@dataclass(frozen=True)
class KeyPacket:
    """All that the host has not yet: event `first` and those after it, counted since the controller began."""

    first: int
    events: tuple[KeyEvent, ...]

    _struct: ClassVar = struct.Struct("<I")

    def packet(self) -> Packet:
        """As bytes."""
        codes = struct.pack(f"<{len(self.events)}H", *(event.wire for event in self.events))
        return Packet(Kind.KEY, 0, self._struct.pack(self.first) + codes)

    @classmethod
    def of(cls, packet: Packet) -> KeyPacket:
        """From bytes."""
        rest = packet.payload[cls._struct.size :]
        codes = struct.unpack(f"<{len(rest) // 2}H", rest)
        return cls(cls._struct.unpack_from(packet.payload)[0], tuple(map(KeyEvent.of, codes)))


def keyed(awaited: int) -> Packet:
    """What a host answers: it has every event before `awaited`."""
    return Packet(Kind.KEYED, 0, struct.pack("<I", awaited))


class KeyWaiting:
    """The controller's end: keeps events until they are answered, and says when to tell of them.

    At most `MOST_WAITING` are kept; what is pressed beyond is lost, and so is all that waits when a host greets.
    """

    def __init__(self) -> None:
        self._first = 0
        self._events: deque[KeyEvent] = deque()
        self._due_at = 0.0

    def press(self, event: KeyEvent, now: float) -> None:
        """A key went down or up."""
        if len(self._events) < MOST_WAITING:
            self._events.append(event)
            self._due_at = now

    def answered(self, packet: Packet) -> None:
        """The host has the events before a number."""
        awaited = struct.unpack("<I", packet.payload)[0]
        if (awaited - self._first) % WRAP <= len(self._events):
            while self._first != awaited:
                self._drop()

    def clear(self) -> None:
        """Nothing waits any more."""
        while self._events:
            self._drop()

    def due(self, now: float) -> Packet | None:
        """What to send at `now`."""
        if not self._events or now < self._due_at:
            return None
        self._due_at = now + AGAIN_S
        return KeyPacket(self._first, tuple(self._events)).packet()

    def _drop(self) -> None:
        self._events.popleft()
        self._first = (self._first + 1) % WRAP


class KeyHearing:
    """The host's end: gives each event once, whatever the line repeats or loses."""

    def __init__(self) -> None:
        self._awaited: int | None = None

    def take(self, packet: Packet) -> tuple[KeyEvent, ...]:
        """The events in a packet that were not here before."""
        found = KeyPacket.of(packet)
        awaited = found.first if self._awaited is None else self._awaited
        known = (awaited - found.first) % WRAP
        # Ahead of what was heard: the events in between were given up by the controller.
        new = found.events[known:] if known < WRAP // 2 else found.events
        self._awaited = (found.first + len(found.events)) % WRAP if new else awaited
        return new

    @property
    def answer(self) -> Packet:
        """What to send back."""
        return keyed(self._awaited or 0)
