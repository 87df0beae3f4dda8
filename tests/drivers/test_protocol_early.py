"""Packets out of order: kept in bounded memory, told in the ACK, sent again once; versions 1 and 2 together."""

from __future__ import annotations

import random
import shutil
import struct
import subprocess
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from drivers.protocol.early import MOST_EARLY, EarlyPackets
from drivers.protocol.faults import Faults, FaultyLine
from drivers.protocol.host_session import HELLO, STOP, HostSession, Timing
from drivers.protocol.messages import VERSION, LinkCoupling, Mark, SamplesMessage, StartMessage
from drivers.protocol.outgoing import Message
from drivers.protocol.packet import Kind, Packet, PacketReader, encode
from drivers.protocol.playout import ControllerSpec, Event
from drivers.protocol.replies import Ack, Capabilities, Flag, Marked, State
from drivers.protocol.under_way import UnderWay
from drivers.protocol.virtual_controller import VirtualController
from tests.support.everyday import one_in
from tests.support.wire import SPEC, stream

ROOT = Path(__file__).resolve().parents[2]
SANITIZERS = ["-fsanitize=address,undefined", "-fno-sanitize-recover=all"]
# The widest stream of the built-in profiles, whose packets carry 6 ms.
WIDE = replace(SPEC, rows=6, cols=6, channels=42, buffer_samples=4000, event_slots=256)


def codes_of(seconds: float, seed: int, spec: ControllerSpec = SPEC) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return rng.integers(-9, 9, (round(seconds * spec.rate_hz), spec.channels), dtype=np.int16)


@dataclass
class Kept:
    """A recorder that keeps the samples."""

    blocks: list[np.ndarray] = field(default_factory=list)

    def start(self, start: StartMessage) -> None:
        pass

    def samples(self, codes: np.ndarray) -> None:
        self.blocks.append(codes)

    def drawn(self, volts: np.ndarray) -> None:
        pass

    def event(self, event: Event) -> None:
        pass

    def end(self) -> None:
        pass

    @property
    def codes(self) -> np.ndarray:
        return np.concatenate(self.blocks)


class Bench:
    """A host, a controller, the two directions of a line between them, and a clock."""

    def __init__(self, codes: np.ndarray, marks: list[int], faults: Faults, spec: ControllerSpec = SPEC, seed: int = 1):
        self.now = 100.0
        self.kept = Kept()
        self.controller = VirtualController(spec, now=self.now, recorder=self.kept)
        self.session = HostSession(partial(stream, codes, marks), session=7, timing=Timing())
        self.there, self.back = (FaultyLine(faults, seed=seed + way, now=self.now) for way in (0, 1))
        self.session.connected()

    def run(self, limit_s: float) -> None:
        end = self.now + limit_s
        while not self.session.finished:
            assert self.now < end, f"stuck at {self.session.played_s} s"
            self.now += 0.001
            self.session.receive(self.back.take(self.now), self.now)
            self.there.put(self.session.poll(self.now), self.now)
            self.controller.receive(self.there.take(self.now), self.now)
            self.back.put(self.controller.outgoing(), self.now)


def send(controller: VirtualController, now: float, *packets: Packet) -> list[Packet]:
    controller.receive(b"".join(map(encode, packets)), now)
    return PacketReader().feed(controller.outgoing())


@pytest.mark.parametrize("seed", one_in(2, range(2)))
@pytest.mark.parametrize("each", one_in(3, [0.03, 0.005, 0.015, 0.1]), ids=str)
def test_what_is_sent_again_is_what_was_lost(each: float, seed: int) -> None:
    codes = codes_of(8.0, seed, WIDE)
    bench = Bench(codes, [*range(0, len(codes), 4000)], Faults(drop=each, corrupt=each), WIDE, 10 * seed)
    bench.run(60.0)
    report = bench.session.report
    np.testing.assert_array_equal(bench.kept.codes, codes)
    spoiled = bench.there.dropped + bench.there.corrupted
    # A byte too few at the end of a packet takes the next one along.
    assert 0.9 * spoiled <= report.resent <= 1.1 * spoiled + 3
    assert (report.underruns, report.lost_s) == (0, 0.0)
    if each == 0.015:
        # Three of a hundred packets are spoiled.
        assert report.resent <= 0.05 * report.packets


@pytest.mark.parametrize("room", [0, 1, 5, 31])
def test_a_controller_with_less_memory_gets_everything_too(room: int) -> None:
    codes, faults = codes_of(2.0, room), Faults(drop=0.03, corrupt=0.03, duplicate=0.1)
    bench = Bench(codes, [0, 8000], faults, replace(SPEC, early_packets=room))
    bench.run(20.0)
    np.testing.assert_array_equal(bench.kept.codes, codes)
    assert bench.session.report.underruns == 0


def test_a_lost_packet_is_sent_again_once_in_a_round_trip() -> None:
    window = UnderWay(8, 0.1)
    for number in range(8):
        window.add(number, bytes([number]), 0)

    def sent(now: float) -> bytes:
        return b"".join(iter(partial(window.take, now), None))

    assert sent(1.0) == bytes(range(8))
    window.arrived(2, 0b1, 1.01)  # 0 and 1 arrived, 3 is kept: 2 was lost
    assert sent(1.01) == bytes([2])
    # Later ACKs that know of no packet sent after it say nothing about it.
    for kept in (0b1, 0b11, 0b11, 0b11111):
        window.arrived(2, kept, 1.02)
        assert sent(1.02) == b""
    # 8 was sent after it, and is here: lost again.
    window.add(8, bytes([8]), 0)
    assert sent(1.03) == bytes([8])
    window.arrived(2, 0b111111, 1.04)
    assert sent(1.04) == bytes([2])
    window.arrived(9, 0, 1.05)
    assert (len(window), window.packets, window.resent) == (0, 9, 2)
    # With nothing after it, only time tells; packets that were sent once took 50 ms, so 100 ms it is.
    window.add(9, bytes([9]), 0)
    assert sent(2.0) == bytes([9])
    assert sent(2.09) == b""
    assert sent(2.11) == bytes([9])


def test_a_long_line_is_not_taken_for_a_broken_one() -> None:
    codes = codes_of(3.0, 1)
    bench = Bench(codes, [], Faults(delay_s=0.075))
    bench.run(10.0)
    np.testing.assert_array_equal(bench.kept.codes, codes)
    # Only the first packet is sent before anything is known about the line.
    assert bench.session.report.resent <= 2
    assert bench.session.report.underruns == 0


def greeted(version: int, **options: Any) -> VirtualController:
    controller = VirtualController(replace(SPEC, **options), now=0.0, recorder=Kept())
    send(
        controller,
        0.0,
        Packet(Kind.HELLO, 0, version.to_bytes(2, "little")),
        StartMessage(7, False, 8000, 8000).packet(0),
    )
    return controller


def acks(answers: list[Packet]) -> Ack:
    ack = Ack.of(next(packet for packet in answers if packet.kind is Kind.ACK))
    assert ack is not None
    return ack


def block(number: int) -> Packet:
    """Sample `number` - 1 of the session, alone in its packet."""
    return SamplesMessage(number - 1, np.full((1, 2), number, dtype=np.int16)).packet(number)


def test_early_packets_wait_for_their_turn_and_are_told() -> None:
    controller = greeted(VERSION)
    ack = acks(send(controller, 0.0, block(3), block(5), block(3)))
    assert (ack.next_number, ack.kept, ack.flags, ack.received) == (1, 0b1010, Flag(0), 0)
    ack = acks(send(controller, 0.0, block(1), block(2)))
    assert (ack.next_number, ack.kept, ack.received) == (4, 0b1, 3)
    ack = acks(send(controller, 0.0, block(4)))
    assert (ack.next_number, ack.kept, ack.received) == (6, 0, 5)
    recorder = controller._recorder
    assert isinstance(recorder, Kept)
    assert recorder.codes[:, 0].tolist() == [1, 2, 3, 4, 5]


@pytest.mark.parametrize("number", [1 + MOST_EARLY + 1, 1000, 2**31, 2**32 - 1])
def test_packets_far_ahead_are_thrown_away(number: int) -> None:
    controller = greeted(VERSION)
    far = Mark(0, 1).packet(number)
    ack = acks(send(controller, 0.0, far, Mark(0, 1).packet(1 + MOST_EARLY)))
    assert (ack.kept, ack.flags) == (1 << MOST_EARLY - 1, Flag.GAP)
    for packet in (Mark(0, 2).packet(n) for n in range(2, 500)):
        controller.receive(encode(packet), 0.0)
    assert acks(send(controller, 0.0)).kept == 2**32 - 1


@pytest.mark.parametrize("end", ["start", "stop", "refused"])
def test_what_was_kept_does_not_outlive_its_session(end: str) -> None:
    controller = greeted(VERSION)
    assert acks(send(controller, 0.0, block(2), block(3))).kept == 0b11
    if end == "stop":
        controller.receive(STOP, 0.0)
    elif end == "refused":
        send(controller, 0.0, LinkCoupling(0, 99, 0, (1, 1)).packet(1))
    send(controller, 0.0, StartMessage(8, False, 8000, 8000).packet(0))
    ack = acks(send(controller, 0.0, block(1)))
    assert (ack.session, ack.next_number, ack.kept, ack.received) == (8, 2, 0, 1)


def test_what_was_kept_is_checked_at_its_turn() -> None:
    controller = greeted(VERSION)
    send(controller, 0.0, LinkCoupling(0, 99, 0, (1, 1)).packet(2), block(3))
    answers = send(controller, 0.0, block(1))
    assert Kind.REFUSED in {packet.kind for packet in answers}
    ack = acks(answers)
    assert (ack.state, ack.next_number, ack.kept, ack.received) == (State.STOPPED, 2, 0, 1)


def test_the_oldest_host_gets_the_oldest_ack() -> None:
    for version, spoken, length in (
        (0, 1, 58),
        (1, 1, 58),
        (2, 2, 62),
        (3, 3, 62),
        (4, 4, 62),
        (5, 5, 62),
        (6, VERSION, 62),
        (65535, VERSION, 62),
    ):
        controller = VirtualController(SPEC, now=0.0)
        answers = send(controller, 0.0, Packet(Kind.HELLO, 0, version.to_bytes(2, "little")), Packet(Kind.STATUS))
        assert Capabilities.of(answers[0]).version == spoken
        assert [len(packet.payload) for packet in answers if packet.kind is Kind.ACK] == [length]
    assert len(send(VirtualController(SPEC, now=0.0), 0.0, Packet(Kind.STATUS))[0].payload) == 58
    ack = acks(send(greeted(1), 0.0, block(2)))
    assert (ack.kept, ack.flags) == (None, Flag.GAP)


@dataclass
class OldController:
    """The receiving end of version 1 from its page: no packet is kept, and HELLO's version means nothing."""

    next: int = 0
    session: int = 0
    gap: bool = False
    played: int = 0

    def __post_init__(self) -> None:
        self.reader, self.codes, self.out, self.ended = PacketReader(), list[np.ndarray](), bytearray(), False

    def receive(self, data: bytes) -> bytes:
        for packet in self.reader.feed(data):
            if packet.kind is Kind.HELLO:
                numbers = Capabilities(
                    1, SPEC.rows, SPEC.cols, SPEC.channels, SPEC.rate_hz, 16, 10**6, 16, 4096, 100.0, 1.0, 1.0, 200, 50,
                    self.session, self.next,
                )  # fmt: skip
                self.out += encode(numbers.packet())
            elif packet.kind is Kind.START and packet.number == 0:
                start = StartMessage.of(packet)
                assert start is not None
                self.session, self.next = self.session or start.session, max(self.next, 1)
            elif packet.kind in (Kind.SAMPLES, Kind.END, Kind.MARK):
                self.gap = self.gap or packet.number > self.next
                if packet.number == self.next:
                    self.next += 1
                    self.ended = packet.kind is Kind.END
                    if packet.kind is Kind.SAMPLES:
                        samples = SamplesMessage.of(packet, SPEC.channels)
                        assert samples is not None
                        self.codes.append(samples.codes)
                    elif packet.kind is Kind.MARK:
                        self.out += encode(Marked(Mark.of(packet).frame, 0, 0).packet())
        count = sum(map(len, self.codes))
        state = State.DONE if self.ended else State.PLAYING
        flags = Flag.GAP if self.gap else Flag(0)
        ack = Ack(self.session, self.next, count + 2000, 99, count, count, state, flags, 0, 0, 0, 0)
        self.gap = False
        self.out += encode(ack.packet())
        out = bytes(self.out)
        self.out.clear()
        return out


@pytest.mark.parametrize("share", [0.0, 0.05])
def test_a_controller_of_version_1_is_still_served(share: float) -> None:
    codes = codes_of(1.0, 1)
    bench = Bench(codes, [0, 4000], Faults(drop=share, corrupt=share))
    old = OldController()
    for _ in range(20_000):
        bench.now += 0.001
        bench.session.receive(bench.back.take(bench.now), bench.now)
        bench.there.put(bench.session.poll(bench.now), bench.now)
        bench.back.put(old.receive(bench.there.take(bench.now)), bench.now)
        if bench.session.finished:
            break
    assert bench.session.finished
    assert bench.session.capabilities is not None
    assert bench.session.capabilities.version == 1
    np.testing.assert_array_equal(np.concatenate(old.codes), codes)
    assert (bench.session.report.resent == 0) == (share == 0)


class OldHost:
    """The sending end of version 1 from its page: an ACK has 58 bytes, and after a loss all is sent again."""

    def __init__(self, messages: list[Message]) -> None:
        self.wires = [encode(message.packet(number)) for number, message in enumerate(messages)]
        self.messages = messages
        self.reader, self.base, self.at, self.went_back, self.moved_at = PacketReader(), 0, 0, -1, 0.0
        self.ack: Ack | None = None
        self.strange = 0

    def receive(self, data: bytes, now: float) -> None:
        for packet in self.reader.feed(data):
            if packet.kind is Kind.CAPABILITIES:
                assert Capabilities.of(packet).version == 1
            elif packet.kind is Kind.ACK and len(packet.payload) != 58:
                self.strange += 1
            elif packet.kind is Kind.ACK:
                self.ack = Ack.of(packet)
                assert self.ack is not None
                if self.ack.next_number > self.base:
                    self.base, self.moved_at = self.ack.next_number, now
                    self.at = max(self.at, self.base)
                if Flag.GAP in self.ack.flags and self.went_back != self.base:
                    self.went_back = self.at = self.base

    def poll(self, now: float) -> bytes:
        if now - self.moved_at > 0.1:
            self.at, self.moved_at = self.base, now
        out = b"\0" + encode(Packet(Kind.HELLO, 0, b"\1\0")) if self.ack is None else encode(Packet(Kind.HEARTBEAT))
        while self.at < min(self.base + 32, len(self.wires)):
            message = self.messages[self.at]
            room = 0 if self.ack is None else self.ack.accept_samples
            if isinstance(message, SamplesMessage) and message.first + len(message.codes) > room:
                break
            out += self.wires[self.at]
            self.at += 1
        return out


@pytest.mark.parametrize("share", [0.0, 0.03])
def test_a_host_of_version_1_is_still_served(share: float) -> None:
    codes = codes_of(1.0, 1)
    found = greeted(1)._capabilities()
    bench = Bench(codes, [], Faults(drop=share, corrupt=share))
    host = OldHost(list(stream(codes, [0, 4000], found)))
    while bench.controller.playout.state is not State.DONE:
        bench.now += 0.001
        assert bench.now < 120.0
        host.receive(bench.back.take(bench.now), bench.now)
        bench.there.put(host.poll(bench.now), bench.now)
        bench.controller.receive(bench.there.take(bench.now), bench.now)
        bench.back.put(bench.controller.outgoing(), bench.now)
    np.testing.assert_array_equal(bench.kept.codes, codes)
    assert host.strange == 0


def test_acks_of_a_hostile_controller_are_borne() -> None:
    """Whatever is said to be kept: the host sends on, and forgets nothing that is not acknowledged."""
    chance = random.Random(4)
    codes = codes_of(0.5, 1)
    session = HostSession(partial(stream, codes, []), session=7, timing=Timing())
    session.connected()
    assert HELLO in session.poll(0.0)
    session.receive(encode(greeted(VERSION)._capabilities().packet()), 0.0)
    ack, seen, now = Ack(7, 0, 10**6, 99, 0, 0, State.FILLING, Flag(0), 0, 0, 0, 0, 0), set[int](), 0.0
    for _ in range(3000):
        now += 0.005
        flags = Flag.GAP if chance.random() < 0.1 else Flag(0)
        spoken = replace(ack, kept=chance.getrandbits(32), flags=flags)
        session.receive(encode(spoken.packet()), now)
        found = {
            packet.number for packet in PacketReader().feed(session.poll(now)) if packet.kind is not Kind.HEARTBEAT
        }
        assert all(ack.next_number <= number < ack.next_number + 32 for number in found)
        seen |= found
        if ack.next_number in seen:
            ack = replace(ack, next_number=ack.next_number + 1)
    assert max(seen) == 1 + -(-len(codes) // 48)


def told(room: int, count: int) -> Iterator[tuple[Packet, bytes]]:
    """Packets in and out of order, again, old, far ahead and huge, a STOP now and then; and what has to be answered."""
    chance, early, awaited = random.Random(room), EarlyPackets(room), 1
    for _ in range(count):
        if chance.random() < 0.01:
            early.clear()
            yield Packet(Kind.STOP), b""
        step = chance.choice((0, 0, 0, 1, 2, 5, 20, 31, 32, 33, 60, -1, -9))
        number = chance.getrandbits(32) if chance.random() < 0.02 else max(1, awaited + step)
        packet = Mark(0, number, bytes([number % 251]) * chance.choice((0, 1, 30, 700))).packet(number)
        thrown = number > awaited and not early.keep(packet, awaited)
        due, done = packet if number == awaited else None, list[int]()
        while due is not None:
            done.append(zlib.crc32(due.payload))
            awaited += 1
            due = early.take(awaited)
        yield packet, struct.pack(f"<IIBI{len(done)}I", awaited, early.bits(awaited), thrown, len(done), *done)
    assert awaited > count // 5


@pytest.mark.parametrize("room", [1, 3, 32])
def test_the_store_in_c_keeps_the_same_packets(tmp_path: Path, room: int) -> None:
    gcc = shutil.which("gcc")
    if gcc is None:
        pytest.skip("the C store is checked where there is a gcc")
    command = [gcc, "-std=c99", "-O1", "-Wall", "-Wextra", "-Wpedantic", "-Werror", *SANITIZERS, f"-DDW_EARLY={room}u"]
    source = ROOT / "tests" / "data" / "early_harness.c"
    subprocess.run([*command, "-I", ROOT / "drivers" / "firmware", source, "-o", tmp_path / "early"], check=True)
    sent, answers = zip(*told(room, 5000), strict=True)
    ran = subprocess.run([tmp_path / "early"], input=b"".join(map(encode, sent)), capture_output=True, check=False)
    assert ran.returncode == 0, ran.stderr.decode()
    assert ran.stdout == b"".join(answers)
