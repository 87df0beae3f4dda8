"""Textures that travel, and text that scrolls, as a job and the command line have them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import dotwave as dw
from chainsim import ProfileError
from dotwave.errors import AppError
from dotwave.jobs.job import read_job
from dotwave.jobs.scene import read_job_scene
from dotwave.rendering import presenting
from dotwave.request import Request
from encoders import EncodeError, Frame, TextureError


def job(tmp_path: Path, texture: str) -> Path:
    path = tmp_path / "job.yaml"
    path.write_text(f"sequence:\n  - texture: {texture}\n", encoding="utf-8")
    return path


def raised(frame: Frame) -> list[tuple[int, int]]:
    return [(int(row), int(col)) for row, col in np.argwhere(np.abs(frame.pattern.amplitude) > 0.5)]


def test_a_text_of_a_texture_is_that_of_the_presentation(tmp_path: Path) -> None:
    scene = read_job_scene(job(tmp_path, "{scroll: {text: Hi, columns_per_s: 4.5}}"))
    shown = list(dw.text("Hi", presentation="scroll", rate=1.5).frames)
    assert len(list(scene.frames)) == len(shown)
    for one, other in zip(scene.frames, shown, strict=True):
        assert raised(one) == raised(other)
        assert one.dwell_s == pytest.approx(other.dwell_s)
        assert (one.travels, one.leads) == (other.travels, other.leads)
    assert scene.encoding["presentation"] == "scroll"


@pytest.mark.parametrize(
    ("dot", "places"),
    [
        ("arrow: up", [(5, 2), (4, 2), (3, 2), (2, 2)]),
        ("path: [[0, 0], [2, 2]]", [(0, 0), (1, 1), (2, 2), None]),
        ("path: [[0, 0], [0, 1], [1, 1]], closed: true", [(0, 0), (0, 1), (1, 1), (0, 0)]),
        ("circle: {radius: 0.5}", [(2, 3), (3, 3), (3, 2), (2, 2)]),
    ],
)
def test_a_dot_goes_where_it_is_sent(tmp_path: Path, dot: str, places: list[tuple[int, int] | None]) -> None:
    frames = list(read_job_scene(job(tmp_path, f"{{dot: {{{dot}, actuators_per_s: 3}}, dwell_s: 1}}")).frames)
    assert [raised(frame) for frame in frames] == [[] if place is None else [place] for place in places]


@pytest.mark.parametrize(
    ("texture", "said"),
    [
        ("{scroll: {columns_per_s: 3}}", "texture.scroll: give either text or bars"),
        ("{scroll: {text: a, bars: {width: 1, gap: 1}, columns_per_s: 3}}", "give either text or bars"),
        ("{scroll: {text: a}}", "texture.scroll.columns_per_s: this key is required"),
        ("{scroll: {text: a, columns_per_s: 1000}}", "columns_per_s: expected"),
        ("{dot: {actuators_per_s: 3}}", "texture.dot: give exactly one of circle, path, arrow"),
        ("{dot: {arrow: north, actuators_per_s: 3}}", "texture.dot.arrow: expected"),
        ("{dot: {arrow: up, closed: true, actuators_per_s: 3}}", "closed is for a path"),
        ("{dot: {path: [[0, 0]], actuators_per_s: 3}}", "texture.dot.path: "),
    ],
)
def test_what_is_wrong_is_said_with_its_place(tmp_path: Path, texture: str, said: str) -> None:
    with pytest.raises(ProfileError) as found:
        read_job(job(tmp_path, texture))
    assert said in str(found.value)
    assert "job.yaml:2" in str(found.value)


def test_what_does_not_fit_the_grid_is_said_with_its_place(tmp_path: Path) -> None:
    with pytest.raises(AppError, match=r"job.yaml:2: sequence.0.texture: circle: expected a radius from 0.5 to 2.5"):
        read_job_scene(job(tmp_path, "{dot: {circle: {radius: 4}, actuators_per_s: 3}}"))
    with pytest.raises(TextureError):
        dw.texture({"dot": {"path": [[0, 0], [9, 9]], "actuators_per_s": 3}})
    with pytest.raises(EncodeError):
        dw.texture({"scroll": {"text": " ", "columns_per_s": 3}})


def test_tables_of_other_people_are_refused(tmp_path: Path) -> None:
    (tmp_path / "own.ctb").write_text("include /etc/passwd\n", encoding="utf-8")
    path = job(tmp_path, f"{{scroll: {{text: a, columns_per_s: 3, table: {tmp_path / 'own.ctb'}}}}}")
    with pytest.raises(AppError, match="not one of liblouis's own tables"):
        read_job_scene(path, root=tmp_path)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--device", "ultrasonic-6x6"), "the nearest are bars that walk"),
        (("--device", "linked-6x6", "--rate", "1.3"), "let at most 3.63 pass in a second"),
        (("--dwell", "1"), "a text that scrolls does not stand"),
        (("--page-numbers", "corner"), "a text that scrolls has no pages"),
    ],
)
def test_refusals_are_one_line(dotwave: Callable[..., Any], options: tuple[str, ...], said: str) -> None:
    ended = dotwave("text", "Hi", "--presentation", "scroll", *options)
    assert ended.code == 2
    assert said in ended.err
    assert ended.err.count("\n") == 1


def test_explain_says_how_fast_it_is_and_could_be(dotwave: Callable[..., Any]) -> None:
    ended = dotwave("text", "Hi", "--presentation", "scroll", "--explain")
    assert ended.code == 0
    assert "Patterns travel, 3 a second; paper-6x6 can 16.6." in ended.out


def test_a_yield_does_not_make_a_text_scroll(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of open presentations only those are tried that show pages, though none reaches what is asked."""
    tried = []

    def few(scene: Any, *_: Any, **__: Any) -> float:
        tried.append(scene.encoding["presentation"])
        return 0.1

    monkeypatch.setattr(presenting, "kept_share", few)
    presenting.presented(dw.text("Hi", "linked-6x6"), dw.device("linked-6x6"), Request(yield_=1.0))
    assert tried == ["together", "by-row", "by-dot"]
