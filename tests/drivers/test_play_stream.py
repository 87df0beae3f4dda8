"""A written waveform over a pty to the emulator, in real time: what arrives is what the file says."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from chainsim import Device, Outcome, load_device
from drivers import read_waveform, write_waveform
from drivers.protocol.emulator import LONGEST_STEP_S, Emulator
from drivers.protocol.faults import Faults, FaultWindow
from drivers.protocol.host_session import HostSession, StreamReport, Timing
from drivers.protocol.messages import FULL_CODE
from drivers.protocol.outgoing import session_messages
from drivers.protocol.playout import ControllerSpec, OutputBlock
from drivers.protocol.virtual_controller import VirtualController
from drivers.sinks.serial_play import NoAnswer, run_session
from drivers.sinks.uart import PortUnavailable, Uart, serial_ports
from encoders import Frame, TargetPattern
from planner import FramePlan, Margins, OperatingPoint, Plan, Ramp
from tests.support.playing import exchange, serving

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="needs a pseudo-terminal")

SMOOTH = np.array([0.0, 0.5, 1.0])


def dots(device: Device, seed: int) -> np.ndarray:
    return (np.random.default_rng(seed).random((device.rows, device.cols)) < 0.5).astype(float)


def plan_of(device: Device, frames: int, dwell_s: float) -> Plan:
    """Random dots: biases where the device has them, else one tone a chain and links that glide."""

    def states(number: int) -> list[OperatingPoint]:
        on = dots(device, number) * (number < frames)
        biased = device.bias == "actuator"
        n = device.chain_length
        return [
            OperatingPoint(
                target=part, epsilon=0j if biased else (0.05 + 0.02j) * (number < frames),
                lam=np.full(n - 1, device.coupling.lam.max * (0.3 + 0.05 * number % 0.5)),
                bias=0.13 * part if biased else np.zeros(n), omega=1.05, phasor=np.zeros(n, dtype=np.complex128),
                mean=np.zeros(n), error=0.0, margins=Margins(0.0, 0.0), outcome=Outcome.OK,
            )
            for part in on.reshape(-1, n)
        ]  # fmt: skip

    def plans() -> Iterator[FramePlan]:
        before, t_s = states(frames), np.array([0.0, 0.05, 0.1])
        for number in range(frames + 1):
            held = states(number)
            ramps = tuple(
                Ramp(
                    t_s,
                    epsilon=b.epsilon + (h.epsilon - b.epsilon) * SMOOTH,
                    epsilon_slope=np.array([0, 10, 0]) * (h.epsilon - b.epsilon),
                    bias=b.bias + (h.bias - b.bias) * SMOOTH[:, np.newaxis] if device.bias == "actuator" else None,
                    lam_t_s=t_s[[0, 2]],
                    lam=np.stack([b.lam, h.lam]),
                )
                for b, h in zip(before, held, strict=True)
            )
            frame = Frame(
                TargetPattern(dots(device, number).astype(complex)), dwell_s, page=number, text=f"{number}", cells="⠁"
            )
            start_s = number * dwell_s
            yield FramePlan(
                frame if number < frames else None, start_s, start_s + 0.2, start_s + dwell_s, tuple(held), ramps
            )
            before = held

    return Plan(device, plans(), {"kind": "test"})


SPEC = {"buffer_s": 0.5, "watchdog_s": 0.2}


class SharedClock:
    """Real time that passes only while both sides live: whoever a busy machine stops, stops the other too."""

    def __init__(self) -> None:
        self.now = self._real = time.monotonic()
        self._lived = True

    def host(self) -> float:
        real = time.monotonic()
        if self._lived:
            self.now += min(real - self._real, LONGEST_STEP_S)
            self._lived = False
        self._real = real
        return self.now

    def emulator(self) -> float:
        self._lived = True
        return self.now


@contextmanager
def emulated(device: Device, clock: SharedClock, **options: object) -> Iterator[Emulator]:
    """An emulator that lives in a thread of its own."""
    spec = ControllerSpec.of(device, **SPEC)
    with serving(Emulator(device, spec, clock=clock.emulator, **options)) as emulator:  # type: ignore[arg-type]
        yield emulator


def play_to(port: str, path: Path, clock: SharedClock, *, patience_s: float = 10.0) -> StreamReport:
    manifest, reader = read_waveform(path)
    session = HostSession(
        lambda found: session_messages(manifest, reader, found, session=42), session=42, timing=Timing()
    )
    run_session(session, lambda: Uart(port), patience_s=patience_s, clock=clock.host)
    return session.report


def codes(path: Path) -> np.ndarray:
    manifest, reader = read_waveform(path)
    volts = np.concatenate(list(reader.blocks(8192)))
    return np.rint(volts * (FULL_CODE / manifest.device.amplifier.volts)).astype(int)


def check_arrived(sent: Path, arrived: Path) -> None:
    """The record holds the samples, links and frames of what was sent, to the 16 bits of the line."""
    # Drives are rounded with their error pushed up in frequency, by at most two codes.
    np.testing.assert_allclose(codes(arrived), codes(sent), rtol=0, atol=2)
    wanted, _ = read_waveform(sent)
    found, reader = read_waveform(arrived)
    found.check_digest(reader.path)
    for mine, theirs in zip(wanted.frames, found.frames, strict=True):
        np.testing.assert_array_equal(mine.target, theirs.target)
        assert (mine.start_s, mine.text, mine.cells, mine.page) == (
            theirs.start_s, theirs.text, theirs.cells, theirs.page,
        )  # fmt: skip
    assert wanted.encoding == found.encoding
    t_s = np.linspace(0, wanted.duration_s, 500)
    rough = 3 * 2 * np.pi / wanted.rate_hz + wanted.device.coupling.lam.max / 65535
    np.testing.assert_allclose(found.lam_at(t_s), wanted.lam_at(t_s), atol=rough)


@pytest.mark.parametrize("name", ["paper-6x6", "linked-6x6", "independent-6x6"])
def test_what_arrives_is_what_was_written(tmp_path: Path, name: str) -> None:
    device, clock = load_device(name), SharedClock()
    sent, arrived = tmp_path / "sent.wav", tmp_path / "arrived.wav"
    write_waveform(plan_of(device, 3, 0.25), sent)
    with emulated(device, clock, record=arrived) as emulator:
        report = play_to(emulator.port, sent, clock)
    check_arrived(sent, arrived)
    assert report.underruns == 0
    assert report.lost_s == 0
    assert report.late_s.keys() == {0, 1, 2}


@pytest.mark.slow
def test_a_bad_line_and_a_pulled_cable(tmp_path: Path) -> None:
    device, clock = load_device("paper-6x6"), SharedClock()
    sent, arrived, link = tmp_path / "sent.wav", tmp_path / "arrived.wav", tmp_path / "port"
    write_waveform(plan_of(device, 5, 0.4), sent)
    faults = Faults(drop=0.01, corrupt=0.01, disconnect=FaultWindow(0.8, 0.7))
    with emulated(device, clock, record=arrived, link=link, faults=faults) as emulator:
        report = play_to(str(link), sent, clock)
        assert emulator.status().mischief > 0
    check_arrived(sent, arrived)
    assert report.reconnects >= 1
    assert report.lost_s > 0.4
    assert not link.exists()


@pytest.mark.slow
def test_the_cable_stays_out(tmp_path: Path) -> None:
    device, clock = load_device("independent-6x6"), SharedClock()
    sent, link = tmp_path / "sent.wav", tmp_path / "port"
    write_waveform(plan_of(device, 3, 0.25), sent)
    blocks: list[OutputBlock] = []
    cut = Faults(disconnect=FaultWindow(0.6, 99.0))
    with (
        emulated(device, clock, link=link, faults=cut, on_output=blocks.append),
        pytest.raises(NoAnswer, match="check port and cable"),
    ):
        play_to(str(link), sent, clock, patience_s=0.5)
    assert any(block.volts.any() for block in blocks)
    assert not blocks[-1].volts.any()


def test_no_port_a_wrong_port_and_a_port_in_use(tmp_path: Path) -> None:
    with pytest.raises(PortUnavailable, match="there is no such port; `dotwave ports`"):
        Uart(str(tmp_path / "nothing"))
    with emulated(load_device("independent-6x6"), SharedClock()) as emulator:
        first = Uart(emulator.port)
        with pytest.raises(PortUnavailable, match="another program is using it"):
            Uart(emulator.port)
        first.close()
        Uart(emulator.port).close()
    assert isinstance(serial_ports(), list)


def test_nobody_answers(tmp_path: Path) -> None:
    sent = tmp_path / "sent.wav"
    write_waveform(plan_of(load_device("independent-6x6"), 1, 0.4), sent)
    clock = SharedClock()
    clock.host = time.monotonic  # type: ignore[method-assign]
    master, slave = os.openpty()
    try:
        with pytest.raises(NoAnswer, match="nothing was heard"):
            play_to(os.ttyname(slave), sent, clock, patience_s=0.3)
    finally:
        os.close(master)
        os.close(slave)


HOST = """
import sys
from drivers import open_sink, read_waveform

with open_sink(f"controller:{sys.argv[1]}", patience_s=5.0) as sink:
    sink.play(*read_waveform(sys.argv[2]))
"""


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGINT], ids=["kill -9", "Ctrl-C"])
def test_a_host_that_dies_leaves_the_output_at_zero(tmp_path: Path, number: int) -> None:
    device = load_device("paper-6x6")
    sent = tmp_path / "sent.wav"
    write_waveform(plan_of(device, 8, 0.5), sent)
    spec = ControllerSpec.of(device, **SPEC)
    blocks: list[OutputBlock] = []
    emulator = Emulator(device, spec, on_output=blocks.append)
    host = subprocess.Popen([sys.executable, "-c", HOST, emulator.port, sent], stderr=subprocess.DEVNULL)
    try:
        while emulator.status().played_s < 0.7:
            assert host.poll() is None
            emulator.step(0.002)
        host.send_signal(number)
        killed = emulator.now
        host.wait(100)
        while emulator.now < killed + 1.0:
            emulator.step(0.002)
    finally:
        host.kill()
        host.wait(100)
        emulator.close()
    # What was on the line at the signal is heard after it.
    heard = emulator.controller._heard
    assert heard < killed + 0.5
    volts = np.concatenate([np.abs(block.volts).max(axis=1) for block in blocks])
    at = np.concatenate([block.time_s + np.arange(len(block.volts)) / spec.true_rate_hz for block in blocks])
    assert volts[at < killed].max() > 10
    assert not volts[at >= heard + spec.watchdog_s].any()
    # Down along the ramp: no sample falls by more than a ramp's step, or a step of the waveform itself.
    falling = -np.diff(volts[at >= killed])
    assert falling.max() <= 1.1 * device.amplifier.volts / (spec.ramp_s * spec.rate_hz)


def test_verify_works_on_what_arrived(tmp_path: Path) -> None:
    from dotwave.verification import verify
    from encoders import GridShape, TextOptions, TextSource, encode_text
    from planner import plan_scene

    device, clock = load_device("paper-6x6"), SharedClock()
    sent, arrived = tmp_path / "sent.wav", tmp_path / "arrived.wav"
    scene = encode_text(TextSource.of_text("Hi you"), GridShape(6, 6), TextOptions(dwell_s=0.4))
    write_waveform(plan_scene(scene, device), sent)
    with emulated(device, clock, record=arrived, faults=Faults(drop=0.01, corrupt=0.01)) as emulator:
        play_to(emulator.port, sent, clock)
    before, after = verify(sent), verify(arrived)
    assert after.ok
    assert after.felt_text == before.felt_text
    for wanted, found in zip(before.frames, after.frames, strict=True):
        np.testing.assert_allclose(found.felt, wanted.felt, atol=1e-4)


def test_links_that_change_leave_the_store_full(tmp_path: Path) -> None:
    """In memory, on a clock of its own: room for events goes with the room for samples."""
    from encoders import GridShape, TextOptions, TextSource, encode_text
    from planner import plan_scene

    device = load_device("linked-6x6")
    scene = encode_text(TextSource.of_text("Hello you"), GridShape(6, 6), TextOptions(dwell_s=0.5))
    write_waveform(plan_scene(scene, device), tmp_path / "sent.wav")
    manifest, reader = read_waveform(tmp_path / "sent.wav")
    make = partial(session_messages, manifest, reader, session=42)
    session = HostSession(make, session=42, timing=Timing())
    exchange(session, VirtualController(ControllerSpec.of(device, buffer_s=0.5), now=0.0), step_s=0.002)
    assert session.report.underruns == 0
    # The clock starts with half of it.
    assert session.report.least_buffer_s > 0.2


@pytest.mark.slow
@pytest.mark.parametrize(
    ("seconds", "faults"),
    [(60.0, Faults()), (10.0, Faults(drop=0.01, corrupt=0.01, disconnect=FaultWindow(4.0, 2.0)))],
    ids=["clean", "bad"],
)
def test_a_minute_of_42_channels(tmp_path: Path, seconds: float, faults: Faults) -> None:
    device, clock = load_device("paper-6x6"), SharedClock()
    sent, arrived, link = tmp_path / "sent.wav", tmp_path / "arrived.wav", tmp_path / "port"
    frames = round(seconds / 0.6)
    write_waveform(plan_of(device, frames, 0.6), sent)
    with emulated(device, clock, record=arrived, link=link, faults=faults):
        worked = time.process_time()
        report = play_to(str(link), sent, clock)
        worked = time.process_time() - worked
    check_arrived(sent, arrived)
    assert report.samples >= 8000 * seconds
    # In step with real time: one processor is enough for both ends.
    assert worked < seconds
    if faults == Faults():
        assert (report.underruns, report.lost_s) == (0, 0.0)
        assert max(map(abs, report.late_s.values())) <= 0.001
        assert len(report.late_s) == frames
    else:
        assert report.lost_s > 1.4
