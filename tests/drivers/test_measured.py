"""Measuring over the line: packets there and back, in C too, what the line may lose, and ends of older versions."""

from __future__ import annotations

import re
import shutil
import struct
import subprocess
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, strategies as st

from drivers.protocol.faults import Faults, FaultWindow, FaultyLine
from drivers.protocol.host_session import ControllerRefused, HostSession, Timing
from drivers.protocol.measured import Measure, MeasuredFrames, MeasuredPart, parts_of, turns_of
from drivers.protocol.messages import VERSION, Bias, SamplesMessage, StartMessage
from drivers.protocol.metering import Meter
from drivers.protocol.outgoing import End, Message
from drivers.protocol.packet import MAX_PAYLOAD, SHAPES, Kind, Packet, PacketReader, decode, encode
from drivers.protocol.playout import ControllerSpec, OutputBlock
from drivers.protocol.replies import MEASURES, Capabilities
from drivers.protocol.virtual_controller import VirtualController
from planner import Measured

ROOT = Path(__file__).resolve().parents[2]
STEP_S = 0.001
SPEC = ControllerSpec(
    rows=2, cols=3, channels=2, rate_hz=8000, buffer_samples=2000, event_slots=16, full_volts=100.0,
    lam_step=1 / 65535, lam_max=1.0, watchdog_s=0.2, ramp_s=0.05, drift_ppm=0.0,
)  # fmt: skip
OMEGA, DTAU = (1.1, 0.93), 2 * np.pi * 133.13 / 8000
FRAME = 800  # samples; the window is the second half


def measured(frame: int, count: int, seed: int = 1) -> Measured:
    rng = np.random.default_rng((seed, frame))
    numbers = rng.normal(size=(6, count)).astype(np.float32).astype(np.float64)
    return Measured(frame, numbers[0], numbers[1] + 1j * numbers[2], numbers[3] + 1j * numbers[4], numbers[5])


def same(one: Measured, other: Measured) -> None:
    assert one.frame == other.frame
    np.testing.assert_array_equal(one.mean, other.mean)
    np.testing.assert_array_equal(one.harmonic, other.harmonic)
    assert one.change is not None
    assert other.change is not None
    assert one.rest is not None
    assert other.rest is not None
    np.testing.assert_array_equal(one.change, other.change)
    np.testing.assert_array_equal(one.rest, other.rest)


class Swinging:
    """Actuators that move as `measured` says of the frame that goes out, whatever the volts."""

    def __init__(self, frame: int = FRAME, noise: float = 0.0) -> None:
        self.frame, self.noise = frame, noise

    def sense(self, block: OutputBlock) -> np.ndarray:
        index = block.played + np.arange(len(block.volts))
        z = np.zeros((len(index), SPEC.rows, SPEC.cols))
        for number in np.unique(index // self.frame):
            here, wanted = index // self.frame == number, measured(int(number), 6)
            for row, omega in enumerate(OMEGA):
                wave = np.exp(1j * omega * DTAU * index[here])
                columns = slice(3 * row, 3 * row + 3)
                z[here, row] = wanted.mean[columns] + (np.outer(wave, wanted.harmonic[columns])).real
        return z

    def read(self, measured: Measured) -> Measured:
        return replace(measured, mean=measured.mean + self.noise)


class Bench:
    """A host, a controller that measures, and a line between them."""

    def __init__(self, frames: int, faults: Faults | None = None, *, senses: object = None, seed: int = 3) -> None:
        self.now, self.found, self.frames = 100.0, list[Measured](), frames
        self.controller = VirtualController(SPEC, now=self.now, senses=senses)  # type: ignore[arg-type]
        self.session = HostSession(self.stream, session=7, timing=Timing(), on_measured=self.found.append)
        self.there = FaultyLine(faults or Faults(), seed=seed, now=self.now)
        self.back = FaultyLine(faults or Faults(), seed=seed + 1, now=self.now)
        self.session.connected()

    def stream(self, found: Capabilities) -> Iterator[Message]:
        """Frames of silence; each is measured over its second half."""
        total = self.frames * FRAME
        yield StartMessage(7, False, SPEC.rate_hz, total)
        for first in range(0, total, 40):
            if first % FRAME == FRAME // 2:
                turns = tuple(turns_of(omega, DTAU) for omega in OMEGA)
                yield Measure(first, FRAME // 2, first // FRAME, turns)
            yield SamplesMessage(first, np.zeros((40, SPEC.channels), dtype=np.int16))
        yield End(total)

    def run(self, limit_s: float) -> None:
        end = self.now + limit_s
        while not self.session.finished:
            assert self.now < end, f"stuck at {self.session.played_s} s"
            self.now += STEP_S
            self.session.receive(self.back.take(self.now), self.now)
            self.there.put(self.session.poll(self.now), self.now)
            self.controller.receive(self.there.take(self.now), self.now)
            self.back.put(self.controller.outgoing(), self.now)


@given(st.integers(0, 2**32 - 1), st.integers(1, 3900), st.sampled_from([64, 512, MAX_PAYLOAD, 10**6]), st.randoms())
def test_a_frame_comes_back_from_its_packets(frame: int, count: int, max_payload: int, chance: object) -> None:
    sent = measured(frame, count)
    wires = [encode(part.packet()) for part in parts_of(sent, 9, max_payload)]
    assert all(len(decode(wire[:-1]).payload) <= min(max_payload, MAX_PAYLOAD) for wire in wires)
    chance.shuffle(wires)  # type: ignore[attr-defined]
    frames = MeasuredFrames(9, count)
    found = [frames.take(MeasuredPart.of(decode(wire[:-1]))) for wire in [*wires, *wires]]
    assert [one is not None for one in found] == [False] * (len(wires) - 1) + [True] + [False] * len(wires)
    whole = found[len(wires) - 1]
    assert whole is not None
    same(whole, sent)


def test_parts_that_do_not_belong_are_passed_over() -> None:
    frames = MeasuredFrames(9, 300)
    first, last = parts_of(measured(3, 300), 9)
    assert frames.take(first) is None
    for strange in (
        replace(last, session=8), replace(last, first=299), replace(last, frame=2), *parts_of(measured(3, 500), 9)[1:],
    ):  # fmt: skip
        assert frames.take(strange) is None
    # A frame whose rest is lost gives way to the next one; what comes of it later is old.
    newer = [frames.take(part) for part in parts_of(measured(4, 300), 9)]
    assert newer[0] is None
    assert newer[1] is not None
    same(newer[1], measured(4, 300))
    assert frames.take(last) is None


def test_the_question_comes_back_from_its_bytes() -> None:
    ask = Measure(2**40, 2**31, 8, (0, 2**64 - 1, 3))
    assert Measure.of(ask.packet(77)) == ask
    assert ask.packet(77).number == 77
    most = Measure.most(MAX_PAYLOAD)
    assert len(encode(Measure(0, 1, 0, (1,) * most).packet(1))) > 8 * most
    assert SHAPES[Kind.MEASURE].fixed + 8 * (most + 1) > MAX_PAYLOAD
    # Ten hours of a phase that is added up from sample to sample are as right as the first second.
    turns, sample = turns_of(1.2345, DTAU), 10 * 3600 * 8000
    phase = turns * sample % 2**64 * 2 * np.pi / 2**64
    assert np.exp(1j * phase) == pytest.approx(np.exp(1j * 1.2345 * DTAU * sample), abs=1e-5)


def test_what_a_controller_can_do_is_said_from_version_3_on() -> None:
    now = Capabilities(3, 6, 6, 42, 8000, 16, 4000, 256, 4096, 100.0, 0.5, 1.0, 200, 50, 9, 3, "ä board", measures=True)
    assert now.packet().payload[45:] == bytes([MEASURES]) + "ä board".encode()
    for one in (now, replace(now, measures=False), replace(now, version=2, measures=False), replace(now, name="")):
        assert Capabilities.of(one.packet()) == one
    assert replace(now, version=2).packet().payload[45:] == "ä board".encode()
    # One of version 3 that leaves the byte out measures nothing.
    bare = Packet(Kind.CAPABILITIES, 0, now.packet().payload[:45])
    assert Capabilities.of(bare) == replace(now, name="", measures=False)
    later = Packet(Kind.CAPABILITIES, 0, now.packet().payload[:45] + b"\xfe")
    assert not Capabilities.of(later).measures


def test_every_frame_of_a_clean_line_is_measured() -> None:
    bench = Bench(5, senses=Swinging())
    bench.run(3.0)
    assert bench.session.capabilities is not None
    assert bench.session.capabilities.measures
    assert bench.session.report.measured == 5
    assert [one.frame for one in bench.found] == list(range(5))
    for found in bench.found:
        wanted = measured(found.frame, 6)
        np.testing.assert_allclose(found.mean, wanted.mean, atol=1e-6)
        np.testing.assert_allclose(found.harmonic, wanted.harmonic, atol=1e-6)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("faults", [Faults(drop=0.1, corrupt=0.1, duplicate=0.2), Faults(delay_s=0.03, duplicate=0.5)])
def test_measurements_may_be_lost_but_are_never_wrong_and_come_once(faults: Faults, seed: int) -> None:
    bench = Bench(30, faults, senses=Swinging(), seed=seed)
    bench.run(20.0)
    frames = [one.frame for one in bench.found]
    assert frames == sorted(set(frames))
    assert len(frames) > 15
    # A late line ends a session before the last of its answers is through; nothing else is lost on it.
    assert faults.drop or len(frames) >= 29
    for found in bench.found:
        np.testing.assert_allclose(found.harmonic, measured(found.frame, 6).harmonic, atol=1e-6)


def test_a_window_in_which_the_output_was_held_is_given_up() -> None:
    # The watchdog ends the output 0.15 s after the line stalls: in the window of frame 10, from 1.05 s on.
    bench = Bench(30, Faults(stall=FaultWindow(0.93, 0.5)), senses=Swinging())
    bench.run(20.0)
    assert bench.session.report.lost_s > 0
    assert [one.frame for one in bench.found] == [n for n in range(30) if n != 10]
    for found in bench.found:
        np.testing.assert_allclose(found.harmonic, measured(found.frame, 6).harmonic, atol=1e-6)


def test_a_window_that_is_held_in_the_middle_gives_nothing() -> None:
    meter = Meter(SPEC.rows, SPEC.cols, Swinging())
    turns = tuple(turns_of(omega, DTAU) for omega in OMEGA)
    for number in range(3):
        meter.ask(Measure(number * FRAME + 400, 400, number, turns))
    played = 0
    for count, live in ((500, True), (100, True), (30, False), (1000, True), (50, False), (800, True)):
        meter.take(OutputBlock(0.0, np.zeros((count, 2)), np.zeros((count, 2, 3)), played, live))
        played += count if live else 0
    assert [one.frame for one in meter.finished()] == [1, 2]
    assert meter.finished() == []


def test_what_still_rings_is_told_apart() -> None:
    """A second oscillation that fades is hardly seen in the harmonic; how the first one grows is."""
    tau, samples = 2 * np.pi * 133.13 / 8000, 3000

    class Ringing(Swinging):
        def sense(self, block: OutputBlock) -> np.ndarray:
            x = np.arange(len(block.volts)) / len(block.volts)
            at = tau * np.arange(len(block.volts))
            z = (1 + 0.2 * x) * np.cos(1.35 * at) + 0.5 * np.exp(-x) * np.cos(1.1 * at)
            return np.broadcast_to(z[:, None, None], (len(z), SPEC.rows, SPEC.cols))

    meter = Meter(SPEC.rows, SPEC.cols, Ringing())
    meter.ask(Measure(0, samples, 0, (turns_of(1.35, tau),)))
    meter.take(OutputBlock(0.0, np.zeros((samples, 2)), np.zeros((samples, 2, 3)), 0, True))
    (found,) = meter.finished()
    assert found.change is not None
    assert found.rest is not None
    np.testing.assert_allclose(found.harmonic, 1.1, atol=1e-3)
    np.testing.assert_allclose(found.change, 0.2, atol=2e-2)
    # The second one's mean square, about half of its amplitude squared in the middle of the window.
    np.testing.assert_allclose(found.rest, 0.5 * (0.5 * np.exp(-0.5)) ** 2, rtol=0.1)


def test_a_window_too_short_has_a_mean_only() -> None:
    meter = Meter(SPEC.rows, SPEC.cols, Swinging())
    meter.ask(Measure(0, 2, 0, (turns_of(1.1, DTAU),)))
    meter.ask(Measure(100, 300, 0, (turns_of(1.1, DTAU), 0)))
    meter.take(OutputBlock(0.0, np.zeros((800, 2)), np.zeros((800, 2, 3)), 0, True))
    short, still = meter.finished()
    assert np.isfinite(short.mean).all()
    assert np.isnan(short.harmonic).all()
    assert np.isfinite(still.harmonic[:3]).all()
    assert np.isnan(still.harmonic[3:]).all()
    assert np.isfinite(still.mean).all()


def test_a_controller_without_sensors_says_so_and_refuses() -> None:
    bench = Bench(2)
    with pytest.raises(ControllerRefused, match="this controller does not measure"):
        bench.run(3.0)
    assert bench.session.capabilities is not None
    assert not bench.session.capabilities.measures


@pytest.mark.parametrize("ask", [Measure(100, 0, 0, (1,)), Measure(100, 5, 0, ()), Measure(100, 5, 0, (1, 2, 3))])
def test_impossible_questions_are_refused(ask: Measure) -> None:
    controller = VirtualController(SPEC, now=0.0, senses=Swinging())
    greeting = Packet(Kind.HELLO, 0, VERSION.to_bytes(2, "little"))
    for packet in (greeting, StartMessage(7, False, 8000, 8000).packet(0), ask.packet(1)):
        controller.receive(encode(packet), 0.0)
    refused = [packet for packet in PacketReader().feed(controller.outgoing()) if packet.kind is Kind.REFUSED]
    assert len(refused) == 1
    assert b"at least 1 sample and phases of 1 to 2 rows" in refused[0].payload


def test_a_host_of_before_meets_a_controller_that_measures() -> None:
    """It is told version 2 in the form it knows, asks for nothing, and gets nothing it does not know."""
    controller = VirtualController(SPEC, now=0.0, name="board", senses=Swinging())
    sent = [
        Packet(Kind.HELLO, 0, (2).to_bytes(2, "little")), StartMessage(7, False, 8000, 800).packet(0),
        Bias(0, 0, 0, 1.0).packet(1), SamplesMessage(0, np.zeros((800, 2), dtype=np.int16)).packet(2),
        End(800).packet(3),
    ]  # fmt: skip
    out = b""
    for number, packet in enumerate([*sent, *[Packet(Kind.HEARTBEAT)] * 500]):
        controller.receive(encode(packet), number * STEP_S)
        out += controller.outgoing()
    answers = PacketReader().feed(out)
    assert {packet.kind for packet in answers} == {Kind.CAPABILITIES, Kind.ACK}
    (said,) = [packet for packet in answers if packet.kind is Kind.CAPABILITIES]
    assert struct.unpack_from("<H", said.payload) == (2,)
    assert said.payload[45:] == b"board"


def test_the_header_measures_as_python_does(tmp_path: Path) -> None:
    gcc = shutil.which("gcc")
    if gcc is None:
        pytest.skip("the C header is checked where there is a gcc")
    command = [gcc, "-std=c99", "-O1", "-Wall", "-Wextra", "-Wpedantic", "-Werror"]
    command += ["-fsanitize=address,undefined", "-fno-sanitize-recover=all"]
    source = ROOT / "tests" / "data" / "measured_harness.c"
    folder = ROOT / "drivers" / "firmware"
    subprocess.run([*command, "-I", folder, source, "-o", tmp_path / "measured", "-lm"], check=True, timeout=600)
    rows, cols, at = 3, 4, 10**12
    turns = (turns_of(1.1, DTAU), 0)
    sensed = np.random.default_rng(2).normal(size=(700, rows, cols)).astype(np.float32)
    sent = encode(Measure(at, len(sensed), 5, turns).packet(1)) + struct.pack("<II", rows, cols)
    ran = subprocess.run([tmp_path / "measured"], input=sent + sensed.tobytes(), capture_output=True, check=False)
    assert ran.returncode == 0, ran.stderr.decode()
    fixed, item = SHAPES[Kind.MEASURED]
    constants = (MEASURES, SHAPES[Kind.MEASURE].fixed, fixed, item, (MAX_PAYLOAD - fixed) // item)
    assert struct.unpack_from("<5I", ran.stdout) == constants
    (packet,) = PacketReader().feed(ran.stdout[20:])
    found = MeasuredFrames(7, rows * cols).take(MeasuredPart.of(packet))

    class Sensed(Swinging):
        def sense(self, block: OutputBlock) -> np.ndarray:
            return sensed.astype(np.float64)

    meter = Meter(rows, cols, Sensed())
    meter.ask(Measure(at, len(sensed), 5, turns))
    meter.take(OutputBlock(0.0, np.zeros((700, 2)), np.zeros((700, rows, cols)), at, True))
    (here,) = meter.finished()
    assert found is not None
    np.testing.assert_allclose(found.mean, here.mean, atol=1e-6)
    np.testing.assert_allclose(found.harmonic, here.harmonic, atol=1e-6)
    assert found.change is not None
    assert here.change is not None
    assert found.rest is not None
    assert here.rest is not None
    np.testing.assert_allclose(found.change, here.change, atol=1e-5)
    np.testing.assert_allclose(found.rest, here.rest, atol=1e-5)
    assert np.isnan(found.harmonic[cols:]).all()


def test_kinds_are_the_same_in_the_header() -> None:
    text = (ROOT / "drivers" / "firmware" / "dotwave_decoder.h").read_text(encoding="utf-8")
    kinds = dict(re.findall(r"DW_(\w+) = 0x([0-9a-f]{2})", text))
    assert {name: int(code, 16) for name, code in kinds.items()} == {kind.name: kind.value for kind in Kind}
