"""The firmware by itself: how right its tones are, what it takes, what hostile bytes do, and that nothing is lost."""

from __future__ import annotations

import random
import re
import struct
import subprocess
from collections.abc import Callable, Iterator
from functools import partial

import numpy as np
import pytest
from numpy.typing import NDArray

from drivers.protocol.envelope import Envelope
from drivers.protocol.faults import Faults, FaultWindow, FaultyLine
from drivers.protocol.host_session import HostSession, Timing
from drivers.protocol.measured import WHOLE_TURN, turns_of
from drivers.protocol.messages import Bias, LinkCoupling, Mark, SamplesMessage, StartMessage, Tones, WireTone
from drivers.protocol.outgoing import End, Message
from drivers.protocol.packet import ORDERED, SHAPES, Kind, Packet, encode
from drivers.protocol.replies import Capabilities, State
from tests.drivers.protocol.exchanges import RATE_HZ, Talk, codes, hello
from tests.drivers.protocol.test_conformance import played, told
from tests.support.firmware import (
    LINKED,
    PAPER,
    ROOT,
    SANITIZED,
    TRIAL,
    Answer,
    GivenProgram,
    Grid,
    Request,
    built,
    need,
)

FULL = 32767
SMALL = "-DDW_BUFFER_SAMPLES=0u -DDW_EVENT_SLOTS=128u -DDW_MAX_PAYLOAD=512u -DDW_EARLY=8u"
STACK_BYTES = 2048  # more than the deepest calls of the core take
STEP_US = 1000


def by_program(requests: list[Request]) -> list[Answer]:
    """What the program of this machine answers, with its reads and writes watched."""
    with GivenProgram(built("given", "trial", flags=SANITIZED), TRIAL) as program:
        return [program.ask(request) for request in requests]


def drawn(event: Tones | Envelope, samples: int) -> NDArray[np.float64]:
    """Volts that the firmware puts out of channel 0."""
    talk = Talk().start(samples, parametric=True).order(event, End(samples), wait_ms=1)
    talk.beat(1000 * samples / RATE_HZ + 20)
    return played(by_program(talk.requests))[0][:, 0] * (100.0 / FULL)


@pytest.mark.parametrize("volts", [100.0, 1.0])
@pytest.mark.parametrize("hz", [3.3, 133.13, 1234.5, 3900.0])
def test_a_tone_is_right_in_size_and_phase(hz: float, volts: float) -> None:
    samples, phase = 40000, 0.7
    single = float(np.float32(hz))
    out = drawn(Tones(0, 0, 0, (WireTone(volts, hz, phase),)), samples)
    live = np.flatnonzero(out)[0] + np.arange(samples)
    index = np.arange(samples)
    basis = np.exp(-1j * (2 * np.pi * single / RATE_HZ) * index)
    # As many whole periods as there are; the last ones show whether the phase drifts.
    for part in (slice(0, samples), slice(samples // 2, samples)):
        columns = np.stack([basis[part].real, basis[part].imag], axis=1)
        real, imaginary = np.linalg.lstsq(columns, out[live[part]], rcond=None)[0]
        found = complex(real, imaginary)
        assert abs(abs(found) / volts - 1) <= 1e-3
        assert abs(np.angle(found * np.exp(-1j * phase))) <= 1e-3


def test_a_long_envelope_ends_where_it_is_to() -> None:
    turns = turns_of(2 * np.pi * 150.0, 1 / RATE_HZ)
    event = Envelope(0, 0, 65536, turns, (90 + 0j, 30 - 60j, -60 + 20j, 50 + 50j))
    out = drawn(event, 65536)[: 65536 + 20]
    index = np.arange(65536)
    phase = (index.astype(np.uint64) * np.uint64(turns)).astype(np.float64) * (2 * np.pi / WHOLE_TURN)
    wanted = (event.at_samples(index) * np.exp(1j * phase)).real
    first = np.flatnonzero(out)[0]
    assert np.abs(out[first : first + 65536] - wanted).max() <= 1e-3 * 100.0 / 2


@pytest.mark.parametrize("ramp", [1, 2, 3])
def test_the_steepest_pieces_overflow_nowhere(ramp: int) -> None:
    for points in ((100, -100, 100, -100), (-100, 100, -100, 100), (100, 100, -100, -100)):
        out = drawn(Envelope(0, 0, ramp, 0, tuple(complex(volts) for volts in points)), 40)
        assert out[np.flatnonzero(out)[0]] == points[0]
        assert out[np.flatnonzero(out)[0] + ramp] == points[-1]


def sizes(grid: Grid, options: str) -> int:
    """Bytes of RAM that the core takes on a Cortex-M4."""
    core = built("core", grid.name, options).with_name(f"{grid.name}.o")
    told = subprocess.run(["arm-none-eabi-size", core], capture_output=True, text=True, check=True).stdout
    _, data, bss, *_ = told.splitlines()[1].split()
    return int(data) + int(bss)


def test_what_it_takes_of_memory() -> None:
    need("arm-none-eabi-gcc")
    assert sizes(PAPER, SMALL) + STACK_BYTES <= 32 * 1024
    assert sizes(LINKED, SMALL) + STACK_BYTES <= 32 * 1024
    # 42 channels with half a second of samples, packets of 512 bytes.
    assert sizes(PAPER, "-DDW_MAX_PAYLOAD=512u") + STACK_BYTES <= 400 * 1024


@pytest.mark.parametrize(("grid", "most"), [(PAPER, 8000), (LINKED, 4000)])
def test_what_a_vector_takes_of_time(grid: Grid, most: int) -> None:
    need("arm-none-eabi-gcc", "qemu-system-arm")
    image = built("count", grid.name, "-DDW_BUFFER_SAMPLES=0u")
    command = ["qemu-system-arm", "-M", "mps2-an386", "-display", "none", "-serial", "none", "-monitor", "none"]
    more = ["-icount", "shift=0", "-semihosting-config", "enable=on,target=native", "-kernel", str(image)]
    done = subprocess.run([*command, *more], capture_output=True, text=True, timeout=100, check=True)
    (count,) = re.findall(r"(\d+) instructions a vector", done.stdout + done.stderr)
    assert 100 < int(count) <= most


def test_the_static_check_is_clean() -> None:
    need("cppcheck", "make", "cc")
    done = subprocess.run(["make", "-s", "-C", ROOT, "check"], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


COMMON = (Kind.SAMPLES, Kind.COUPLING, Kind.BIAS, Kind.TONES, Kind.ENVELOPE, Kind.MARK, Kind.LINKS_TO)
ITEMS = {
    Kind.COUPLING: (2,),
    Kind.LINKS_TO: (2,),
    Kind.TONES: (0, 1, 2),
    Kind.ENVELOPE: (1, 4),
    Kind.SAMPLES: (20, 200),
    Kind.KEY: (3,),
}
EXTREMES = [0, 1, 2, 7, 40, 4096, 65535, 65536, 1 << 31, (1 << 32) - 1]


class Hostile:
    """Whole packets of sessions that may be carried out, or ask for what is out of all bounds; and spoiled ones."""

    def __init__(self, seed: int) -> None:
        self._random = random.Random(seed)
        self._number = self._total = self._first = self._at = 0
        self._parametric = False

    def packets(self, count: int) -> Iterator[bytes]:
        """So many of them, some with noise in them."""
        pick = self._random
        for _ in range(count):
            kind = pick.choice([*Kind, Kind.START, *COMMON * 9])
            if kind is Kind.SAMPLES and self._parametric and pick.random() < 0.98:
                continue
            wire = encode(self._packet(kind))
            if pick.random() < 0.02:
                at = pick.randrange(len(wire))
                wire = wire[:at] + pick.randbytes(pick.randrange(4)) + wire[at + 1 :]
            yield wire

    def _packet(self, kind: Kind) -> Packet:
        pick, shape = self._random, SHAPES[kind]
        items = pick.choice(ITEMS.get(kind, (0,)) if pick.random() < 0.95 else (0, 1, 2, 3, 4, 9, 60))
        size = shape.fixed + shape.item * items
        payload = bytearray(pick.randbytes(size))
        if kind is Kind.START:
            self._total, self._number, self._first = pick.choice([0, 0, 40, *EXTREMES]), 0, 0
            self._at, mode = 0, pick.choice([0, 0, 0, 1, 1, 1, 3, 255])
            self._parametric = bool(mode & 1)
            session = pick.randrange(1, 1 << 32)
            payload[:17] = struct.pack("<IBIQ", session, mode, RATE_HZ, self._total)
        elif kind is Kind.SAMPLES:
            count = (size - shape.fixed) // 4
            payload[:10] = struct.pack("<QH", self._first if pick.random() < 0.98 else pick.choice(EXTREMES), count)
            self._first += count
        elif kind is Kind.END:
            payload = bytearray(struct.pack("<Q", self._total if pick.random() < 0.9 else pick.choice(EXTREMES)))
        elif kind in ORDERED and size >= 14:
            self._at += pick.choice([0, 20, 60])
            at, ramp = (self._at, pick.choice(EXTREMES[1:8])) if pick.random() < 0.95 else pick.sample(EXTREMES, 2)
            if kind is Kind.ENVELOPE and items == 1:
                ramp = 0
            payload[:14] = struct.pack("<QHI", at, pick.randrange(2 if pick.random() < 0.99 else 1 << 16), ramp)
            for place in range(14 if kind is not Kind.ENVELOPE else 22, size - 3, 4):
                if kind is not Kind.COUPLING and pick.random() < 0.995:
                    payload[place : place + 4] = struct.pack("<f", pick.choice([0.0, 1.0, -50.0, 40.0, 1e-3, 5e-40]))
        if kind not in ORDERED:
            return Packet(kind, 0, bytes(payload))
        number, self._number = self._number, self._number + 1
        return Packet(kind, number + (pick.choice([1, 5, 33]) if pick.random() < 0.01 else 0), bytes(payload))


def survives(packets: int, seed: int) -> None:
    """Feed hostile packets to the watched program; in the end it greets, and plays a session like any other."""
    with GivenProgram(built("given", "trial", flags=SANITIZED), TRIAL) as program:
        now_us, pile, states = 0, bytearray(), set[State]()
        for count, wire in enumerate(Hostile(seed).packets(packets)):
            pile += wire
            if count % 10 == 9:
                now_us += 20_000
                answer = program.ask(Request(now_us, bytes(pile)))
                assert (np.abs(answer.codes.astype(np.int64)) <= FULL).all()
                words = " ".join(told(answer.sent)).split()
                states |= {State[word] for word in words if word in State.__members__}
                pile.clear()
        assert {State.PLAYING, State.STOPPED} <= states
        now_us += 400_000
        program.ask(Request(now_us, b"\0" + encode(Packet(Kind.STOP)) + hello(5)))
        block, talk = codes(400), Talk(None).start(400, session=0xFFFFFFFF)
        talk.order(SamplesMessage(0, block), End(400))
        now_us += 100_000
        program.ask(Request(now_us, b"".join(request.data for request in talk.requests)))
        last = program.ask(Request(now_us + 40_000, encode(Packet(Kind.HEARTBEAT))))
        assert "REFUSED" not in "".join(told(last.sent))
        np.testing.assert_array_equal(last.codes[:300], block[: len(last.codes[:300])])


def test_hostile_packets_do_no_harm() -> None:
    survives(20_000, seed=1)


@pytest.mark.slow
def test_a_million_hostile_packets_do_no_harm() -> None:
    for seed in range(10):
        survives(100_000, seed)


class FirmwareBench:
    """A host, the firmware, and a faulty line between them, in time of the test's own."""

    def __init__(
        self, make: Callable[[Capabilities], Iterator[Message]], program: GivenProgram, faults: Faults, seed: int = 3
    ) -> None:
        self.now_us = 0
        self._program = program
        self.session = HostSession(make, session=7, timing=Timing())
        self.there = FaultyLine(faults, seed=seed, now=0.0)
        self.back = FaultyLine(faults, seed=seed + 1, now=0.0)
        self.answers: list[Answer] = []
        self.host_lives = True
        self.session.connected()

    def step(self) -> None:
        self.now_us += STEP_US
        now = self.now_us * 1e-6
        if self.host_lives:
            self.session.receive(self.back.take(now), now)
            self.there.put(self.session.poll(now), now)
        self.answers.append(self._program.ask(Request(self.now_us, self.there.take(now))))
        self.back.put(self.answers[-1].sent, now)

    def run(self, limit_s: float) -> None:
        end = self.now_us + round(limit_s * 1e6)
        while not self.session.finished:
            assert self.now_us < end, f"stuck at {self.session.played_s} s"
            self.step()


def noise_of(grid: Grid, seconds: float) -> NDArray[np.int16]:
    shape = round(seconds * grid.rate_hz), grid.channels
    return np.random.default_rng(5).integers(-FULL, FULL, shape, dtype=np.int16)


def stream_of(grid: Grid, block: NDArray[np.int16], found: Capabilities) -> Iterator[Message]:
    yield StartMessage(7, False, grid.rate_hz, len(block))
    most = SamplesMessage.most(found.channels, found.max_payload)
    for first in range(0, len(block), most):
        if first % (40 * most) == 0:
            yield Mark(first, first // most)
            yield LinkCoupling(first, 1, 100, (first % 65536,) * grid.links)
        yield SamplesMessage(first, block[first : first + most])
    yield End(len(block))


def nothing_is_lost(seconds: float, faults: Faults, grid: Grid = PAPER) -> None:
    """Stream noise; all of it goes out once and in order, but for the ramps where the output was held."""
    block = noise_of(grid, seconds)
    with GivenProgram(built("given", grid.name), grid) as program:
        bench = FirmwareBench(partial(stream_of, grid, block), program, faults)
        bench.run(3 * seconds + 10)
        out, _ = played(bench.answers)
    assert bench.session.report.samples == len(block)
    # Where the output is held it ramps to zero and up again: what is between two ramps is the stream itself.
    at, found = 0, 0
    for row in np.flatnonzero((out != 0).any(axis=1)).tolist():
        match = np.flatnonzero((block[at : at + 500] == out[row]).all(axis=1))
        if len(match):
            at += int(match[0]) + 1
            found += 1
    held = bench.session.report.lost_s > 0
    assert found == len(block) if not held else found >= len(block) - 500 * 8


def test_streaming_with_faults_loses_nothing() -> None:
    nothing_is_lost(1.0, Faults(drop=0.01, corrupt=0.01))


@pytest.mark.slow
def test_a_minute_with_faults_loses_nothing() -> None:
    nothing_is_lost(60.0, Faults(drop=0.01, corrupt=0.01, disconnect=FaultWindow(20.0, 1.5)))


def test_when_the_host_dies_the_output_is_at_zero_within_the_watchdog_time() -> None:
    block = np.full((2 * RATE_HZ, 2), 20000, dtype=np.int16)
    with GivenProgram(built("given", "trial"), TRIAL) as program:
        bench = FirmwareBench(partial(stream_of, TRIAL, block), program, Faults())
        while bench.session.played_s < 0.5:
            bench.step()
        bench.host_lives = False
        before = len(bench.answers)
        for _ in range(400):
            bench.step()
    after = np.concatenate([answer.codes for answer in bench.answers[before:]])[:, 0]
    watchdog = round(0.2 * RATE_HZ)
    assert (after[: round(0.05 * RATE_HZ)] == 20000).all()
    assert not after[watchdog:].any()
    ramp = np.diff(after[after != 20000][:300].astype(int))
    assert np.ptp(ramp) <= 1


def test_more_sounds_than_there_is_room_for_stop_the_output() -> None:
    talk = Talk().start(4000, parametric=True)
    talk.order(*(Envelope(0, 0, 0, k << 40, (1 + 0j,)) for k in range(1, 16)), wait_ms=1)
    talk.order(*(Envelope(400, 1, 0, k << 40, (1 + 0j,)) for k in range(1, 8)), wait_ms=3).beat(60)
    said = [line for answer in by_program(talk.requests) for line in told(answer.sent)]
    assert any("more sounds at a time than there is room for" in line for line in said)
    assert "STOPPED" in said[-1]


def test_more_tones_than_there_is_room_for_are_refused() -> None:
    tone = WireTone(1.0, 100.0, 0.0)
    talk = Talk().start(4000, parametric=True).order(Tones(0, 0, 0, (tone,) * 3), wait_ms=1)
    assert any("room for 2" in line for line in told(by_program(talk.requests)[-1].sent))


def test_a_bias_beside_a_tone_does_not_go_over_full_volts() -> None:
    talk = Talk().start(800, parametric=True)
    talk.order(Bias(0, 0, 0, 100.0), Tones(0, 0, 0, (WireTone(100.0, 100.0, 0.0),)), End(800), wait_ms=1).beat(150)
    out = played(by_program(talk.requests))[0]
    assert out.max() == FULL
