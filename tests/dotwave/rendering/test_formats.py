"""One way from every scene to every format: texts, pictures and jobs, samples and haptic files."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from drivers import FORMATS, PACK_SUFFIX, SUFFIXES, read_exchange, read_waveform
from encoders.braille import text as encoder
from planner import plan_scene

HEART = Path(__file__).resolve().parents[3] / "samples" / "icons" / "heart.svg"


@pytest.fixture
def calls(tmp_path: Path) -> dict[str, Callable[[Path], list[Any]]]:
    """Arguments by what is shown, for a file to write."""
    job = tmp_path / "job.yaml"

    def with_output(out: Path) -> list[Any]:
        job.write_text(f"device: linked-6x6\noutput: {out.name}\nsequence: [{{text: Hi}}, {{pause_s: 1}}]\n", "utf-8")
        return ["render", job]

    return {
        "text": lambda out: ["text", "Hi", "-d", "linked-6x6", "-o", out],
        "image": lambda out: ["image", HEART, "-d", "linked-6x6", "-o", out],
        "job": with_output,
        "job -o": lambda out: [*with_output(Path("other.wav")), "-o", out],
    }


@pytest.mark.parametrize("suffix", FORMATS)
@pytest.mark.parametrize("shown", ["text", "image", "job", "job -o"])
def test_whatever_is_shown_is_written_in_every_format(dotwave, calls, tmp_path: Path, shown: str, suffix: str) -> None:
    out = tmp_path / f"out{suffix}"
    ended = dotwave(*calls[shown](out), "--json")
    assert (ended.code, ended.err) == (0, "")
    report = json.loads(ended.out)
    if suffix in SUFFIXES:
        manifest, reader = read_waveform(out)
        assert report["files"] == [str(out), str(out.with_suffix(".json"))]
        assert reader.samples / reader.rate_hz == pytest.approx(report["duration_s"], abs=1e-3)
        manifest.check_digest(out)
    elif suffix == PACK_SUFFIX:
        assert report["files"] == [str(out)]
        assert read_waveform(out)[0].duration_s == pytest.approx(report["duration_s"], abs=1e-3)
    else:
        assert report["files"] == [str(out)]
        assert read_exchange(out).time_s[-1] == pytest.approx(report["duration_s"], abs=1e-3)


@pytest.mark.parametrize("shown", ["text", "image", "job", "job -o"])
def test_other_endings_are_refused_with_all_that_are_accepted(dotwave, calls, tmp_path: Path, shown: str) -> None:
    ended = dotwave(*calls[shown](tmp_path / "out.mp3"))
    assert (ended.code, ended.out, ended.err.count("\n")) == (2, "", 1)
    assert f"out.mp3: expected a name that ends in {', '.join(FORMATS)}" in ended.err


@pytest.mark.parametrize("out", [None, "x.wav", "x.hjif"])
def test_a_text_is_encoded_once(dotwave, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, out: str | None) -> None:
    times = []
    plain = encoder.TextFrames._encoded

    def counted(self: encoder.TextFrames) -> Any:
        times.append(self)
        return plain(self)

    monkeypatch.setattr(encoder.TextFrames, "_encoded", counted)
    written = [] if out is None else ["-o", tmp_path / out]
    ended = dotwave("text", "Hello there, it rains", "-d", "linked-6x6", *written)
    assert ended.code == 0
    assert len(times) == 1


def test_frames_of_a_long_text_are_not_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    from encoders import GridShape, TextOptions, encode_text

    monkeypatch.setattr(encoder, "MOST_KEPT", 2 * 36)
    long, short = (
        encode_text(words, GridShape(6, 6), TextOptions()) for words in ("Hello there, it rains and pours", "Hello")
    )
    for scene, kept in ((long, False), (short, True)):
        first, again = list(scene.frames), list(scene.frames)
        assert [frame.cells for frame in first] == [frame.cells for frame in again]
        assert (first[0] is again[0]) == kept


@pytest.mark.parametrize("command", ["text", "image"])
def test_without_a_tolerance_no_frame_is_held_to_one(dotwave, monkeypatch: pytest.MonkeyPatch, command: str) -> None:
    from dataclasses import replace

    from dotwave.rendering import render as module

    def off(*given: Any, **named: Any) -> Any:
        plan = plan_scene(*given, **named)
        frames = [replace(one, states=tuple(replace(state, error=0.05) for state in one.states)) for one in plan.frames]
        return replace(plan, frames=frames)

    monkeypatch.setattr(module, "plan_scene", off)
    source = {"text": "a", "image": HEART}[command]
    ended = dotwave(command, source)
    assert ended.code == 0
    assert "5.00 % of full scale." in ended.out
    assert dotwave(command, source, "--tol", "normal").code == 1
