"""Before much is written, how much is said, held against the disk, and asked about where a person is there."""

from __future__ import annotations

import io
import shutil
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from chainsim import load_device
from dotwave.rendering import extent
from dotwave.rendering.extent import extent_of
from dotwave.rendering.render import render
from dotwave.request import Request
from drivers import Encoding
from encoders import Frame, GridShape, Presentation, TargetPattern, TextOptions, encode_text

ROOT = Path(__file__).resolve().parents[3]
TEXT = "Hello world, it rains and it pours"


@pytest.mark.parametrize("device", ["paper-6x6", "linked-6x6"])
@pytest.mark.parametrize("name", ["x.wav", "x.npz", "x.raw", "x.csv", "pcm24.wav", "rows.wav"])
def test_the_size_that_is_said_is_that_of_the_file(tmp_path: Path, device: str, name: str) -> None:
    out = tmp_path / name
    encoding: Encoding = "pcm24" if name.startswith("pcm24") else "float32"
    options = TextOptions(presentation=Presentation.BY_ROW if name.startswith("rows") else Presentation.TOGETHER)
    profile = load_device(device)
    scene = encode_text(TEXT, GridShape(profile.rows, profile.cols), options)
    said = extent_of(scene.frames, profile, out, encoding)
    report = render(scene, profile, out, Request(encoding=encoding))
    size = out.stat().st_size
    assert said.seconds == pytest.approx(report.duration_s, rel=0.1)
    if name == "x.csv":
        assert said.least < size < 1.2 * said.most
    else:
        assert said.least == said.most == pytest.approx(size, rel=0.1)


def test_frames_are_drawn_once_and_none_is_kept() -> None:
    alive: list[int] = [0, 0]

    class One(Frame):
        def __init__(self) -> None:
            super().__init__(TargetPattern(np.zeros((6, 6), dtype=np.complex128)), dwell_s=1.0)
            alive[0] += 1
            alive[1] = max(alive)

        def __del__(self) -> None:
            alive[0] -= 1

    said = extent_of((One() for _ in range(100)), load_device("paper-6x6"), Path("x.wav"), "float32")
    assert alive[1] <= 2
    assert said.seconds == pytest.approx(100.3)


class Terminal(io.StringIO):
    """Text that calls itself a terminal."""

    def isatty(self) -> bool:
        return True


@pytest.fixture
def person(monkeypatch: pytest.MonkeyPatch) -> Callable[[str], Terminal]:
    """A person at a terminal, who types."""

    def at_terminal(answer: str) -> Terminal:
        shown = Terminal()
        monkeypatch.setattr(sys, "stdin", Terminal(answer))
        monkeypatch.setattr(sys, "stderr", shown)
        return shown

    return at_terminal


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """Limits so low that a word is a lot; gives a folder to write to."""
    monkeypatch.setattr(extent, "SAID_BYTES", 1000)
    monkeypatch.setattr(extent, "ASKED_BYTES", 1_000_000)
    (tmp_path / "job.yaml").write_text("output: out/x.wav\nsequence: [{text: Hello there}]", encoding="utf-8")
    return tmp_path


def calls(folder: Path) -> dict[str, list[Any]]:
    heart = ROOT / "samples" / "icons" / "heart.svg"
    return {
        "text": ["text", "Hello there", "-o", folder / "out/x.wav"],
        "render": ["render", folder / "job.yaml"],
        "image": ["image", heart, "-o", folder / "out/x.wav"],
        "icons": ["icons", heart, "-o", folder / "out", "--waveforms", "--workers", 1],
    }


@pytest.mark.parametrize("name", ["text", "render", "image", "icons"])
def test_a_lot_is_said_and_written_without_a_question_where_nobody_is_there(small: Path, dotwave, name: str) -> None:
    ended = dotwave(*calls(small)[name])
    assert ended.code == 0
    assert ended.err.count("\n") == 1
    assert " of 42 channels at 8000 samples a second, to " in ended.err
    assert ended.err.startswith("dotwave: writing about ")
    assert list((small / "out").iterdir())


@pytest.mark.parametrize("name", ["text", "render", "image", "icons"])
@pytest.mark.parametrize("answer", ["n\n", "\n", "", "what?\n"])
def test_no_is_1_and_nothing_written(small: Path, dotwave, person, name: str, answer: str) -> None:
    shown = person(answer)
    ended = dotwave(*calls(small)[name])
    assert (ended.code, ended.out) == (1, "")
    assert shown.getvalue().endswith("Go on? [y/N] Nothing was written.\n")
    assert not (small / "out").exists()


@pytest.mark.parametrize(("answer", "options"), [("y\n", []), ("Yes\n", []), ("", ["--yes"]), ("", ["-y"])])
def test_yes_goes_on(small: Path, dotwave, person, answer: str, options: list[str]) -> None:
    shown = person(answer)
    assert dotwave(*calls(small)["text"], *options).code == 0
    assert ("Go on?" in shown.getvalue()) == (not options)
    assert (small / "out" / "x.wav").is_file()


def test_little_is_not_worth_a_word_or_a_question(tmp_path: Path, dotwave, person) -> None:
    shown = person("")
    assert dotwave(*calls(tmp_path)["text"]).code == 0
    assert shown.getvalue() == ""


@pytest.mark.parametrize("name", ["text", "render", "image", "icons"])
def test_what_does_not_fit_on_the_disk_is_not_begun(
    small: Path, dotwave, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    usage = type("Usage", (), {"free": 12_000})
    monkeypatch.setattr(shutil, "disk_usage", lambda _: usage)
    ended = dotwave(*calls(small)[name])
    assert (ended.code, ended.out, ended.err.count("\n")) == (2, "", 1)
    assert f"in {small}, where 12 kB are free; free some space" in ended.err
    assert not (small / "out").exists()


def test_what_waits_in_the_temporary_folder_counts(tmp_path: Path, dotwave, monkeypatch: pytest.MonkeyPatch) -> None:
    said = extent_of(
        encode_text("Hello", GridShape(6, 6), TextOptions()).frames, load_device("paper-6x6"), Path("x.npz"), "float32"
    )
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setattr(tempfile, "tempdir", None)
    for free, code in ((1.5 * said.most, 2), (2.5 * said.most, 0)):
        usage = type("Usage", (), {"free": free})
        monkeypatch.setattr(shutil, "disk_usage", lambda _, usage=usage: usage)
        assert dotwave("text", "Hello", "-o", tmp_path / "x.npz").code == code
