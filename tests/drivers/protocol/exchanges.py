"""What a host says to a controller of the trial grid, and when: the list that every controller has to answer alike."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from drivers.protocol.envelope import LONGEST_PIECE, Envelope
from drivers.protocol.keys import GridKey, KeyEvent, keyed
from drivers.protocol.measured import Measure, turns_of
from drivers.protocol.messages import Bias, LinkCoupling, Links, Mark, SamplesMessage, StartMessage, Tones, WireTone
from drivers.protocol.outgoing import End
from drivers.protocol.packet import Kind, Packet, encode
from tests.support.firmware import Request

RATE_HZ = 8000
STATUS, BEAT, STOP = (encode(Packet(kind)) for kind in (Kind.STATUS, Kind.HEARTBEAT, Kind.STOP))


def hello(version: int) -> bytes:
    return b"\0" + encode(Packet(Kind.HELLO, 0, version.to_bytes(2, "little")))


class Talk:
    """Requests in the making: time in ms, a little beside the samples so that no rounding decides."""

    def __init__(self, version: int | None = 5) -> None:
        self.requests: list[Request] = []
        self.ms = 0.0
        self.number = 0
        if version is not None:
            self.say(hello(version))

    def say(self, *data: bytes, wait_ms: float = 0.0, keys: tuple[KeyEvent, ...] = ()) -> Talk:
        """After a while, keys and bytes."""
        self.ms += wait_ms
        self.requests.append(Request(round(self.ms * 1000) + 60, b"".join(data), keys))
        return self

    def order(self, *messages: Any, wait_ms: float = 0.0) -> Talk:
        """After a while, the next ordered packets."""
        return self.say(*(self.next(message) for message in messages), wait_ms=wait_ms)

    def next(self, message: Any) -> bytes:
        """The bytes of the next ordered packet."""
        self.number += 1
        return encode(message.packet(self.number - 1))

    def beat(self, ms: float, every_ms: float = 17.0) -> Talk:
        """Be there for so long."""
        end = self.ms + ms
        while self.ms + every_ms < end:
            self.say(BEAT, wait_ms=every_ms)
        return self.say(STATUS, wait_ms=end - self.ms)

    def start(
        self, total: int, *, parametric: bool = False, session: int = 7, rate_hz: int = RATE_HZ, prefill: int = 0
    ) -> Talk:
        """A new session."""
        self.number = 0
        return self.order(StartMessage(session, parametric, rate_hz, total, b"note", prefill))


def codes(count: int, seed: int = 1) -> np.ndarray:
    return np.random.default_rng(seed).integers(-32767, 32768, (count, 2), dtype=np.int16)


def cut(block: np.ndarray, first: int = 0) -> list[SamplesMessage]:
    """Samples in packets of 500."""
    return [SamplesMessage(first + at, block[at : at + 500]) for at in range(0, len(block), 500)]


def greeting() -> Talk:
    talk = Talk(None).say(STATUS).say(BEAT, wait_ms=3)
    for version in (0, 1, 2, 3, 4, 5, 6, 256, 65535):
        talk.say(hello(version), STATUS, wait_ms=5)
    return talk


def spoiled_frames() -> Talk:
    good = encode(Packet(Kind.HEARTBEAT))
    wrong = bytes([good[0], good[1] ^ 2, *good[2:]])
    long = encode(Packet(Kind.SAMPLES, 0, bytes(4096))).replace(b"\0", b"") + bytes([5]) * 8000 + b"\0"
    return Talk().say(wrong, b"\0\0\0", b"\x05\x01\0", long, good[:-1], wait_ms=2).say(b"\0", STATUS, wait_ms=2)


def samples() -> Talk:
    talk, block = Talk().start(4000), codes(4000)
    for first in range(0, 4000, 400):
        talk.order(SamplesMessage(first, block[first : first + 400]), wait_ms=37)
    return talk.order(End(4000)).beat(400)


def early() -> Talk:
    talk, block = Talk().start(400), codes(400)
    packets = [talk.next(SamplesMessage(first, block[first : first + 40])) for first in range(0, 400, 40)]
    talk.say(packets[1], packets[3], packets[3], wait_ms=1).say(packets[0], wait_ms=1).say(packets[0], packets[2])
    return talk.say(*packets[5:], wait_ms=1).say(packets[4], talk.next(End(400)), wait_ms=2).beat(150)


def early_for_version_1() -> Talk:
    talk, block = Talk(1).start(80), codes(80)
    packets = [talk.next(SamplesMessage(first, block[first : first + 40])) for first in (0, 40)]
    return talk.say(packets[1]).say(STATUS, wait_ms=1).say(packets[0], wait_ms=1).say(packets[1], wait_ms=1)


def too_early() -> Talk:
    talk = Talk().start(400)
    far = encode(Mark(0, 1).packet(34))
    near = encode(Mark(0, 1).packet(33))
    return talk.say(near, wait_ms=1).say(far, wait_ms=1).say(STOP, wait_ms=1).say(near, wait_ms=1)


def starts() -> Talk:
    talk = Talk().start(400).start(800).start(400, session=0).say(STATUS, wait_ms=1)
    talk.say(encode(StartMessage(9, False, RATE_HZ, 10).packet(3)), wait_ms=1)
    block = codes(1000)
    talk.start(1000, session=8).order(SamplesMessage(0, block), wait_ms=1).beat(60)
    return talk.start(500, session=9).beat(60).order(SamplesMessage(0, block[:500]), End(500)).beat(100)


def wrong_rate() -> Talk:
    return Talk().start(10, rate_hz=44100).say(STATUS, wait_ms=3).start(10, session=8).say(STATUS, wait_ms=3)


def refused(message: Any, *, before: tuple[Any, ...] = (), parametric: bool = False) -> Callable[[], Talk]:
    """One packet that cannot be, what follows it, and the next session."""

    def talk() -> Talk:
        out = Talk().start(4000, parametric=parametric).order(*before, wait_ms=1).order(message, wait_ms=1)
        out.number -= 1
        out.order(Mark(0, 0), wait_ms=1)
        return out.start(80, session=8).order(SamplesMessage(0, codes(80)), End(80), wait_ms=1).beat(80)

    return talk


class Raw:
    """A packet of any bytes."""

    def __init__(self, kind: Kind, payload: bytes) -> None:
        self._kind, self._payload = kind, payload

    def packet(self, number: int) -> Packet:
        return Packet(self._kind, number, self._payload)


def spoiled_code() -> np.ndarray:
    block = codes(4)
    block[2, 1] = -32768
    return block


def piece(*points: complex, ramp: int = 100, channel: int = 0) -> Envelope:
    return Envelope(0, channel, ramp, 1 << 57, points)


def marks() -> Talk:
    talk = Talk().start(800, parametric=True)
    talk.order(Mark(0, 5, b"note"), Mark(0, 6), Mark(399, 7), Mark(799, 8), End(800), wait_ms=1)
    return talk.beat(150)


def too_many_events() -> Talk:
    talk = Talk().start(8000, parametric=True)
    return (
        talk.order(*(Mark(100 * k, k) for k in range(8)), wait_ms=1)
        .beat(40)
        .order(*(Mark(4000, k) for k in range(15)), wait_ms=1)
    )


def links() -> Talk:
    talk = Talk().start(1600, parametric=True)
    talk.order(
        LinkCoupling(0, 0, 0, (100, 65535)), LinkCoupling(0, 1, 333, (65535, 1)), LinkCoupling(100, 1, 50, (0, 65535)),
        LinkCoupling(120, 0, 1, (7, 8)), LinkCoupling(500, 0, 700, (60000, 12345)), End(1600), wait_ms=1,
    )  # fmt: skip
    return talk.beat(150).say(STOP, wait_ms=5).beat(40)


def finer_links() -> Talk:
    talk = Talk(6).start(1600, parametric=True)
    talk.order(
        Links(0, 0, 0, (0.123456789, 1.0)), Links(0, 1, 300, (1.0, 1e-6)), LinkCoupling(400, 1, 100, (0, 65535)),
        Links(450, 1, 70, (0.3333333, 0.0)), Links(700, 0, 800, (1e-9, 0.7)), End(1600), wait_ms=1,
    )  # fmt: skip
    return talk.beat(250)


def biases() -> Talk:
    talk = Talk().start(1600, parametric=True)
    talk.order(
        Bias(0, 0, 0, 33.3), Bias(0, 1, 400, -100.0), Bias(200, 1, 300, 50.0), Bias(200, 0, 1, -20.0),
        Bias(600, 0, 500, 0.0), Bias(1200, 0, 0, 10.0), End(1600), wait_ms=1,
    )  # fmt: skip
    return talk.beat(300)


def tones() -> Talk:
    talk, a = Talk().start(2400, parametric=True), WireTone(40.0, 133.3, 0.5)
    b, c = WireTone(30.0, 270.0, -2.0), WireTone(20.0, 3999.0, 1e3)
    talk.order(
        Tones(0, 0, 0, (a, b)), Tones(0, 1, 500, (c,)), Tones(300, 1, 400, (a,)), Tones(450, 1, 100, (b,)),
        Tones(1200, 0, 200, ()), Bias(1300, 1, 100, 90.0), End(2400), wait_ms=1,
    )  # fmt: skip
    return talk.beat(400)


def envelopes() -> Talk:
    talk, turns = Talk().start(2400, parametric=True), turns_of(2 * math.pi * 150.0, 1 / RATE_HZ)
    other = turns_of(2 * math.pi * 266.0, 1 / RATE_HZ)
    talk.order(
        Envelope(0, 0, 400, turns, (0j, 10 + 5j, 50 - 20j, 40 + 30j)),
        Envelope(0, 1, 700, 0, (0j, 0j, 60 + 0j, 50 + 0j)),
        Envelope(0, 1, 700, other, (0j, 0j, 10 + 0j, 10 + 10j)),
        Envelope(400, 0, 1, turns, (40 + 30j, 40 + 30j, -10j, -10j)),
        Envelope(500, 0, 0, turns, (60 + 0j,)),
        Envelope(900, 0, 600, turns, (60 + 0j, 60 + 0j, 0j, 0j)),
        Envelope(1000, 1, 0, other, (0j,)),
        Envelope(2000, 1, 399, 0, (50 + 0j, 50 + 0j, 0j, 0j)),
        End(2400), wait_ms=1,
    )  # fmt: skip
    return talk.beat(400)


def silence() -> Talk:
    talk, block = Talk().start(3000), codes(3000)
    talk.order(*cut(block[:1500]), wait_ms=1).beat(40)
    talk.say(b"", wait_ms=149).say(b"", wait_ms=20).say(b"", wait_ms=100)
    talk.order(*cut(block[1500:], 1500), End(3000), wait_ms=50)
    return talk.beat(400)


def silence_of_tones() -> Talk:
    talk = Talk().start(4000, parametric=True).order(Tones(0, 0, 0, (WireTone(80.0, 100.0, 0.0),)), End(4000))
    return talk.beat(100).say(b"", wait_ms=160).say(BEAT, wait_ms=10).beat(600)


def underrun() -> Talk:
    talk, block = Talk().start(3000), codes(3000)
    talk.order(SamplesMessage(0, block[:1000]), wait_ms=1).beat(250)
    return talk.order(*cut(block[1000:], 1000), End(3000), wait_ms=1).beat(400)


def late_end() -> Talk:
    talk = (
        Talk().start(304, parametric=True).order(Bias(0, 0, 0, 50.0), *(Mark(10 * k, k) for k in range(7)), wait_ms=1)
    )
    return talk.beat(200).order(End(304), wait_ms=1).beat(150)


def stop() -> Talk:
    talk = Talk().start(2000).order(*cut(codes(1900)), wait_ms=1).beat(50)
    talk.say(STOP, wait_ms=1).say(STATUS, wait_ms=10).say(STATUS, wait_ms=50)
    return talk.start(80, session=8).order(SamplesMessage(0, codes(80)), End(80), wait_ms=1).beat(80).say(STOP)


def greeted_again() -> Talk:
    talk = Talk().start(2000).order(SamplesMessage(0, codes(2000)[:900]), wait_ms=1)
    return talk.say(hello(3), wait_ms=5).order(*cut(codes(1100), 900), wait_ms=1).say(hello(2))


def open_session() -> Talk:
    talk, block = Talk().start(0, prefill=160), codes(480)
    talk.order(SamplesMessage(0, block[:150]), wait_ms=1).order(SamplesMessage(150, block[150:200]), wait_ms=3)
    talk.order(SamplesMessage(200, block[200:240]), wait_ms=20).beat(40)
    return talk.order(SamplesMessage(240, block[240:]), wait_ms=80).order(End(480), wait_ms=3).beat(200)


def open_parametric_session() -> Talk:
    talk = Talk().start(0, parametric=True).order(*(Bias(50 * k, 0, 50, 9.0 * k) for k in range(8)), wait_ms=1)
    return talk.beat(100).order(End(900), wait_ms=1).beat(150)


def prefill_that_is_not_there() -> Talk:
    start = StartMessage(7, False, RATE_HZ, 100, prefill=50).packet(0)
    short = Packet(start.kind, 0, start.payload[:-1])
    return Talk().say(encode(short), STATUS, wait_ms=1)


def keys() -> Talk:
    down, up = KeyEvent(GridKey.NEXT), KeyEvent(GridKey.NEXT, False)
    talk = Talk(None).say(STATUS, wait_ms=1, keys=(down,)).say(hello(3)).say(STATUS, wait_ms=1, keys=(down,))
    talk.say(hello(4)).say(STATUS, wait_ms=1, keys=(down, up)).say(STATUS, wait_ms=30).say(STATUS, wait_ms=21)
    talk.say(encode(keyed(1)), wait_ms=5).say(STATUS, wait_ms=46).say(encode(keyed(9)), wait_ms=1, keys=(down,))
    talk.say(encode(keyed(3)), wait_ms=1).say(STATUS, wait_ms=60)
    talk.say(BEAT, wait_ms=1, keys=tuple(KeyEvent.over(cell) for cell in range(18)))
    return talk.say(hello(5), wait_ms=2).say(BEAT, wait_ms=51, keys=(up,))


REFUSALS: dict[str, Callable[[], Talk]] = {
    "samples of another count": refused(Raw(Kind.SAMPLES, bytes(8) + b"\x03\0" + bytes(8))),
    "no samples": refused(Raw(Kind.SAMPLES, bytes(10))),
    "samples from elsewhere": refused(SamplesMessage(5, codes(4))),
    "samples in a parametric session": refused(SamplesMessage(0, codes(4)), parametric=True),
    "samples over the credit": refused(
        SamplesMessage(2000, codes(4)), before=(SamplesMessage(0, codes(1000)), SamplesMessage(1000, codes(1000)))
    ),
    "a code that is none": refused(SamplesMessage(0, spoiled_code())),
    "an event in the past": refused(Mark(99, 1), before=(Mark(100, 0),)),
    "a row that is not there": refused(LinkCoupling(0, 2, 0, (0, 0))),
    "too few links": refused(LinkCoupling(0, 0, 0, (0,))),
    "finer links over lam_max": refused(Links(0, 0, 0, (0.5, 1.1))),
    "finer links below zero": refused(Links(0, 0, 0, (0.5, -1e-3))),
    "finer links that are no number": refused(Links(0, 0, 0, (math.nan, 0.5))),
    "finer links of no row": refused(Links(0, 2, 0, (0.5, 0.5))),
    "too many finer links": refused(Links(0, 0, 0, (0.5, 0.5, 0.5))),
    "a bias over full volts": refused(Bias(0, 0, 0, 100.5)),
    "a bias that is no number": refused(Bias(0, 0, 0, math.nan)),
    "a channel that is not there": refused(Bias(0, 2, 0, 1.0)),
    "tones over full volts": refused(Tones(0, 0, 0, (WireTone(60.0, 1.0, 0.0), WireTone(-41.0, 2.0, 0.0)))),
    "a tone that is no number": refused(Tones(0, 0, 0, (WireTone(1.0, math.inf, 0.0),))),
    "tones of no channel": refused(Tones(0, 9, 0, ())),
    "a measurement": refused(Measure(0, 10, 0, (0,))),
    "an end too soon": refused(End(3999), parametric=True),
    "an end without its samples": refused(End(4000)),
    "an envelope of two points": refused(piece(0j, 1j)),
    "an envelope of no length": refused(piece(0j, 0j, 0j, 1j, ramp=0)),
    "an envelope too long": refused(piece(0j, 0j, 0j, 1j, ramp=LONGEST_PIECE + 1)),
    "an envelope over full volts": refused(piece(0j, 80 + 61j, 0j, 1j)),
    "an envelope that is no number": refused(piece(complex(math.nan, 0), ramp=0)),
    "an envelope of no channel": refused(piece(0j, 0j, 0j, 1j, channel=2)),
}

EXCHANGES: dict[str, Callable[[], Talk]] = {
    "greeting": greeting, "spoiled frames": spoiled_frames, "samples": samples, "early": early,
    "early for version 1": early_for_version_1, "too early": too_early, "starts": starts, "wrong rate": wrong_rate,
    "marks": marks, "too many events": too_many_events, "links": links, "finer links": finer_links,
    "biases": biases, "tones": tones,
    "envelopes": envelopes, "silence": silence, "silence of tones": silence_of_tones, "underrun": underrun,
    "late end": late_end, "open session": open_session, "open parametric session": open_parametric_session,
    "prefill that is not there": prefill_that_is_not_there, "keys": keys, "stop": stop,
    "greeted again": greeted_again, **REFUSALS,
}  # fmt: skip
