"""`dotwave play`, `emulate` and `ports` as functions: dry runs, reports, and the two talking to each other."""

from __future__ import annotations

import io
import json
import sys
import threading
import time
from itertools import count
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from chainsim import load_device
from dotwave.errors import AppError
from dotwave.playing.emulate import EmulateReport, dots_as_braille, emulate, parse_window
from dotwave.playing.play import list_ports, play
from drivers import (
    BoardEmulator,
    BoardRefusal,
    Faults,
    FaultWindow,
    Firmware,
    StreamReport,
    read_waveform,
    write_waveform,
)
from drivers.protocol.pty_line import PtyLine
from drivers.sinks.controller import buffer_notes
from encoders import GridShape, TextOptions, TextSource, encode_text
from planner import plan_scene

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="needs a pseudo-terminal")


def written(folder: Path, device: str, text: str = "Hi") -> Path:
    path = folder / "sent.wav"
    scene = encode_text(TextSource.of_text(text), GridShape(6, 6), TextOptions(dwell_s=0.5))
    write_waveform(plan_scene(scene, load_device(device)), path)
    return path


def test_without_live_nothing_is_opened(tmp_path: Path) -> None:
    path = written(tmp_path, "paper-6x6")
    report = play(path, live=False, port=str(tmp_path / "no such port"))
    assert not report.live
    assert "stream" not in report.as_dict()
    assert "dry run, nothing was sent" in report.as_text()
    plain = json.loads(json.dumps(report.as_dict(), allow_nan=False))
    assert plain["gate"]["volts"] == pytest.approx(73.26, abs=0.1)
    assert (plain["live"], plain["ok"], plain["sink"]) == (False, True, "controller")


def test_live_needs_one_sink(tmp_path: Path) -> None:
    path = written(tmp_path, "paper-6x6")
    with pytest.raises(AppError, match="give one of --port, --audio"):
        play(path, live=True)
    with pytest.raises(AppError, match="not both"):
        play(path, live=True, port="x", audio="0")
    with pytest.raises(AppError, match="not both"):
        play(path, live=True, to="controller:x", port="x")
    with pytest.raises(AppError, match="give one of"):
        play(path, live=True, board=True)


@pytest.mark.parametrize("device", ["paper-6x6", "independent-6x6"])
def test_two_terminals(tmp_path: Path, device: str) -> None:
    path, link, arrived = written(tmp_path, device), tmp_path / "port", tmp_path / "arrived.wav"
    found: list[EmulateReport] = []
    out = io.StringIO()
    # Room for all of it, and patience: what a busy machine does to either side is not what this is about.
    options: dict[str, Any] = {"buffer_s": 10.0, "watchdog_s": 30.0, "faults": Faults(drop=0.02, corrupt=0.02)}

    def other() -> None:
        found.append(emulate(device=device, link=link, record=arrived, once=True, seconds=600, out=out, **options))

    thread = threading.Thread(target=other)
    thread.start()
    try:
        while not link.exists() and thread.is_alive():
            time.sleep(0.01)
        report = play(path, live=True, port=str(link), patience_s=100.0)
    finally:
        thread.join()
    (there,) = found
    assert report.ok
    assert report.as_dict()["stream"]["samples"] == round(report.duration_s * report.rate_hz)
    assert "underruns" in report.as_text()
    assert json.loads(json.dumps(report.as_dict(), allow_nan=False))["stream"]["lost_s"] == 0
    assert there.status.recorded == 1
    assert arrived.exists()
    assert there.status.played_s == pytest.approx(report.duration_s)
    assert f"--port {link}" in out.getvalue()
    assert json.loads(json.dumps(there.as_dict(), allow_nan=False))["state"] == "done"


def test_a_small_buffer_is_told() -> None:
    assert buffer_notes(StreamReport(buffer_s=2.0)) == ()
    (note,) = buffer_notes(StreamReport(buffer_s=0.5))
    assert "holds 0.50 s" in note
    assert "2 s are needed" in note
    (note,) = buffer_notes(StreamReport(buffer_s=2.0, underruns=3, longest_pause_s=1.25))
    assert "ran dry: it holds 2.00 s, and for up to 1.25 s nothing could be sent" in note


def test_the_board_is_planned_and_refused(tmp_path: Path) -> None:
    path = written(tmp_path, "independent-6x6")
    report = play(path, live=False, board=True)
    assert "loading" in report.as_text()
    records = report.as_dict()["board"]["frames"][0]["records"]
    assert {len(record["bytes"][0]) for record in records} == {4}
    with pytest.raises(BoardRefusal, match="shows no grid"):
        play(path, live=True, board=True, port="x", firmware=Firmware.TEST_PIXEL)
    with pytest.raises(BoardRefusal, match="plan for independent-6x6"):
        play(written(tmp_path, "paper-6x6"), live=False, board=True)


def test_the_board_is_played_over_its_line(tmp_path: Path) -> None:
    path = written(tmp_path, "independent-6x6", "Hello you")
    line = PtyLine()
    board = BoardEmulator(Firmware.CORRECTED, now=time.monotonic(), boot_s=0.0)
    over, shown = threading.Event(), [board.dots.copy()]

    def live() -> None:
        while not over.is_set():
            for byte in line.exchange(board.outgoing(), 0.002):
                board.receive(bytes([byte]), time.monotonic())
                if (board.dots != shown[-1]).any():
                    shown.append(board.dots.copy())

    thread = threading.Thread(target=live)
    thread.start()
    try:
        report = play(path, live=True, board=True, port=line.name, firmware=Firmware.CORRECTED)
        while shown[-1].any():
            assert thread.is_alive()
            time.sleep(0.01)
    finally:
        over.set()
        thread.join()
        line.close()
    manifest, _ = read_waveform(path)
    wanted = [mark.target >= 0.5 for mark in manifest.frames]
    assert report.sink == "drv2667"
    np.testing.assert_array_equal(shown[1 : 1 + len(wanted)], wanted)
    assert not shown[-1].any()


def test_dots_are_drawn_as_braille() -> None:
    levels = np.zeros((6, 6))
    levels[0, 0] = levels[1, 0] = levels[0, 3] = levels[5, 5] = 1.0
    assert dots_as_braille(levels) == ["⠃⠈⠀", "⠀⠀⠠"]
    assert dots_as_braille(np.ones((4, 3))) == ["⠿⠇", "⠉⠁"]


class Terminal(io.StringIO):
    """A terminal that keeps what was drawn on it."""

    def isatty(self) -> bool:
        return True


def test_the_emulator_draws_over_itself(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    out, looks = Terminal(), count()
    monkeypatch.setattr("dotwave.playing.emulate.time", SimpleNamespace(monotonic=lambda: 0.01 * next(looks)))
    emulate(device="independent-6x6", link=tmp_path / "port", seconds=0.5, out=out)
    frames = out.getvalue().split("\x1b[8A")
    assert len(frames) > 2
    assert all("idle" in frame and "in store" in frame and "underruns 0" in frame for frame in frames)
    assert all(frame.count("\u2800" * 3) == 2 for frame in frames)


def test_windows_are_two_numbers() -> None:
    assert parse_window("3,2", "stall") == FaultWindow(3.0, 2.0)
    assert parse_window(None, "stall") is None
    for text in ("3", "a,b", "1,2,3", "-1,2", "1,inf", "nan,1"):
        with pytest.raises(AppError, match="--stall"):
            parse_window(text, "stall")
    with pytest.raises(AppError, match="--watchdog"):
        emulate(device="paper-6x6", watchdog_s=0.0)


def test_ports_are_listed() -> None:
    report = list_ports()
    assert report.as_text()
    assert isinstance(report.as_dict()["ports"], list)
