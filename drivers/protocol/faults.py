"""Mischief on a line: packets dropped, corrupted, duplicated or late, silences, stalls; seeded, to be repeated."""

from __future__ import annotations

import random
from collections import deque
from dataclasses import dataclass

from .cobs import DELIMITER

__all__ = ["FaultWindow", "Faults", "FaultyLine"]


@dataclass(frozen=True)
class FaultWindow:
    """A stretch of time, seconds since the line was made."""

    start_s: float
    length_s: float

    def holds(self, time_s: float) -> bool:
        """Whether `time_s` is in it."""
        return self.start_s <= time_s < self.start_s + self.length_s


@dataclass(frozen=True)
class Faults:
    """What goes wrong on a line.

    Attributes
    ----------
    drop, corrupt, duplicate : share of packets, 0..1.
    delay_s : every packet is so late.
    stall : packets wait while it lasts.
    disconnect : everything is lost while it lasts.
    """

    drop: float = 0.0
    corrupt: float = 0.0
    duplicate: float = 0.0
    delay_s: float = 0.0
    stall: FaultWindow | None = None
    disconnect: FaultWindow | None = None

    def __post_init__(self) -> None:
        for name in ("drop", "corrupt", "duplicate"):
            share = getattr(self, name)
            if not 0 <= share <= 1:
                raise ValueError(f"{name}: expected a share from 0 to 1, got {share}")
        if not self.delay_s >= 0:
            raise ValueError(f"delay_s: expected a number >= 0, got {self.delay_s}")


class FaultyLine:
    """One direction of a line: bytes go in, and come out as `faults` has it.

    Attributes
    ----------
    dropped, corrupted, duplicated : packets so far.
    """

    def __init__(self, faults: Faults, *, seed: int, now: float) -> None:
        self._faults = faults
        self._random = random.Random(seed)
        self._began = now
        self._partial = b""
        self._waiting: deque[tuple[float, bytes]] = deque()
        self.dropped = self.corrupted = self.duplicated = 0

    def put(self, data: bytes, now: float) -> None:
        """Bytes go into the line."""
        *frames, self._partial = (self._partial + data).split(DELIMITER)
        for frame in frames:
            self._put_frame(frame + DELIMITER, now - self._began)

    def take(self, now: float) -> bytes:
        """The bytes that have come out by `now`."""
        time_s, out = now - self._began, bytearray()
        if self._faults.stall is not None and self._faults.stall.holds(time_s):
            return b""
        while self._waiting and self._waiting[0][0] <= time_s:
            out += self._waiting.popleft()[1]
        return bytes(out)

    def _put_frame(self, frame: bytes, time_s: float) -> None:
        faults, chance = self._faults, self._random.random
        if (faults.disconnect is not None and faults.disconnect.holds(time_s)) or chance() < faults.drop:
            self.dropped += 1
            return
        if chance() < faults.corrupt:
            self.corrupted += 1
            frame = self._corrupt(frame)
        copies = 1
        if chance() < faults.duplicate:
            self.duplicated += 1
            copies = 2
        self._waiting.extend([(time_s + faults.delay_s, frame)] * copies)

    def _corrupt(self, frame: bytes) -> bytes:
        """Flip a bit, lose a byte or gain one."""
        at, how = self._random.randrange(len(frame)), self._random.randrange(3)
        if how == 0:
            return frame[:at] + bytes([frame[at] ^ 1 << self._random.randrange(8)]) + frame[at + 1 :]
        if how == 1:
            return frame[:at] + frame[at + 1 :]
        return frame[:at] + bytes([self._random.randrange(256)]) + frame[at:]
