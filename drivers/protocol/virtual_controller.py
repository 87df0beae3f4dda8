"""The controller that is not there: speaks PROTOCOL.md, checks what it is sent, and plays it on its own clock.

What it does not imitate: electrical noise, the response of an amplifier, and the jitter of a real sample clock.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable
from functools import partial
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from .early import EarlyPackets
from .envelope import LONGEST_PIECE, Envelope
from .keys import KeyEvent, KeyWaiting
from .measured import Measure, parts_of
from .messages import VERSION, Bias, Codes, LinkCoupling, Links, Mark, SamplesMessage, StartMessage, Tones
from .metering import Meter, Senses
from .packet import MAX_PAYLOAD, ORDERED, Kind, Packet, PacketReader, encode
from .playout import ControllerSpec, Event, OutputBlock, Playout
from .replies import Ack, Capabilities, Flag, Refused, State

__all__ = ["Recorder", "VirtualController"]

ACK_EVERY_S = 0.02
KEYS_SINCE = 4  # the version from which on a host is told of keys


class Recorder(Protocol):
    """Keeps what arrives, in the order of the session."""

    def start(self, start: StartMessage) -> None:
        """A session begins."""
        ...

    def samples(self, codes: Codes) -> None:
        """Samples, int16, shape (S, channels)."""
        ...

    def drawn(self, volts: NDArray[np.float64]) -> None:
        """Samples of a session without samples, as the controller draws them; float64, shape (S, channels), volts."""
        ...

    def event(self, event: Event) -> None:
        """Something to do at a sample."""
        ...

    def end(self) -> None:
        """The session is complete."""
        ...


class _Refusal(Exception):
    """An ordered packet cannot be carried out; the text says why."""


class VirtualController:
    """A controller as bytes in, bytes out and a clock that is given to it.

    Parameters
    ----------
    spec : what it is built for.
    now : seconds, any origin; all later times must not be before it.
    name : for its greeting.
    on_output : gets every block that goes out.
    recorder : gets everything that arrives, once and in order.
    senses : what the actuators sense of themselves; None: it does not measure.
    """

    def __init__(
        self,
        spec: ControllerSpec,
        *,
        now: float,
        name: str = "virtual",
        on_output: Callable[[OutputBlock], None] | None = None,
        recorder: Recorder | None = None,
        senses: Senses | None = None,
    ) -> None:
        self.spec = spec
        self.name = name
        self._on_output = on_output
        self._meter = None if senses is None else Meter(spec.rows, spec.cols, senses)
        seen = any(one is not None for one in (on_output, senses, recorder))
        self.playout = Playout(spec, now, self._put_out if seen else None)
        self.session = 0
        self._recorder, self._drawing = recorder, False
        self._reader = PacketReader()
        self._early = EarlyPackets(spec.early_packets)
        self._keys = KeyWaiting()
        self._version = 1
        self._next = 0
        self._events = 0
        self._gap = False
        self._ack_due = False
        self._ack_at = now
        self._heard = now
        self._now = now
        self._out = bytearray()

    @property
    def bad(self) -> int:
        """How many frames were no packet so far."""
        return self._reader.bad

    def receive(self, data: bytes, now: float) -> None:
        """Take bytes that came at `now`."""
        self.tick(now)
        for packet in self._reader.feed(data):
            self._heard, self.playout.alive = now, True
            self._take(packet)
        self.playout.start_if_ready()

    def tick(self, now: float) -> None:
        """Let time pass: play what is due; ramp to zero when the host has been silent for too long."""
        # The ramp begins so early that its end, not its beginning, falls on the watchdog time.
        deadline = self._heard + self.spec.watchdog_s - self.spec.ramp_s
        if self.playout.alive and now > deadline:
            self._advance(max(deadline, self._now))
            self.playout.alive = False
            self.playout.hold()
        self._advance(now)
        if self.session and now - self._ack_at >= ACK_EVERY_S:
            self._ack_due = True

    def press(self, key: KeyEvent) -> None:
        """A key beside the grid went down or up; a host that knows of keys is told until it has it."""
        if self._version >= KEYS_SINCE:
            self._keys.press(key, self._now)

    def outgoing(self) -> bytes:
        """The bytes to send to the host, once."""
        if (keys := self._keys.due(self._now)) is not None:
            self._send(keys)
        if self._ack_due:
            self._send(self._ack().packet())
            self._ack_due = self._gap = False
            self._ack_at = self._now
        out = bytes(self._out)
        self._out.clear()
        return out

    def _advance(self, now: float) -> None:
        for marked in self.playout.advance(now):
            self._send(marked.packet())
        if self._drawing and self._recorder is not None and self.playout.state is State.DONE:
            self._drawing = False
            self._recorder.end()
        for measured in () if self._meter is None else self._meter.finished():
            for part in parts_of(measured, self.session):
                self._send(part.packet())
        self._now = now

    def _put_out(self, block: OutputBlock) -> None:
        if self._meter is not None:
            self._meter.take(block)
        if self._drawing and self._recorder is not None and block.live:
            self._recorder.drawn(block.volts)
        if self._on_output is not None:
            self._on_output(block)

    def _send(self, packet: Packet) -> None:
        self._out += encode(packet)

    def _take(self, packet: Packet) -> None:
        if packet.kind is Kind.HELLO:
            # A host that has not greeted, or only knows version 1, gets the ACK of version 1.
            self._version = max(1, min(VERSION, int.from_bytes(packet.payload, "little")))
            self._keys.clear()
            self._send(self._capabilities().packet())
        elif packet.kind is Kind.STOP:
            self.playout.hold(State.STOPPED)
            self.playout.clear()
            self._forget()
            self.session, self._ack_due, self._drawing = 0, True, False
        elif packet.kind is Kind.KEYED:
            self._keys.answered(packet)
        elif packet.kind in (Kind.STATUS, Kind.HEARTBEAT):
            self._ack_due = True
        elif packet.kind in ORDERED:
            self._ack_due = True
            self._take_ordered(packet)

    def _take_ordered(self, packet: Packet) -> None:
        if packet.kind is Kind.START:
            start = StartMessage.of(packet)
            if start is None or packet.number != 0 or start.session in (0, self.session):
                return
            self._try(packet.number, lambda: self._start(start))
        elif not self.session or packet.number > self._next:
            # A host of version 1 cannot be told what is kept, and sends everything again.
            kept = self.session and self._version > 1 and self._early.keep(packet, self._next)
            self._gap = self._gap or not kept
        else:
            due: Packet | None = packet
            while due is not None and due.number == self._next:
                self._try(due.number, partial(self._carry_out, due))
                due = self._early.take(self._next)

    def _try(self, number: int, work: Callable[[], None]) -> None:
        try:
            work()
        except _Refusal as refusal:
            self.playout.hold(State.STOPPED)
            self._early.clear()
            self._send(Refused(number, str(refusal)).packet())
        else:
            self._next = number + 1

    def _start(self, start: StartMessage) -> None:
        if start.rate_hz != self.spec.rate_hz:
            raise _Refusal(f"the rate is {self.spec.rate_hz} Hz, not {start.rate_hz}")
        self.playout.begin(start.parametric, start.total, start.prefill)
        self._forget()
        self.session, self._events, self._total = start.session, 0, start.total
        if self._recorder is not None:
            self._recorder.start(start)
        self._drawing = start.parametric

    def _forget(self) -> None:
        self._early.clear()
        if self._meter is not None:
            self._meter.clear()

    def _carry_out(self, packet: Packet) -> None:
        if self.playout.state is State.STOPPED:
            raise _Refusal("stopped after a refusal; begin a new session")
        if packet.kind is Kind.SAMPLES:
            self._samples(packet)
        elif packet.kind is Kind.END:
            self._end(struct.unpack("<Q", packet.payload)[0])
        else:
            self._event(_event(packet))

    def _samples(self, packet: Packet) -> None:
        samples = SamplesMessage.of(packet, self.spec.channels)
        received = self.playout.received
        if samples is None:
            raise _Refusal(f"samples must be a whole number of {self.spec.channels} channels, and their count true")
        if self.playout.parametric or samples.first != received:
            raise _Refusal(f"samples from {received} on are wanted, not {samples.first}")
        if received + len(samples.codes) > self.playout.played + self.spec.buffer_samples:
            raise _Refusal("more samples than the credit allows")
        if (samples.codes == -32768).any():
            raise _Refusal("sample code -32768 is not used")
        self.playout.push(samples.codes)
        if self._recorder is not None:
            self._recorder.samples(samples.codes)

    def _event(self, event: Event) -> None:
        playout = self.playout
        if event.at < max(playout.last_event_at, playout.played):
            raise _Refusal(f"an event at sample {event.at} comes too late")
        if self._events >= playout.events_done + self.spec.event_slots:
            raise _Refusal("more events than the credit allows")
        self._check(event)
        self._events += 1
        playout.push_event(event)
        if isinstance(event, Measure) and self._meter is not None:
            self._meter.ask(event)
        if self._recorder is not None:
            self._recorder.event(event)

    def _check(self, event: Event) -> None:
        spec = self.spec
        if isinstance(event, LinkCoupling):
            fits = event.row < spec.rows and len(event.codes) == spec.cols - 1
            if not fits or max(event.codes, default=0) * spec.lam_step > spec.lam_max * (1 + 1e-6):
                raise _Refusal(f"coupling: rows 0..{spec.rows - 1}, {spec.cols - 1} links of at most lam_max")
        elif isinstance(event, Links):
            fits = event.row < spec.rows and len(event.lam) == spec.cols - 1
            if not fits or not all(0 <= lam <= spec.lam_max * (1 + 1e-6) for lam in event.lam):
                raise _Refusal(f"links: rows 0..{spec.rows - 1}, {spec.cols - 1} links of 0 to lam_max")
        elif isinstance(event, Envelope):
            if event.channel >= spec.channels or not event.fits(spec.full_volts):
                pieces = f"1 point or 4 over 1 to {LONGEST_PIECE} samples"
                raise _Refusal(f"envelope: channels 0..{spec.channels - 1}, {pieces}, at most full_volts")
        elif isinstance(event, Measure):
            if self._meter is None or not event.samples or not 1 <= len(event.turns) <= spec.rows:
                why = f"at least 1 sample and phases of 1 to {spec.rows} rows"
                raise _Refusal(f"measure: {why}" if self._meter else "this controller does not measure")
        elif not isinstance(event, Mark):
            volts = [event.volts] if isinstance(event, Bias) else [tone.volts for tone in event.tones]
            rest = [] if isinstance(event, Bias) else [n for tone in event.tones for n in (tone.hz, tone.phase)]
            fits = event.channel < spec.channels and all(map(math.isfinite, (*volts, *rest)))
            if not fits or sum(map(abs, volts)) > spec.full_volts:
                raise _Refusal(f"channels 0..{spec.channels - 1}, at most full_volts in all")

    def _end(self, total: int) -> None:
        announced = self._total or total
        if total != announced or (not self.playout.parametric and total != self.playout.received):
            raise _Refusal(f"the end at sample {total}, where {self.playout.received} of {announced} are here")
        self.playout.end(total)
        # What the controller draws itself is complete when it has gone out.
        if self._recorder is not None and not self._drawing:
            self._recorder.end()

    def _capabilities(self) -> Capabilities:
        spec = self.spec
        return Capabilities(
            version=self._version, rows=spec.rows, cols=spec.cols, channels=spec.channels, rate_hz=spec.rate_hz,
            bits=16, buffer_samples=spec.buffer_samples, event_slots=spec.event_slots, max_payload=MAX_PAYLOAD,
            full_volts=spec.full_volts, lam_step=spec.lam_step, lam_max=spec.lam_max,
            watchdog_ms=round(spec.watchdog_s * 1000), ramp_ms=round(spec.ramp_s * 1000),
            session=self.session, next_number=self._next if self.session else 0, name=self.name,
            measures=self._meter is not None,
        )  # fmt: skip

    def _ack(self) -> Ack:
        playout = self.playout
        return Ack(
            session=self.session, next_number=self._next if self.session else 0,
            accept_samples=playout.played + self.spec.buffer_samples,
            accept_events=playout.events_done + self.spec.event_slots,
            received=playout.received, played=playout.played, state=playout.state,
            flags=Flag.GAP if self._gap else Flag(0), underruns=playout.underruns,
            bad=self._reader.bad & 0xFFFFFFFF, held_ms=round(playout.held_s * 1000),
            clock_us=round(self._now * 1e6),
            kept=self._early.bits(self._next) if self._version > 1 else None,
        )  # fmt: skip


def _event(packet: Packet) -> Event:
    kinds: dict[Kind, type[Event]] = {
        Kind.COUPLING: LinkCoupling,
        Kind.LINKS_TO: Links,
        Kind.BIAS: Bias,
        Kind.TONES: Tones,
        Kind.MARK: Mark,
        Kind.MEASURE: Measure,
        Kind.ENVELOPE: Envelope,
    }
    return kinds[packet.kind].of(packet)
