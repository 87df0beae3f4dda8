"""The DRV2667 board: records as the data sheet reads them, budgets, refusals, and both firmwares with their faults."""

from __future__ import annotations

import json
import struct
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from hypothesis import given, strategies as st
from numpy.typing import NDArray

from chainsim import Device, load_device
from drivers import WavWriter, channels_of, read_waveform
from drivers.sinks.audio import AudioError, AudioUnavailable, parse_outputs, play_audio
from drivers.sinks.board_serial import BoardEmulator, Firmware, grid_line, play_grid_lines
from drivers.sinks.drv2667 import (
    GAIN_VOLTS,
    BoardRefusal,
    SynthRecord,
    frequency_byte,
    gain_for,
    load_writes,
    synth_records,
)
from drivers.sinks.tactile_board import BoardPlan, plan_board, socket_of
from drivers.waveform.manifest import digest_of

DEVICE = load_device("independent-6x6")
RATE = DEVICE.amplifier.rate_hz


class Chip:
    """A DRV2667 read from its data sheet: registers on page 0, RAM behind the page register, what GO plays."""

    def __init__(self) -> None:
        self.page, self.control, self.ram = 0, {0x02: 0x40}, bytearray(2048)

    def write(self, register: int, value: int) -> None:
        if register == 0xFF:
            self.page = value
        elif self.page:
            self.ram[256 * (self.page - 1) + register] = value
        else:
            self.control[register] = value

    def sounds(self) -> list[tuple[float, float, float]]:
        """(peak volts, hertz, seconds) of sequence 1, in order."""
        assert self.control[0x02] & 0x40 == 0, "in standby"
        assert self.control[0x03] == 1
        assert self.control[0x04] == 0
        assert self.ram[0] == 5 * 1 + 1 - 1
        upper, lower, stop_upper, stop_lower, repeat = self.ram[1:6]
        assert upper & 0x80, "not synthesis"
        assert repeat == 1
        data = self.ram[256 * (upper & 7) + lower : 256 * stop_upper + stop_lower + 1]
        peak = (25, 50, 75, 100)[self.control[0x01] & 3]
        chunks = struct.iter_unpack("4B", data)
        return [(a / 255 * peak, 7.8125 * f, c / (7.8125 * f)) for a, f, c, _ in chunks]


@given(st.floats(0, 100), st.floats(8, 500), st.floats(0.02, 20), st.sampled_from([0.0, 0.03, 0.1, 1.0]))
def test_what_a_chip_plays_is_what_was_asked(volts: float, hz: float, duration_s: float, ramp_s: float) -> None:
    byte, gain = frequency_byte(hz), gain_for(volts)
    records = synth_records(volts, byte, duration_s, gain=gain, ramp_s=ramp_s)
    if not records:
        assert volts <= GAIN_VOLTS[gain] / 510
        return
    chip = Chip()
    for register, value in load_writes(records, gain):
        chip.write(register, value)
    sounds = chip.sounds()
    assert chip.page == 0
    assert {round(f, 6) for _, f, _ in sounds} == {round(7.8125 * byte, 6)}
    assert abs(7.8125 * byte - hz) <= 7.8125 / 2
    assert all(abs(v - volts) <= GAIN_VOLTS[gain] / 510 + 1e-9 for v, _, _ in sounds)
    # To the nearest cycle, and never less than one.
    assert (
        abs(sum(t for _, _, t in sounds) - duration_s)
        <= max(0.5 / (7.8125 * byte), 1 / (7.8125 * byte) - duration_s) + 1e-9
    )
    ups, downs = [r.envelope >> 4 for r in records], [r.envelope & 15 for r in records]
    assert not any(ups[1:])
    assert not any(downs[:-1])


def test_limits_of_a_chip() -> None:
    assert frequency_byte(133.13) == 17
    assert SynthRecord(255, 17, 133).hz == 132.8125
    assert [gain_for(v) for v in (0, 25, 25.1, 50, 74, 75.1, 100)] == [0, 0, 1, 1, 2, 3, 3]
    for call in (
        lambda: gain_for(101), lambda: frequency_byte(3), lambda: frequency_byte(2000), lambda: SynthRecord(256, 1, 1),
        lambda: SynthRecord(1, 0, 1), lambda: SynthRecord(1, 1, 0),
        lambda: synth_records(50, 17, 200, gain=3, ramp_s=0),
    ):  # fmt: skip
        with pytest.raises(BoardRefusal):
            call()


def test_the_sockets_are_the_published_tables() -> None:
    # waveformValues (dots) and waveformPositions (cells) of TACTILE_DISPLAY_V1.ino, both counted from 1.
    values = [[1, 4, 1, 4, 1, 4], [2, 5, 2, 5, 2, 5], [3, 6, 3, 6, 3, 6]] * 2
    positions = [[1, 1, 2, 2, 3, 3]] * 3 + [[4, 4, 5, 5, 6, 6]] * 3
    for row in range(6):
        for col in range(6):
            assert socket_of(row, col) == (positions[row][col] - 1, values[row][col] - 1)


def written(
    folder: Path, drive: np.ndarray, *, omega: float = 1.06, dwell_s: float = 0.5, device: Device = DEVICE,
    shape: Callable[[np.ndarray], np.ndarray] | None = None,
) -> tuple[Path, np.ndarray]:  # fmt: skip
    """One frame with these drive phasors (volts), and the level each actuator has under them."""
    path = folder / "made.wav"
    t_s = np.arange(round((dwell_s + 0.1) * RATE)) / RATE
    angle = omega * device.tau_per_s * t_s
    volts = np.real(drive.ravel()[np.newaxis] * np.exp(1j * angle)[:, np.newaxis])
    if shape is not None:
        volts *= shape(t_s)[:, np.newaxis]
    channels = channels_of(device)
    with path.open("wb") as file:
        writer = WavWriter(file, channels, RATE, "float32")
        writer.write(np.pad(volts, ((0, 0), (0, len(channels) - 36))))
        writer.finish()
    level = np.zeros(drive.shape)
    for _ in range(200):
        stiff = 1 - omega**2 + 0.75 * device.beta * level**2 + 1j * device.delta * omega
        level = np.abs(drive) * device.epsilon_per_volt / np.abs(stiff)
    frame = {
        "start_s": 0.0, "settled_s": 0.2, "end_s": dwell_s, "omega": [omega] * 6,
        "target": (level / device.full_scale).tolist(), "outcome": "ok",
    }  # fmt: skip
    manifest: dict[str, Any] = {
        "schema": "dotwave/waveform/1", "samples_file": path.name, "rate_hz": RATE, "samples": len(t_s),
        "digest": digest_of(path), "device": device.as_dict(),
        "channels": [channel.as_dict() for channel in channels], "coupling": [], "frames": [frame],
    }  # fmt: skip
    path.with_suffix(".json").write_text(json.dumps(manifest))
    return path, level


def planned(folder: Path, drive: np.ndarray, **options: Any) -> BoardPlan:
    return plan_board(*read_waveform(written(folder, drive, **options)[0]))


def test_a_pattern_becomes_records_that_are_felt_alike(tmp_path: Path) -> None:
    from chainsim import Setting, solve

    dots = np.random.default_rng(4).random((6, 6)) < 0.5
    path, level = written(tmp_path, np.where(dots, 4.0, 0.4).astype(complex))
    board = plan_board(*read_waveform(path))
    (frame,) = board.frames
    np.testing.assert_array_equal(frame.dots, level / DEVICE.full_scale >= 0.5)
    assert len(frame.records) == 36
    assert board.frequency_error_hz == pytest.approx(abs(18 * 7.8125 - 1.06 * 133.13))
    assert board.frequency_error_hz < 7.8125 / 2
    # The full solver at the chip's own frequency and volts finds the level that was planned.
    worst = 0.0
    for row in range(6):
        for col in range(6):
            record = frame.records[socket_of(row, col)][0]
            setting = Setting.of(
                DEVICE.chain, epsilon=record.volts(board.gain) * DEVICE.epsilon_per_volt, lam=np.zeros((1, 0)),
                omega=record.hz / DEVICE.f0_hz,
            )  # fmt: skip
            felt = abs(complex(solve(DEVICE.chain, setting, tol=1e-8).phasor[0, 0]))
            worst = max(worst, abs(felt - level[row, col]) / DEVICE.full_scale)
    assert worst < 0.02
    assert worst == pytest.approx(board.level_error, rel=0.25, abs=1e-3)


def test_the_budget_is_that_of_the_bus(tmp_path: Path) -> None:
    board = planned(tmp_path, np.full((6, 6), 10.0 + 0j))
    # 36 chips: 12 register writes, 4 a record (one each), a select for each chip and each multiplexer switched off.
    assert board.load_s == pytest.approx((36 * 16 * 29 + 42 * 20) / 400e3)
    assert board.skew_s == pytest.approx((35 * (20 + 58) + 5 * 20) / 400e3)
    # About one period of the drive: no phase can be kept.
    assert board.skew_s * 133 == pytest.approx(0.9, abs=0.1)


def waves() -> NDArray[np.complex128]:
    found: NDArray[np.complex128] = 10 * np.exp(-1j * np.deg2rad(60) * np.arange(6))[np.newaxis] * np.ones((6, 1))
    return found


def test_what_the_board_cannot_do_is_refused(tmp_path: Path) -> None:
    still = np.full((6, 6), 10.0 + 0j)
    cases: list[tuple[dict[str, Any], str]] = [
        ({"drive": waves()}, "different phases"),
        ({"drive": still, "dwell_s": 0.24, "shape": lambda t: 1 + 0.5 * np.cos(200 * t)}, "not one steady tone"),
        ({"drive": still * 9.6, "omega": 1.21}, "V are needed"),
        ({"drive": still, "dwell_s": 0.21, "device": load_device("paper-6x6")}, "plan for independent-6x6"),
    ]
    for options, why in cases:
        with pytest.raises(BoardRefusal, match=why):
            planned(tmp_path, **options)


def test_frames_shorter_than_their_loading_are_refused(tmp_path: Path) -> None:
    path, _ = written(tmp_path, np.full((6, 6), 10.0 + 0j))
    manifest_path = path.with_suffix(".json")
    manifest = json.loads(manifest_path.read_text())
    manifest["frames"][0].update(start_s=0.46, settled_s=0.47, end_s=0.5)
    manifest_path.write_text(json.dumps(manifest))
    with pytest.raises(BoardRefusal, match="loading takes 44 ms of I2C, the frame lasts 40 ms"):
        plan_board(*read_waveform(path))


DOTS = np.random.default_rng(9).random((6, 6)) < 0.5


def test_the_corrected_firmware_shows_the_grid() -> None:
    board = BoardEmulator(Firmware.CORRECTED, now=0.0)
    line = grid_line(DOTS, Firmware.CORRECTED)
    assert len(line) == 38
    board.receive(line, 3.0)
    np.testing.assert_array_equal(board.dots, DOTS)
    assert board.outgoing() == line[:-1] + b"\r\n"
    board.receive(b"~111\n", 3.1)
    assert b"Invalid" in board.outgoing()
    np.testing.assert_array_equal(board.dots, DOTS)


def test_the_branchs_firmware_rejects_every_grid() -> None:
    with pytest.raises(BoardRefusal, match="--firmware corrected"):
        grid_line(DOTS, Firmware.TEST_PIXEL)
    board = BoardEmulator(Firmware.TEST_PIXEL, now=0.0)
    for now, digits in enumerate((36, 64), 3):
        board.receive(b"~" + b"1" * digits + b"\n", float(now))
        assert b"Invalid input string length." in board.outgoing()
    # 63 digits and the ~ make the 64 it wants, and then it draws nothing.
    board.receive(b"~" + b"1" * 63 + b"\n", 6.0)
    assert b"Invalid" not in board.outgoing()
    assert not board.dots.any()


@pytest.mark.parametrize("firmware", Firmware)
def test_faults_of_the_real_board(firmware: Firmware) -> None:
    board = BoardEmulator(firmware, now=0.0, boot_s=2.0)
    # During the scan at start-up 64 bytes wait, the rest is lost.
    board.receive(b"a" * 70, 1.0)
    assert (board.lost, board.outgoing()) == (6, b"")
    # No newline: the line ends after a second of silence; one character is played, and two seconds are gone.
    board.tick(2.9)
    assert board.characters == []
    board.tick(3.1)
    assert board.characters == ["a"]
    board.receive(b"b\nc\n", 3.2)
    board.tick(5.0)
    assert board.characters == ["a"]
    board.tick(5.2)
    board.tick(7.3)
    assert board.characters == ["a", "b", "c"]


class Wire:
    """A line to a `BoardEmulator`, on a clock that `sleep` turns."""

    def __init__(self, board: BoardEmulator, break_at: float = np.inf) -> None:
        self.board, self.now, self.break_at, self.sent = board, 10.0, break_at, list[tuple[float, bytes]]()

    def read(self, wait_s: float) -> bytes:
        return self.board.outgoing()

    def write(self, data: bytes) -> None:
        self.sent.append((self.now - 10.0, data))
        self.board.receive(data, self.now)

    def close(self) -> None:
        pass

    def sleep(self, seconds: float) -> None:
        self.now += seconds
        if self.now - 10.0 > self.break_at:
            raise KeyboardInterrupt


@pytest.mark.parametrize("break_at", [np.inf, 1.1], ids=["to the end", "Ctrl-C"])
def test_frames_go_out_by_the_clock_and_the_grid_ends_empty(break_at: float) -> None:
    board = BoardEmulator(Firmware.CORRECTED, now=0.0)
    wire = Wire(board, break_at)
    dark = grid_line(np.zeros((6, 6), dtype=bool), Firmware.CORRECTED)
    lines = [(0.0, grid_line(DOTS, Firmware.CORRECTED)), (0.7, grid_line(~DOTS, Firmware.CORRECTED)), (1.5, b"")]

    def play() -> int:
        return play_grid_lines(lines, wire, silence=dark, clock=lambda: wire.now, sleep=wire.sleep)

    if break_at < np.inf:
        with pytest.raises(KeyboardInterrupt):
            play()
    else:
        assert play() == 2
    assert [data for _, data in wire.sent] == [lines[0][1], lines[1][1], dark]
    assert [at for at, _ in wire.sent[:2]] == pytest.approx([0.0, 0.7])
    assert not board.dots.any()


class FakeCard(ModuleType):
    """A `sounddevice` that keeps what is written."""

    class PortAudioError(Exception):
        pass

    def __init__(self, fail_at: int | None = None, error: type[BaseException] = KeyboardInterrupt) -> None:
        super().__init__("sounddevice")
        self.kept: list[np.ndarray] = []
        self.options: dict[str, Any] = {}
        self._fail_at, self._error = fail_at, error

    def OutputStream(self, **options: Any) -> FakeCard:  # noqa: N802
        if options["device"] == "none":
            raise self.PortAudioError("Error querying device -1")
        self.options = options
        return self

    def __enter__(self) -> FakeCard:
        return self

    def __exit__(self, *_: object) -> None:
        pass

    def write(self, block: np.ndarray) -> None:
        if self._fail_at == len(self.kept):
            self._fail_at = None
            raise self._error
        self.kept.append(block.copy())


@pytest.fixture
def card(monkeypatch: pytest.MonkeyPatch) -> FakeCard:
    fake = FakeCard()
    monkeypatch.setitem(sys.modules, "sounddevice", fake)
    return fake


def test_audio_maps_channels_and_ramps_to_zero(tmp_path: Path, card: FakeCard) -> None:
    drive = 10.0 * np.arange(1, 37).reshape(6, 6) / 36 + 0j
    manifest, reader = read_waveform(written(tmp_path, drive)[0])
    outputs = parse_outputs("0:40,3:0", 36)
    play_audio(manifest, reader, device=None, outputs=outputs)
    assert (card.options["samplerate"], card.options["channels"]) == (RATE, 41)
    out, volts = np.concatenate(card.kept), np.concatenate(list(reader.blocks(9999)))
    np.testing.assert_allclose(out[: len(volts), 40], volts[:, 0] / 100, atol=1e-7)
    np.testing.assert_allclose(out[: len(volts), 0], volts[:, 3] / 100, atol=1e-7)
    assert not out[:, 3].any()
    assert not out[-1].any()
    ramp = out[len(volts) - 1 :, 5]
    assert len(ramp) == round(0.05 * RATE) + 1
    np.testing.assert_allclose(np.diff(ramp), np.diff(ramp)[0], atol=1e-7)


def test_audio_ramps_to_zero_on_ctrl_c(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    fake = FakeCard(fail_at=3)
    monkeypatch.setitem(sys.modules, "sounddevice", fake)
    manifest, reader = read_waveform(written(tmp_path, np.full((6, 6), 50.0 + 0j))[0])
    with pytest.raises(KeyboardInterrupt):
        play_audio(manifest, reader, device=None, outputs=range(36))
    assert len(fake.kept) == 4
    assert np.abs(fake.kept[2][-1]).max() > 0
    np.testing.assert_allclose(fake.kept[3][0], fake.kept[2][-1], rtol=0.01)
    assert not fake.kept[3][-1].any()


def test_audio_that_is_not_there_is_one_line(tmp_path: Path, card: FakeCard, monkeypatch: pytest.MonkeyPatch) -> None:
    manifest, reader = read_waveform(written(tmp_path, np.zeros((6, 6), dtype=complex))[0])
    with pytest.raises(AudioError, match="querying device -1; `python -m sounddevice`"):
        play_audio(manifest, reader, device="none", outputs=range(36))

    def no_port_audio(name: str) -> None:
        raise OSError("PortAudio library not found")

    monkeypatch.setattr("drivers.sinks.audio.import_module", no_port_audio)
    with pytest.raises(AudioUnavailable, match="apt install libportaudio2"):
        play_audio(manifest, reader, device=None, outputs=range(36))
    monkeypatch.setitem(sys.modules, "sounddevice", None)
    monkeypatch.undo()


@pytest.mark.parametrize("text", ["0", "x:1", "36:0", "0:1", "0:-1", "1:0,0:0"])
def test_a_wrong_mapping_is_refused(text: str) -> None:
    with pytest.raises(AudioError, match="channel mapping"):
        parse_outputs(text, 36)
