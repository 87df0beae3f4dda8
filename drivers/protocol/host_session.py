"""The host's side of a session, without a port and without a clock: credits, acknowledgements, resume."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from enum import Enum

from planner import Measured

from ..errors import DriverError
from .cobs import DELIMITER
from .keys import KeyEvent, KeyHearing
from .measured import MeasuredFrames, MeasuredPart
from .messages import VERSION, SamplesMessage, StartMessage
from .outgoing import End, Message
from .packet import Kind, Packet, PacketReader, encode
from .replies import OPEN_SINCE, Ack, Capabilities, Flag, Marked, Refused, State
from .under_way import UnderWay

__all__ = ["ControllerRefused", "HostSession", "SessionLost", "StreamReport", "Timing"]

HELLO = encode(Packet(Kind.HELLO, 0, VERSION.to_bytes(2, "little")))
HEARTBEAT = encode(Packet(Kind.HEARTBEAT))
STOP = encode(Packet(Kind.STOP))
MOST_LATE = 4096
MOST_LEAD_S = 0.48


class ControllerRefused(DriverError, ValueError):
    """The controller cannot carry out what it was sent; the message is its own.

    Examples: a coupling above its largest lam; samples for another number of channels.
    """


class SessionLost(DriverError, ConnectionError):
    """The controller came back without the session, so where it stopped is not known.

    Examples: it lost power and started anew; another host took it over; it stopped by itself.
    """


@dataclass(frozen=True)
class Timing:
    """How patient a host is.

    Attributes
    ----------
    heartbeat_s : it is never silent for longer.
    resend_s : without progress it sends again after this.
    hello_s : and greets again after this.
    window : packets under way, at most 32.
    burst_bytes : sent at a time.
    lead_s : samples are asked for only while fewer seconds of them are ahead of what is played, twice as many after
        each time that was too few; None: as many as the controller has room for.
    """

    heartbeat_s: float = 0.025
    resend_s: float = 0.1
    hello_s: float = 0.25
    window: int = 32
    burst_bytes: int = 1 << 14
    lead_s: float | None = None


@dataclass
class StreamReport:
    """How a session went.

    Attributes
    ----------
    samples, packets : acknowledged.
    resent : packets sent again.
    reconnects : times the line came back.
    underruns : times the controller's buffer ran dry.
    lost_s : seconds the output was held.
    bad_there, bad_here : frames that were no packet, at the controller and here.
    late_s : frame -> how much later than its mark it went out by the controller's clock, counted from the first; of
        the latest `MOST_LATE` frames.
    reported_late_s : the same by the host's clock when the report came, so the line's delay is in it.
    least_buffer_s : smallest store in the controller between its first sample and the last one sent.
    buffer_s : what the controller has room for.
    longest_pause_s : longest time in which the host sent nothing, because its machine was busy with other things or the
        line took nothing.
    measured : frames of which a measurement came.
    """

    samples: int = 0
    packets: int = 0
    resent: int = 0
    reconnects: int = 0
    underruns: int = 0
    lost_s: float = 0.0
    bad_there: int = 0
    bad_here: int = 0
    late_s: dict[int, float] = field(default_factory=dict)
    reported_late_s: dict[int, float] = field(default_factory=dict)
    least_buffer_s: float = math.inf
    buffer_s: float = 0.0
    longest_pause_s: float = 0.0
    measured: int = 0


class _Phase(Enum):
    GREETING = 1
    STREAMING = 2
    FINISHED = 3


class HostSession:
    """Brings messages to a controller: each once, in order, whatever the line does to them.

    Call `connected` when the line is there, `receive` with what comes, and send what `poll` gives.

    Parameters
    ----------
    make : gives the messages for the controller that answers.
    session : any number from 1 to 2^32 - 1.
    on_measured : gets what was measured of each frame, in order. A frame whose packets the line lost is not among them,
        and none is where the controller does not measure.
    on_key : gets every key beside the grid that goes down or up, once and in order.
    """

    def __init__(
        self,
        make: Callable[[Capabilities], Iterator[Message]],
        *,
        session: int,
        timing: Timing,
        on_measured: Callable[[Measured], None] | None = None,
        on_key: Callable[[KeyEvent], None] | None = None,
    ) -> None:
        self._make = make
        self._session = session
        self._timing = timing
        self._reader = PacketReader()
        self._phase = _Phase.GREETING
        self._messages: Iterator[Message] | None = None
        self._waiting: Message | None = None
        self._window = UnderWay(timing.window, timing.resend_s)
        self._next = 0
        self._events = 0
        self._sampled, self._lead_s = 0, timing.lead_s
        self._keys, self._on_key, self._key_answer = KeyHearing(), on_key, b""
        self._ack: Ack | None = None
        self._hello_at = self._sent_at = -math.inf
        self._polled_at = math.inf
        self._first_mark: tuple[float, Marked] | None = None
        self._on_measured = on_measured
        self._frames: MeasuredFrames | None = None
        self.capabilities: Capabilities | None = None
        self.report = StreamReport()

    @property
    def finished(self) -> bool:
        """Whether everything was played."""
        return self._phase is _Phase.FINISHED

    @property
    def played_s(self) -> float:
        """Seconds of the waveform that were played, as last reported."""
        if self._ack is None or self.capabilities is None:
            return 0.0
        return self._ack.played / self.capabilities.rate_hz

    def connected(self) -> None:
        """The line is there (again): greet, then go on where the controller stands."""
        if self.capabilities is not None:
            self.report.reconnects += 1
        self._phase = _Phase.GREETING
        self._reader = PacketReader()
        self._hello_at = -math.inf
        self._polled_at = math.inf

    def receive(self, data: bytes, now: float) -> int:
        """Take bytes that came at `now`; returns how many packets were in them.

        Raises
        ------
        ControllerRefused, SessionLost
            When the session cannot go on.
        UnfitController
            When the controller is not one for these messages.
        """
        bad = self._reader.bad
        packets = self._reader.feed(data)
        self.report.bad_here += self._reader.bad - bad
        for packet in packets:
            if packet.kind is Kind.CAPABILITIES:
                self._greeted(Capabilities.of(packet), now)
            elif packet.kind is Kind.ACK and (ack := Ack.of(packet)) is not None:
                self._acknowledged(ack, now)
            elif packet.kind is Kind.MARKED:
                self._marked(Marked.of(packet), now)
            elif packet.kind is Kind.KEY:
                self._pressed(packet)
            elif packet.kind is Kind.MEASURED:
                self._measured(MeasuredPart.of(packet))
            elif packet.kind is Kind.REFUSED:
                refused = Refused.of(packet)
                raise ControllerRefused(f"the controller refused packet {refused.number}: {refused.why}")
        return len(packets)

    def poll(self, now: float) -> bytes:
        """The bytes to send at `now`."""
        if self._phase is _Phase.FINISHED:
            return b""
        if self._phase is _Phase.GREETING:
            if now - self._hello_at < self._timing.hello_s:
                return b""
            self._hello_at = now
            # The zero ends whatever the line had of a packet before.
            return DELIMITER + HELLO
        self.report.longest_pause_s = max(self.report.longest_pause_s, now - self._polled_at)
        self._polled_at = now
        out = bytearray(self._key_answer)
        self._key_answer = b""
        while len(out) < self._timing.burst_bytes:
            wire = self._window.take(now)
            if wire is not None:
                out += wire
            elif not self._pull():
                break
        self.report.resent = self._window.resent
        if not out and now - self._sent_at >= self._timing.heartbeat_s:
            out += HEARTBEAT
        if out:
            self._sent_at = now
        return bytes(out)

    def _pull(self) -> bool:
        """Put the next message into the window, if there is one, room and credit."""
        assert self._messages is not None
        if self._waiting is None and not self._far_ahead:
            self._waiting = next(self._messages, None)
        message, ack = self._waiting, self._ack
        if message is None or self._window.full:
            return False
        samples = 0
        if isinstance(message, SamplesMessage):
            if ack is None or message.first + len(message.codes) > ack.accept_samples:
                return False
            samples = len(message.codes)
            self._sampled = message.first + samples
        elif not isinstance(message, StartMessage | End):
            if ack is None or self._events >= ack.accept_events:
                return False
            self._events += 1
        self._window.add(self._next, encode(message.packet(self._next)), samples)
        self._next += 1
        self._waiting = None
        return True

    @property
    def _far_ahead(self) -> bool:
        """Whether what follows may wait: what is not asked for yet can still become something else."""
        found = self.capabilities
        if self._lead_s is None or found is None:
            return False
        # Before there were open sessions, half of the buffer had to be full.
        least = 0 if found.version >= OPEN_SINCE else found.buffer_samples / 2
        played = 0 if self._ack is None else self._ack.played
        return self._sampled - played >= max(least, self._lead_s * found.rate_hz)

    def _greeted(self, found: Capabilities, now: float) -> None:
        if self._phase is not _Phase.GREETING:
            return
        begun = self._ack is not None
        if self._messages is None:
            self._messages = self._make(found)
            self.capabilities = found
            self.report.buffer_s = found.buffer_samples / found.rate_hz
            self._frames = MeasuredFrames(self._session, found.rows * found.cols)
        elif begun and found.session != self._session:
            raise SessionLost(
                f"controller {found.name!r} came back without the session, at {self.played_s:.3f} s; play again"
            )
        if found.session == self._session:
            self._confirm(found.next_number, 0, now)
        self._window.again(now)
        self._phase = _Phase.STREAMING

    def _acknowledged(self, ack: Ack, now: float) -> None:
        if self._phase is not _Phase.STREAMING or ack.session != self._session:
            if self._phase is _Phase.STREAMING and self._ack is not None:
                raise SessionLost(f"the controller ended the session at {self.played_s:.3f} s; play again")
            return
        self._ack = ack
        self._confirm(ack.next_number, ack.kept or 0, now)
        report = self.report
        if ack.underruns > report.underruns and self._lead_s is not None:
            self._lead_s = max(self._lead_s, min(2 * self._lead_s, MOST_LEAD_S))
        report.underruns, report.lost_s, report.bad_there = ack.underruns, ack.held_ms / 1000, ack.bad
        streaming = self._waiting is not None or self._window
        if ack.state is State.PLAYING and ack.played and ack.received and streaming and self.capabilities is not None:
            stored = (ack.received - ack.played) / self.capabilities.rate_hz
            report.least_buffer_s = min(report.least_buffer_s, stored)
        if Flag.GAP in ack.flags:
            self._window.gap(now)
        if ack.state is State.DONE and not self._window and not streaming:
            self._phase = _Phase.FINISHED

    def _confirm(self, next_number: int, kept: int, now: float) -> None:
        self._window.arrived(next_number, kept, now)
        self.report.packets, self.report.samples = self._window.packets, self._window.samples

    def _marked(self, marked: Marked, now: float) -> None:
        if self.capabilities is None:
            return
        if self._first_mark is None:
            self._first_mark = (now, marked)
        began, first = self._first_mark
        wanted_s = (marked.at - first.at) / self.capabilities.rate_hz
        self.report.late_s[marked.frame] = 1e-6 * (marked.clock_us - first.clock_us) - wanted_s
        self.report.reported_late_s[marked.frame] = now - began - wanted_s
        for late_s in (self.report.late_s, self.report.reported_late_s):
            if len(late_s) > MOST_LATE:
                del late_s[next(iter(late_s))]

    def _pressed(self, packet: Packet) -> None:
        events = self._keys.take(packet)
        self._key_answer = encode(self._keys.answer)
        if self._on_key is not None:
            for event in events:
                self._on_key(event)

    def _measured(self, part: MeasuredPart) -> None:
        measured = None if self._frames is None else self._frames.take(part)
        if measured is not None:
            self.report.measured += 1
            if self._on_measured is not None:
                self._on_measured(measured)
