"""Waveforms that go out without samples: what is drawn of them, what is not, and that the dots are the same."""

from __future__ import annotations

import fcntl
import json
import re
import subprocess
import sys
from collections.abc import Iterator
from functools import partial
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

import dotwave as dw
from drivers import FileError, Manifest, SampleReader, UnfitController, WavWriter, read_waveform
from drivers.protocol.envelope import EnvelopeMix
from drivers.protocol.faults import Faults
from drivers.protocol.messages import Mark
from drivers.protocol.parametric import NotParametric, ParametricSession
from drivers.protocol.pieces import NoPiece, Piece, pieces_of
from drivers.protocol.playout import ControllerSpec
from drivers.protocol.replies import Capabilities
from drivers.protocol.vectors import write_vectors
from tests.drivers.protocol.test_firmware import FirmwareBench
from tests.support.firmware import LINKED, PAPER, GivenProgram, built, need

ROOM = "-DDW_BUFFER_SAMPLES=0u -DDW_EVENT_SLOTS=1024u -DDW_MAX_PAYLOAD=512u"
GRIDS = {"paper-6x6": PAPER, "linked-6x6": LINKED}


@pytest.fixture(scope="module")
def hello(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """ "Hello world" for each device, as a written waveform."""
    folder, paths = tmp_path_factory.mktemp("hello"), {}
    for device in GRIDS:
        paths[device] = folder / f"{device}.wav"
        dw.plan(dw.text("Hello world", device), device).waveform().write(paths[device])
    return paths


def capabilities(manifest: Manifest, *, version: int = 5, buffer_samples: int = 0) -> Capabilities:
    spec = ControllerSpec.of(manifest.device)
    return Capabilities(
        version=version, rows=spec.rows, cols=spec.cols, channels=spec.channels, rate_hz=spec.rate_hz, bits=16,
        buffer_samples=buffer_samples, event_slots=512, max_payload=512, full_volts=spec.full_volts,
        lam_step=spec.lam_step, lam_max=spec.lam_max, watchdog_ms=200, ramp_ms=50, session=0, next_number=0,
    )  # fmt: skip


@pytest.mark.parametrize(("device", "most_bytes"), [("paper-6x6", 80_000), ("linked-6x6", 40_000)])
def test_what_is_drawn_is_what_was_written(device: str, most_bytes: int, hello: dict[str, Path]) -> None:
    manifest, reader = read_waveform(hello[device])
    session = ParametricSession.of(manifest, reader)
    written = np.concatenate(list(reader.blocks(4096)))
    assert sum(len(event.packet(0).payload) for event in session.envelopes) < min(most_bytes, written.nbytes / 50)
    assert [event.at for event in session.envelopes] == sorted(event.at for event in session.envelopes)
    mixes = [EnvelopeMix() for _ in manifest.channels]
    cuts = sorted({event.at for event in session.envelopes} | {manifest.samples})
    waiting = iter(session.envelopes)
    event = next(waiting, None)
    for first, stop in pairwise(cuts):
        while event is not None and event.at == first:
            mixes[event.channel].change(event)
            event = next(waiting, None)
        index = np.arange(first, stop)
        drawn = np.stack([mix.at(index) for mix in mixes], axis=1)
        assert np.abs(drawn - written[first:stop]).max() <= 1.1e-6 * manifest.device.amplifier.volts
    assert not written[: cuts[0]].any()


@pytest.mark.parametrize("device", GRIDS)
def test_the_firmware_draws_the_same_dots_and_text(device: str, hello: dict[str, Path], tmp_path: Path) -> None:
    manifest, reader = read_waveform(hello[device])
    session, grid = ParametricSession.of(manifest, reader), GRIDS[device]
    with GivenProgram(built("given", grid.name, ROOM), grid) as program:
        bench = FirmwareBench(partial(session.messages, session=7), program, Faults(drop=0.01, corrupt=0.01))
        bench.run(10.0)
    assert bench.session.report.underruns == 0
    codes = np.concatenate([answer.codes for answer in bench.answers])
    links = np.concatenate([answer.links for answer in bench.answers])
    # Outside of the session every vector is zero, and so is the first of it.
    began = np.flatnonzero((codes != 0).any(axis=1))[0] - first_that_moves(reader)
    stop = began + manifest.samples
    record = tmp_path / "record"
    record.write_bytes(packed(links[began:stop], codes[began:stop]))
    assert write_vectors(record, manifest, tmp_path / "played.wav") == manifest.samples
    felt = dw.verify(tmp_path / "played.wav")
    as_written = dw.verify(hello[device])
    assert (felt.ok, felt.text) == (True, as_written.text)
    assert sum(frame.wrong_dots for frame in felt.frames) == 0


def first_that_moves(reader: SampleReader) -> int:
    """The first sample that is a code other than 0."""
    volts = np.concatenate(list(reader.blocks(4096)))
    return int(np.flatnonzero((np.abs(volts) > 100.0 / 32767 / 2).any(axis=1))[0])


def packed(links: np.ndarray, codes: np.ndarray) -> bytes:
    """A record as a port writes it."""
    rows, each = links.shape[1:]
    record = np.zeros(
        len(codes), dtype=[("at", "<u8"), ("links", "<u2", (rows, each)), ("codes", "<i2", codes.shape[1])]
    )
    record["at"], record["links"], record["codes"] = np.arange(len(codes)), links, codes
    return record.tobytes()


def test_a_record_of_something_else_is_refused(hello: dict[str, Path], tmp_path: Path) -> None:
    manifest, _ = read_waveform(hello["paper-6x6"])
    record = tmp_path / "record"
    for spoiled in (b"", bytes(100), packed(np.zeros((9, 6, 5)), np.zeros((9, 42)))[152:]):
        record.write_bytes(spoiled)
        with pytest.raises(FileError, match="no whole session"):
            write_vectors(record, manifest, tmp_path / "played.wav")


def test_a_waveform_that_is_no_tone_is_not_drawn(hello: dict[str, Path], tmp_path: Path) -> None:
    manifest, reader = read_waveform(hello["linked-6x6"])
    volts = np.concatenate(list(reader.blocks(4096)))
    volts[5000:5100, 2] += np.random.default_rng(1).normal(0, 0.1, 100)
    path = tmp_path / "noise.wav"
    with path.open("wb") as file:
        writer = WavWriter(file, manifest.channels, manifest.rate_hz, "float32")
        writer.write(volts)
        writer.finish()
    text = hello["linked-6x6"].with_suffix(".json").read_text(encoding="utf-8")
    path.with_suffix(".json").write_text(text, encoding="utf-8")
    with pytest.raises(NotParametric, match=r"channel 2 .* at 0\.2\d\d s: .*no tone"):
        ParametricSession.of(manifest, NoisyReader(reader, volts))


class NoisyReader:
    """Other samples under the name of a file."""

    def __init__(self, reader: SampleReader, volts: np.ndarray) -> None:
        self.path, self.rate_hz, self.samples, self._volts = reader.path, reader.rate_hz, reader.samples, volts

    def blocks(self, block: int) -> Iterator[np.ndarray]:
        for first in range(0, len(self._volts), block):
            yield self._volts[first : first + block]


def test_a_controller_that_cannot_is_told_so(hello: dict[str, Path]) -> None:
    manifest, reader = read_waveform(hello["paper-6x6"])
    session = ParametricSession.of(manifest, reader)
    with pytest.raises(UnfitController, match="knows no envelopes"):
        session.messages(capabilities(manifest, version=4), session=1)
    marks = [one for one in session.messages(capabilities(manifest), session=1) if isinstance(one, Mark)]
    assert len(marks) == len(manifest.frames)


def test_pieces_are_exact_for_what_they_are() -> None:
    turns, index = 1 << 58, np.arange(3000)
    s = index / 3000
    wave = np.exp(2j * np.pi * index * turns / 2**64)
    volts = ((10 * s**3 + 5j * s) * wave).real
    (piece,) = pieces_of(volts, 0, (turns,), 1e-9, 100.0)
    assert (piece.at, piece.samples) == (0, 3000)
    np.testing.assert_allclose(piece.points[0], [0, 5j / 3, 10j / 3, 10 + 5j], atol=1e-8)
    standing = pieces_of((3 * wave).real, 0, (turns,), 1e-9, 100.0)
    assert [len(one.points[0]) for one in standing] == [1]
    assert list(pieces_of(np.zeros(0), 0, (turns,), 1e-9, 100.0)) == []
    assert list(pieces_of(np.zeros(9), 4, (), 1e-9, 100.0)) == [Piece(4, 9, ())]
    with pytest.raises(NoPiece):
        list(pieces_of(np.random.default_rng(2).normal(size=200), 0, (turns,), 1e-9, 100.0))


def play(port: str, path: Path, seconds: float) -> dict[str, object]:
    """What `dotwave play --parametric` reports."""
    command = [sys.executable, "-m", "dotwave", "play", str(path), "--port", port, "--live", "--parametric", "--json"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=seconds, check=False)
    assert done.returncode == 0, done.stderr
    report: dict[str, object] = json.loads(done.stdout)
    return report


@pytest.fixture
def alone(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """An emulator takes a core for itself: two at a time leave none to who talks to them."""
    with (tmp_path_factory.getbasetemp().parent / "emulator").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield


@pytest.mark.slow
@pytest.mark.usefixtures("alone")
@pytest.mark.parametrize("device", GRIDS)
def test_an_emulated_cortex_m_plays_hello_world(device: str, hello: dict[str, Path], tmp_path: Path) -> None:
    need("qemu-system-arm")
    record = tmp_path / "record"
    image = built("cortex-m", GRIDS[device].name)
    config = f"enable=on,target=native,arg=dotwave,arg={record}"
    command = ["qemu-system-arm", "-M", "mps2-an386", "-display", "none", "-monitor", "none", "-serial", "pty"]
    with subprocess.Popen(
        [*command, "-semihosting-config", config, "-kernel", image], stdout=subprocess.PIPE, text=True
    ) as emulator:
        assert emulator.stdout is not None
        found = re.search(r"/dev/pts/\d+", emulator.stdout.readline())
        assert found is not None
        try:
            report = play(found[0], hello[device], 900.0)
        finally:
            emulator.terminate()
    assert report["ok"]
    write_vectors(record, read_waveform(hello[device])[0], tmp_path / "played.wav")
    felt = dw.verify(tmp_path / "played.wav")
    assert (felt.ok, felt.text) == (True, dw.verify(hello[device]).text)
    assert sum(frame.wrong_dots for frame in felt.frames) == 0


@pytest.mark.slow
@pytest.mark.parametrize("drawn", [True, False])
def test_the_program_on_a_terminal_plays_hello_world(drawn: bool, hello: dict[str, Path], tmp_path: Path) -> None:
    record = tmp_path / "record"
    command = [str(built("posix", "paper_6x6")), "--record", str(record)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as controller:
        assert controller.stdout is not None
        port = controller.stdout.readline().strip()
        try:
            if drawn:
                assert play(port, hello["paper-6x6"], 60.0)["ok"]
            else:
                done = [sys.executable, "-m", "dotwave", "play", str(hello["paper-6x6"]), "--port", port, "--live"]
                subprocess.run(done, check=False, timeout=60, capture_output=True)
        finally:
            controller.terminate()
    assert controller.returncode == 0
    assert write_vectors(record, read_waveform(hello["paper-6x6"])[0], tmp_path / "played.wav")
    assert dw.verify(tmp_path / "played.wav").ok
