"""Ordered packets that are under way to a controller: which to send next, and which again."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

__all__ = ["UnderWay"]

MOST_PATIENT = 4  # times resend_s


@dataclass
class _Sent:
    """A packet that is not yet acknowledged; `turn` counts sendings of all packets, None: it has to be sent."""

    number: int
    wire: bytes
    samples: int
    turn: int | None = None
    at: float = 0.0
    sendings: int = 0
    here: bool = False  # whether the controller keeps it for its turn


class UnderWay:
    """At most `most` packets in a row, until they are acknowledged.

    A line keeps the order. So a packet was lost when one that was sent after it has arrived and it has not: it is
    sent again, and then not until something sent after that has arrived, which is once in a round trip.

    Parameters
    ----------
    most : packets.
    resend_s : without progress all that is missing is sent again after this, or after two round trips where these take
        longer.

    Attributes
    ----------
    packets, samples : acknowledged.
    resent : packets sent again.
    """

    def __init__(self, most: int, resend_s: float) -> None:
        self._most = most
        self._resend_s = self._patience_s = resend_s
        self._window: deque[_Sent] = deque()
        self._turns = 0
        self._moved_at = -math.inf
        self._gap: int | None = None
        self.packets = self.samples = self.resent = 0

    def __len__(self) -> int:
        return len(self._window)

    @property
    def full(self) -> bool:
        """Whether no more may be added."""
        return len(self._window) >= self._most

    def add(self, number: int, wire: bytes, samples: int) -> None:
        """The next packet in order, with the samples that it holds."""
        self._window.append(_Sent(number, wire, samples))

    def take(self, now: float) -> bytes | None:
        """The bytes of a packet that has to be sent, which count as sent at `now`; None when there is none."""
        if self._window and self._window[0].sendings and now - self._moved_at > self._patience_s:
            # Until a packet that was sent once tells the round trip, it may be longer than was thought.
            self._be_patient(2 * self._patience_s)
            self.again(now)
        for place, sent in enumerate(self._window):
            if sent.turn is None and not sent.here:
                self.resent += sent.sendings > 0
                self._turns += 1
                sent.turn, sent.at, sent.sendings = self._turns, now, sent.sendings + 1
                if place == 0:
                    self._moved_at = now
                return sent.wire
        return None

    def again(self, now: float) -> None:
        """Everything that is not here has to be sent again."""
        for sent in self._window:
            sent.turn = None
        self._moved_at = now

    def gap(self, now: float) -> None:
        """The controller threw packets away: as `again`, once for each packet it waits for."""
        if self._window and self._gap != self._window[0].number:
            self._gap = self._window[0].number
            self.again(now)

    def arrived(self, next_number: int, kept: int, now: float) -> None:
        """All before `next_number` arrived, and ``next_number + 1 + i`` where bit i of `kept` is set."""
        latest = 0
        while self._window and self._window[0].number < next_number:
            sent = self._window.popleft()
            latest = max(latest, sent.turn or 0)
            self._moved_at = now
            if sent.sendings == 1:
                self._be_patient(2 * (now - sent.at))
            self.packets += 1
            self.samples += sent.samples
        for sent in self._window:
            ahead = sent.number - next_number - 1
            sent.here = ahead >= 0 and bool(kept >> ahead & 1)
            if sent.here:
                latest = max(latest, sent.turn or 0)
        for sent in self._window:
            if sent.turn is not None and sent.turn < latest and not sent.here:
                sent.turn = None

    def _be_patient(self, seconds: float) -> None:
        self._patience_s = min(max(seconds, self._resend_s), MOST_PATIENT * self._resend_s)
