"""Numbers of pages: in the corner, in a cell, in frames of their own; and known to who reads the text back."""

import json
from pathlib import Path

import pytest
import yaml

import dotwave as dw
from encoders import (
    FeltPage,
    Frame,
    GridShape,
    LayoutError,
    PageNumber,
    PageNumbering,
    TextOptions,
    back_check,
    cells_to_brf,
    encode_text,
    join_pages,
)  # fmt: skip

SMALL, WIDE = GridShape(6, 6), GridShape(40, 96)
PROSE = (Path(__file__).parents[2] / "samples" / "texts" / "en.txt").read_text()


def frames_of(text: str, shape: GridShape, **options) -> list[Frame]:
    scene = encode_text(text, shape, TextOptions(**options))
    check = scene.text_frames.check()
    assert check.cells_equal
    assert check.alone == ()
    assert scene.encoding["page_numbers"] == options["page_numbers"]
    return list(scene.frames)


def brf(frame: Frame) -> list[str]:
    return [cells_to_brf(line).decode() for line in frame.cells.split("\n")]


def test_a_number_stands_in_the_last_line_beside_the_text():
    frames = frames_of(" ".join([PROSE] * 36), WIDE, page_numbers="corner")
    assert len(frames) > 10
    for number, frame in enumerate(frames, 1):
        sign = "#" + "".join("JABCDEFGHI"[int(digit)] for digit in str(number))
        last = brf(frame)[-1]
        assert last.endswith("  " + sign)
        assert frame.number == PageNumber(13 * 48 - len(sign), frame.cells[-len(sign) :])
    assert sum(bool(brf(frame)[-1][:-5].strip()) for frame in frames) >= len(frames) - 1


def test_on_a_small_page_its_last_cell_is_the_last_digit():
    frames = frames_of(PROSE[:200], SMALL, page_numbers="corner")
    assert len(frames) > 11
    assert "".join(brf(frame)[-1][-1] for frame in frames[:11]) == "ABCDEFGHIJA"
    assert {frame.number and frame.number.at for frame in frames} == {5}


def test_a_frame_of_its_own_says_the_page_and_how_many_there_are():
    frames = frames_of("Hello world", SMALL, page_numbers="frame")
    assert [(frame.page, frame.text, "".join(brf(frame)).rstrip()) for frame in frames] == [
        (0, "", "#A_/#B"), (1, "Hello", ",HELLO"), (2, "", "#B_/#B"), (3, "world", "_W"),
    ]  # fmt: skip
    # A word that goes on does so past the number.
    frames = frames_of("Donaudampfschiff", SMALL, page_numbers="frame", table="de-g2.ctb")
    assert any(frame.goes_on for frame in frames)
    many = frames_of(PROSE, SMALL, page_numbers="frame")
    assert "".join(brf(many[-3])).rstrip() == "#" + "".join("JABCDEFGHI"[int(c)] for c in str(many_pages(many)))
    assert "".join(brf(many[-2])).startswith("_/#")


def many_pages(frames: list[Frame]) -> int:
    return sum(bool(frame.text) for frame in frames)


def test_without_what_frames_say_the_number_is_text():
    scene = encode_text("Hello world", SMALL, TextOptions(page_numbers=PageNumbering.CORNER))
    frames = list(scene.frames)
    cells, notes = [frame.cells for frame in frames], [frame.goes_on for frame in frames]
    assert join_pages(cells, scene.encoding, notes, [frame.number for frame in frames]) == "⠠⠓⠑⠇⠇⠕⠀⠸⠺"
    assert join_pages(cells, scene.encoding, notes) != "⠠⠓⠑⠇⠇⠕⠀⠸⠺"
    # A number that is not felt as it should be is a difference.
    felt = [FeltPage(frame.cells, frame.text, frame.goes_on, (), frame.number) for frame in frames]
    wrong = [felt[0]._replace(cells=felt[0].cells[:-1] + "⠿"), *felt[1:]]
    assert back_check(felt, "Hello world", scene.encoding).cells_equal
    assert not back_check(wrong, "Hello world", scene.encoding).cells_equal


def test_pages_that_are_chosen_are_those_that_are_numbered():
    whole = frames_of(PROSE, SMALL, page_numbers="corner")
    part = frames_of(PROSE, SMALL, page_numbers="corner", pages="11-12")
    assert [frame.text.strip() for frame in part] == [frame.text.strip() for frame in whole[10:12]]


def test_a_page_of_one_cell_has_no_room():
    with pytest.raises(LayoutError, match="page-numbers: a page of one cell has no room"):
        encode_text("a", GridShape(3, 2), TextOptions(page_numbers=PageNumbering.CORNER))
    with pytest.raises(LayoutError, match="page_numbers: expected one of none, corner, frame, got 'top'"):
        TextOptions(page_numbers="top")  # type: ignore[arg-type]


@pytest.mark.parametrize("where", ["corner", "frame"])
def test_verify_reads_a_numbered_file(dotwave, tmp_path: Path, where):
    out = tmp_path / "a.wav"
    made = dotwave("text", "Hello there, UNESCO", "-o", out, "--page-numbers", where, "--json")
    assert made.code == 0
    marks = json.loads((tmp_path / "a.json").read_text())["frames"]
    assert all(set(mark["number"]) == {"at", "cells"} for mark in marks if "number" in mark)
    assert sum("number" in mark for mark in marks) == (len(marks) if where == "corner" else len(marks) // 2)
    read = dotwave("verify", out, "--json")
    assert read.code == 0
    report = json.loads(read.out)
    assert report["cells_equal"]
    assert report["differences"] == []


def test_jobs_and_python_take_the_same_words(tmp_path: Path):
    part = {"say": "Hello world", "page_numbers": "corner", "lines": "join"}
    job = {"schema": "dotwave/job/1", "device": "paper-6x6", "sequence": [{"text": part}]}
    (tmp_path / "a.yaml").write_text(yaml.safe_dump(job))
    said = [frame.cells for frame in dw.job(tmp_path / "a.yaml").frames]
    assert said == [frame.cells for frame in dw.text("Hello world", page_numbers="corner", lines="join").frames]
    assert [cells[-1] for cells in said] == list("⠁⠃⠉")[: len(said)]
