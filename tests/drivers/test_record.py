"""What arrived of a session that was cut short is kept, as a pair that is read like any other."""

from __future__ import annotations

import io
import json
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import takewhile
from pathlib import Path

import numpy as np
import pytest

from chainsim import Device, load_device
from dotwave.playing.emulate import emulate
from dotwave.verification import verify
from drivers import read_waveform, write_waveform
from drivers.protocol.emulator import Emulator
from drivers.protocol.messages import FULL_CODE, VERSION, SamplesMessage, StartMessage
from drivers.protocol.outgoing import End, Message, session_messages
from drivers.protocol.packet import Kind, Packet, encode
from drivers.protocol.parametric import ParametricSession
from drivers.protocol.playout import ControllerSpec
from drivers.protocol.record import ArrivalRecorder, CutShort
from drivers.protocol.virtual_controller import VirtualController
from encoders import GridShape, TextOptions, TextSource, encode_text
from planner import plan_scene

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="needs a pseudo-terminal")

DEVICE = load_device("paper-6x6")


@pytest.fixture(scope="module")
def sent(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Frames of half a second."""
    path = tmp_path_factory.mktemp("sent") / "sent.wav"
    scene = encode_text(TextSource.of_text("one two three four five six"), GridShape(6, 6), TextOptions(dwell_s=0.5))
    write_waveform(plan_scene(scene, DEVICE), path)
    return path


def messages(path: Path, device: Device = DEVICE) -> Iterator[Message]:
    manifest, reader = read_waveform(path)
    found = VirtualController(ControllerSpec.of(device, buffer_s=1.0), now=0.0)._capabilities()
    return session_messages(manifest, reader, found, session=7)


def take(recorder: ArrivalRecorder, messages: Iterator[Message]) -> None:
    for message in messages:
        if isinstance(message, StartMessage):
            recorder.start(message)
        elif isinstance(message, SamplesMessage):
            recorder.samples(message.codes)
        elif isinstance(message, End):
            recorder.end()
        else:
            recorder.event(message)


def until(path: Path, time_s: float) -> Iterator[Message]:
    """The messages of a session before the samples at a time."""
    first = time_s * DEVICE.amplifier.rate_hz
    return takewhile(lambda message: not isinstance(message, SamplesMessage) or message.first < first, messages(path))


def codes(path: Path) -> np.ndarray:
    manifest, reader = read_waveform(path)
    manifest.check_digest(reader.path)
    return np.rint(np.concatenate(list(reader.blocks(8192))) * (FULL_CODE / DEVICE.amplifier.volts)).astype(int)


def files(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def test_a_session_without_samples_is_kept_as_it_is_drawn(tmp_path: Path, sent: Path) -> None:
    path, (manifest, reader) = tmp_path / "drawn.wav", read_waveform(sent)
    recorder = ArrivalRecorder(DEVICE, path)
    controller = VirtualController(ControllerSpec.of(DEVICE), now=0.0, recorder=recorder)
    controller.receive(encode(Packet(Kind.HELLO, 0, VERSION.to_bytes(2, "little"))), 0.0)
    session = ParametricSession.of(manifest, reader).messages(controller._capabilities(), session=7)
    now = 0.0
    for number, message in enumerate(session):
        now = max(now, (getattr(message, "at", 0) / manifest.rate_hz) - 0.5)
        controller.receive(encode(message.packet(number)), now)
        while controller.playout.events_done + 4000 < number:
            now += 0.01
            controller.receive(encode(Packet(Kind.HEARTBEAT)), now)
    assert not path.exists()
    end = now + manifest.duration_s + 0.2
    while now < end:
        now += 0.02
        controller.receive(encode(Packet(Kind.HEARTBEAT)), now)
    assert recorder.finished == 1
    felt = verify(path)
    assert (felt.ok, felt.samples, felt.felt_text) == (True, manifest.samples, "one two three four five six")
    drawn, written = (np.concatenate(list(read_waveform(one)[1].blocks(8192))) for one in (path, sent))
    assert np.abs(drawn - written).max() <= 2e-6 * DEVICE.amplifier.volts


@pytest.mark.parametrize("time_s", [0.01, 0.52, 1.4, 2.4])
def test_what_arrived_is_kept_and_verified(tmp_path: Path, sent: Path, time_s: float) -> None:
    path = tmp_path / "arrived.wav"
    take(ArrivalRecorder(DEVICE, tmp_path / "whole.wav"), messages(sent))
    recorder = ArrivalRecorder(DEVICE, path)
    take(recorder, until(sent, time_s))
    assert not path.exists()
    recorder.cut()
    whole, found = codes(tmp_path / "whole.wav"), codes(path)
    assert len(found) == pytest.approx(time_s * 8000, abs=200)
    np.testing.assert_array_equal(found, whole[: len(found)])
    total_s = len(whole) / 8000
    assert recorder.cut_short == CutShort(len(found) / 8000, total_s)
    assert json.loads(path.with_suffix(".json").read_bytes())["complete"] is False
    # A frame is there when its pattern stood for a while, and ends where the samples do.
    frames, end_s = read_waveform(sent)[0].frames, len(found) / 8000
    kept = read_waveform(path)[0].frames
    assert len(kept) == sum(frame.settled_s + 1 / DEVICE.f0_hz <= end_s for frame in frames)
    for mine, theirs in zip(kept, frames, strict=False):
        assert (mine.text, mine.settled_s, mine.end_s) == (theirs.text, theirs.settled_s, min(theirs.end_s, end_s))
    report = verify(path)
    assert [frame.ok for frame in report.frames] == [True] * len(kept)
    assert report.as_text()
    json.dumps(report.as_dict(), allow_nan=False)


def test_a_complete_session_says_nothing_and_replaces_a_cut_one(tmp_path: Path, sent: Path) -> None:
    path = tmp_path / "arrived.wav"
    recorder = ArrivalRecorder(DEVICE, path)
    take(recorder, until(sent, 1.0))
    take(recorder, messages(sent))
    assert (recorder.finished, recorder.cut_short) == (1, None)
    assert "complete" not in json.loads(path.with_suffix(".json").read_bytes())
    assert verify(path).ok
    before = files(tmp_path)
    recorder.cut()
    assert files(tmp_path) == before


def test_a_new_session_keeps_what_arrived_of_the_one_before(tmp_path: Path, sent: Path) -> None:
    path = tmp_path / "arrived.wav"
    recorder = ArrivalRecorder(DEVICE, path)
    take(recorder, until(sent, 1.0))
    take(recorder, until(sent, 0.0))
    assert len(codes(path)) == pytest.approx(8000, abs=200)
    recorder.cut()
    assert recorder.cut_short == CutShort(0.0, len(codes(sent)) / 8000)


def test_a_session_without_a_sample_leaves_the_record_before_it(tmp_path: Path, sent: Path) -> None:
    recorder = ArrivalRecorder(DEVICE, tmp_path / "arrived.wav")
    take(recorder, messages(sent))
    before = files(tmp_path)
    take(recorder, until(sent, 0.0))
    recorder.cut()
    assert files(tmp_path) == before


def test_an_interrupt_within_a_write_spoils_no_sample(tmp_path: Path, sent: Path) -> None:
    recorder = ArrivalRecorder(DEVICE, tmp_path / "arrived.wav")
    take(recorder, until(sent, 0.5))
    recorder._file.write(b"half of a block")
    recorder.cut()
    assert len(codes(tmp_path / "arrived.wav")) == pytest.approx(4000, abs=200)


def test_notes_that_are_no_frames_spoil_no_record(tmp_path: Path, sent: Path) -> None:
    recorder = ArrivalRecorder(DEVICE, tmp_path / "arrived.wav")
    take(recorder, until(sent, 0.5))
    recorder._frames += [{"settled_s": "0", "end_s": 0.1}, {"end_s": 1}, {}]
    recorder.cut()
    assert len(read_waveform(tmp_path / "arrived.wav")[0].frames) == 1


HOST = """
import sys
import time
from pathlib import Path
from dotwave.playing.play import play
while not Path(sys.argv[1]).exists():
    time.sleep(0.01)
play(Path(sys.argv[2]), live=True, port=sys.argv[1])
"""


@contextmanager
def host(port: str, path: Path) -> Iterator[subprocess.Popen[bytes]]:
    process = subprocess.Popen([sys.executable, "-c", HOST, port, path], stderr=subprocess.DEVNULL)
    try:
        yield process
    finally:
        process.kill()
        process.wait(30)


def played(emulator: Emulator, seconds: float) -> None:
    deadline = time.monotonic() + 60
    while emulator.status().played_s < seconds:
        assert time.monotonic() < deadline
        emulator.step(0.002)


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGINT], ids=["kill -9", "Ctrl-C"])
def test_a_host_that_dies(tmp_path: Path, sent: Path, number: int) -> None:
    path = tmp_path / "arrived.wav"
    # What is stored ahead is less than what is left when the host dies.
    spec = ControllerSpec.of(DEVICE, buffer_s=0.5, watchdog_s=2.0)
    emulator = Emulator(DEVICE, spec, record=path)
    with host(emulator.port, sent) as process:
        played(emulator, 0.7)
        process.send_signal(number)
        if number == signal.SIGINT:
            # It says so: the record is there at once.
            deadline = time.monotonic() + 60
            while not path.with_suffix(".json").exists():
                assert time.monotonic() < deadline
                emulator.step(0.002)
        emulator.close()
    status = emulator.status()
    assert status.recorded == 0
    assert status.cut_short is not None
    assert 0.7 <= status.cut_short.arrived_s < status.cut_short.total_s
    report = verify(path)
    assert report.samples == round(8000 * status.cut_short.arrived_s)
    assert report.frames
    assert all(frame.ok for frame in report.frames)


def test_a_stopped_emulator_says_how_much_arrived(tmp_path: Path, sent: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, link, out = tmp_path / "arrived.wav", tmp_path / "port", io.StringIO()
    step = Emulator.step

    def stopped(self: Emulator, wait_s: float) -> None:
        step(self, wait_s)
        if self.status().played_s > 0.7:
            raise KeyboardInterrupt

    monkeypatch.setattr(Emulator, "step", stopped)
    with host(str(link), sent):
        report = emulate(device="paper-6x6", link=link, record=path, seconds=60, out=out, buffer_s=0.5, watchdog_s=2.0)
    cut = report.as_dict()["cut_short"]
    assert cut["arrived_s"] == verify(path).samples / 8000
    assert f"cut short: {cut['arrived_s']:.2f} of {cut['total_s']:.2f} s arrived" in report.as_text()
    assert f"dotwave verify {path}" in report.as_text()
    json.dumps(report.as_dict(), allow_nan=False)
