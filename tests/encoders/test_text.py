"""The whole way from text to frames and back, in ten languages and with hostile input."""

import itertools
import tracemalloc
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from hypothesis import given, settings, strategies as st

from encoders import (
    EmptyText,
    GridShape,
    LayoutError,
    Presentation,
    TableMissing,
    TextOptions,
    TextSource,
    Undefined,
    UndefinedCharacter,
    back_check,
    covered_text,
    encode_text,
)

TEXTS = Path(__file__).parents[2] / "samples" / "texts"
LANGUAGES = yaml.safe_load((TEXTS / "languages.yaml").read_text())
GRID = GridShape(6, 6)

# What the back-translation of liblouis 3.24 can be held to with each table. German (contracted) is declared
# for one direction only, Hindi comes back with full vowels for vowel signs: there the cells are compared
# with those of the text. Chinese comes back in other characters of the same sound.
TEXT_COMES_BACK = {"en.txt", "fr.txt", "el.txt", "ru.txt", "ar.txt", "pt.txt", "pl.txt"}
SAME_CELLS_AGAIN = {"zh.txt"}


def frames_of(text, shape=GRID, **options):
    return list(encode_text(text, shape, TextOptions(**options)).frames)


def shown_text(frames):
    return covered_text((frame.span, frame.text) for frame in frames)


@pytest.mark.parametrize("name", sorted(LANGUAGES))
def test_ten_languages_come_back(name):
    text = (TEXTS / name).read_text()
    scene = encode_text(TextSource.of_path(TEXTS / name), GRID, TextOptions(table=LANGUAGES[name]["table"]))
    check = scene.text_frames.check()
    assert check.ok
    assert check.cells_equal
    assert check.text_equal == (name in TEXT_COMES_BACK), check.differences
    assert check.again_equal == (name in TEXT_COMES_BACK | SAME_CELLS_AGAIN)
    assert scene.text_frames.report.undefined == ()
    assert shown_text(scene.frames) == " ".join(text.split())


def test_there_are_ten_languages_and_every_sample_is_listed():
    assert len(LANGUAGES) == 10
    assert {path.name for path in TEXTS.glob("*.txt")} == {*LANGUAGES, "paragraph.txt"}


def test_hello_world():
    frames = frames_of("Hello world")
    assert [(frame.cells, frame.text, frame.span) for frame in frames] == [
        ("⠠⠓⠑\n⠇⠇⠕", "Hello", (0, 5)),
        ("⠸⠺⠀\n⠀⠀⠀", "world", (6, 11)),
    ]
    assert frames[0].pattern.amplitude.real.astype(int).tolist() == [
        [0, 0, 1, 0, 1, 0],
        [0, 0, 1, 1, 0, 1],
        [0, 1, 0, 0, 0, 0],
        [1, 0, 1, 0, 1, 0],
        [1, 0, 1, 0, 0, 1],
        [1, 0, 1, 0, 1, 0],
    ]
    assert [frame.dwell_s for frame in frames] == [1.0, 1.0]


def test_frames_are_made_again_and_the_same():
    scene = encode_text("Hello world", GRID, TextOptions())
    first = [(frame.cells, frame.span) for frame in scene.frames]
    assert [(frame.cells, frame.span) for frame in scene.frames] == first
    assert scene.text_frames.report.pages == 2


def test_a_long_word_is_hyphenated_and_reported():
    scene = encode_text("knowledgeable", GRID, TextOptions())
    frames = list(scene.frames)
    assert [frame.text for frame in frames] == ["knowl", "edgeable"]
    assert frames[0].cells.replace("\n", "").rstrip("⠀").endswith("⠤")
    (split,) = scene.text_frames.report.splits
    assert (split.word, split.span, split.page, split.hyphenated) == ("knowledgeable", (0, 13), 0, True)
    assert scene.text_frames.check().text_equal


@pytest.mark.parametrize("options", [{}, {"blank_between": True}, {"page_numbers": "frame"}])
def test_a_split_is_reported_with_the_page_its_first_part_is_on(options):
    scene = encode_text("Hi\n\nknowledgeable", GRID, TextOptions(**options))
    pages = [frame.page for frame in scene.frames if frame.text.startswith("knowl")]
    (split,) = scene.text_frames.report.splits
    assert split.page == pages[0]


def test_without_a_dictionary_a_long_word_is_split_and_reported():
    scene = encode_text("οικογένεια", GRID, TextOptions(table="el.ctb"))
    assert scene.encoding["hyphen"] == ""
    assert scene.text_frames.check().text_equal
    assert [split.hyphenated for split in scene.text_frames.report.splits] == [False]


def test_paragraphs_begin_pages_and_may_be_parted_by_a_blank_frame():
    text = "but\n\ncan\fdo"
    assert [frame.text for frame in frames_of(text)] == ["but\n\n", "can\f", "do"]
    frames = frames_of(text, blank_between=True)
    assert [frame.text for frame in frames] == ["but\n\n", "", "can\f", "", "do"]
    assert [frame.page for frame in frames] == [0, 1, 2, 3, 4]
    assert not frames[1].pattern.amplitude.any()
    assert encode_text(text, GRID, TextOptions(blank_between=True)).text_frames.check().text_equal


@pytest.mark.parametrize("presentation", [Presentation.BY_ROW, Presentation.BY_DOT])
def test_parts_share_a_page_and_superpose_to_it(presentation):
    scene = encode_text("Hello world", GRID, TextOptions(presentation=presentation))
    together = frames_of("Hello world")
    for page, frames in itertools.groupby(scene.frames, key=lambda frame: frame.page):
        parts = list(frames)
        assert len(parts) > 1
        assert (sum(part.pattern.amplitude for part in parts) == together[page].pattern.amplitude).all()
        assert {part.cells for part in parts} == {together[page].cells}
        assert {part.dwell_s for part in parts} == {0.6}
    assert scene.text_frames.check().text_equal


def test_dwell_and_rate():
    assert frames_of("zebras", rate=3.0, table="en-ueb-g1.ctb")[0].dwell_s == pytest.approx(2.0)
    # A page with little on it is over sooner, but not in a flash.
    assert frames_of("a", rate=3.0)[0].dwell_s == 1.0
    assert frames_of("a", rate=12.0)[0].dwell_s == 0.5
    assert frames_of("a", rate=3.0, dwell_s=1.5)[0].dwell_s == 1.5
    parts = frames_of("Hello", dwell_s=12.0, presentation=Presentation.BY_ROW)
    assert sum(part.dwell_s for part in parts) == pytest.approx(12.0)
    assert frames_of("hello you", shape=GridShape(6, 12), table="en-ueb-g1.ctb")[0].dwell_s == pytest.approx(1.5)


@pytest.mark.parametrize("bad", [0.0, -1.0, float("nan"), float("inf")])
def test_times_are_checked(bad):
    with pytest.raises(LayoutError, match="rate: expected a number > 0"):
        frames_of("a", rate=bad)
    with pytest.raises(LayoutError, match="dwell: expected a number > 0"):
        frames_of("a", dwell_s=bad)


def test_gaps_and_larger_grids_show_fewer_and_more_cells():
    assert all(len(frame.cells) == 2 for frame in frames_of("Hello world", cell_gap=2, line_gap=1))
    (frame,) = frames_of("Hello world", shape=GridShape(40, 96))
    assert frame.cells.startswith("⠀⠀⠠⠓⠑⠇⠇⠕⠀⠸⠺⠀")


def test_arrays_are_complex_and_read_only():
    for frame in frames_of("Hello world\n\nagain", blank_between=True):
        assert frame.pattern.amplitude.dtype == np.complex128
        with pytest.raises(ValueError, match="read-only"):
            frame.pattern.amplitude[0, 0] = 1


def test_braille_and_brf_pass_through():
    scene = encode_text("⠠⠓⠑⠇⠇⠕ ⠸⠺\n", GRID, TextOptions())
    assert [frame.cells for frame in scene.frames] == ["⠠⠓⠑\n⠇⠇⠕", "⠀⠸⠺\n⠀⠀⠀"]
    assert scene.encoding["kind"] == "braille"
    assert scene.text_frames.check().ok
    brf = TextSource.of_bytes(b",HELLO _W\x0c#ABC", suffix=".brf")
    assert [frame.cells.replace("\n", "") for frame in encode_text(brf, GRID, TextOptions()).frames] == [
        "⠠⠓⠑⠇⠇⠕", "⠀⠸⠺⠀⠀⠀", "⠼⠁⠃⠉⠀⠀",
    ]  # fmt: skip


def test_eight_dots_need_rows_of_four():
    eight: dict[str, Any] = {"table": "en-us-comp8-ext.utb"}
    with pytest.raises(LayoutError, match=r"en-us-comp8-ext.utb writes 8-dot cells.*--dots 6"):
        frames_of("Hello", **eight)
    with pytest.raises(LayoutError, match="8-dot cells"):
        frames_of("⡀")
    scene = encode_text("Hello", GridShape(8, 6), TextOptions(**eight))
    assert next(iter(scene.frames)).cells == "⡓⠑⠇\n⠇⠕⠀"
    assert scene.text_frames.check().back == "Hello"
    six = encode_text("Hello", GRID, TextOptions(**eight, dots=6))
    assert next(iter(six.frames)).cells == "⠓⠑⠇\n⠇⠕⠀"
    (use,) = six.text_frames.report.undefined
    assert (use.characters, use.action, use.written, use.first) == ("H", "six dots", "⠓", 0)


def test_undefined_characters_are_named_and_found_in_the_spans():
    scene = encode_text("hi 😂 you", GRID, TextOptions())
    assert shown_text(scene.frames) == "hi 😂 you"
    assert scene.text_frames.check().back == "hi (face with tears of joy) you"
    (use,) = scene.text_frames.report.undefined
    assert (use.characters, use.action, use.first) == ("😂", "named", 3)


def test_policy_error_fails_before_the_first_frame():
    with pytest.raises(UndefinedCharacter, match="character 10: "):
        encode_text("Fine here 😂", GRID, TextOptions(undefined=Undefined.ERROR))


def test_nothing_left_after_dropping_is_an_error():
    with pytest.raises(EmptyText, match="can write none of its characters"):
        encode_text("😂 漢", GRID, TextOptions(undefined=Undefined.DROP))


def test_a_missing_table():
    with pytest.raises(TableMissing, match="nearest: en-ueb-g2"):
        encode_text("a", GRID, TextOptions(table="en-ueb-g22.ctb"))


def test_the_text_of_a_manifest_is_enough_to_check():
    # The two paragraphs become one here, which in UEB would be written as one passage of capitals.
    scene = encode_text("HELLO\n\nTHE WORLD AGAIN", GRID, TextOptions())
    check = back_check([frame.cells for frame in scene.frames], shown_text(scene.frames), scene.encoding)
    assert check.text_equal
    assert check.ok


def test_a_wrong_dot_is_found():
    scene = encode_text("Hello world", GRID, TextOptions())
    pages = [frame.cells for frame in scene.frames]
    assert back_check(pages, "Hello world", scene.encoding).ok
    pages[1] = pages[1].replace("⠺", "⠗")
    check = back_check(pages, "Hello world", scene.encoding)
    assert not check.ok
    assert not check.text_equal
    assert check.difference_total == 1
    assert check.differences[0].source == "world"
    assert "not those of the text" in check.sentence


@pytest.mark.parametrize("change", [lambda pages: pages[:-1], lambda pages: pages[::-1], lambda pages: pages * 2])
def test_missing_swapped_and_doubled_pages_are_found(change):
    scene = encode_text("the quick brown fox", GRID, TextOptions())
    pages = [frame.cells for frame in scene.frames]
    assert not back_check(change(pages), "the quick brown fox", scene.encoding).ok


@given(st.lists(st.sampled_from(["knowledge", "the", "well-known", "Anna", "12", "pre-", "-", "a", "😂", "\n\n", "é"])))
@settings(max_examples=80, deadline=None)
def test_any_words_are_shown_completely(words):
    text = " ".join(words)
    if not text.strip():
        return
    scene = encode_text(text, GRID, TextOptions())
    assert scene.text_frames.check().cells_equal
    assert "".join(shown_text(scene.frames).split()) == "".join(text.split())


@pytest.mark.parametrize(
    ("text", "table"),
    [("السَّلَامُ عَلَيْكُمْ يَا صَدِيقِي", "ar-ar-g1.utb"), ("שָׁלוֹם עוֹלָם", "he-IL.utb"), ("سلام ‏12 دنیا", "fa-ir-g1.utb")],
)
def test_right_to_left_text_with_marks_keeps_its_order(text, table):
    scene = encode_text(text, GRID, TextOptions(table=table))
    assert scene.text_frames.check().cells_equal
    starts = [frame.span[0] for frame in scene.frames]
    assert starts == sorted(starts)
    assert not any(use.action in ("named", "dropped") for use in scene.text_frames.report.undefined)


def test_ten_thousand_emoji():
    scene = encode_text("😂" * 10_000, GRID, TextOptions())
    spans = [frame.span for frame in scene.frames]
    assert spans[-1][1] == 10_000
    assert scene.text_frames.check().back == "(face with tears of joy, 10000 times)"
    report = scene.text_frames.report
    assert report.undefined_total == 10_000
    assert [(use.count, use.action) for use in report.undefined] == [(10_000, "named")]


@pytest.mark.parametrize("run", [" ", "\t", "\n", "\f", "\u2029 ", "\r\n"])
def test_a_megabyte_of_white_space_is_passed_over(run):
    """From each blank to the next word it would take an hour."""
    scene = encode_text(f"one{run * (1_000_000 // len(run))}two", GRID, TextOptions(table="en-ueb-g1.ctb"))
    assert " ".join(frame.text for frame in scene.frames).split() == ["one", "two"]
    assert scene.text_frames.check().text_equal


@pytest.mark.slow
def test_a_long_line_without_a_space_is_complete():
    text = "abcdefghij" * 20_000
    scene = encode_text(text, GRID, TextOptions(table="en-ueb-g1.ctb"))
    at = 0
    for frame in scene.frames:
        assert frame.span[0] == at
        at = frame.span[1]
    assert at == len(text)
    report = scene.text_frames.report
    # The letters, and the hyphen that ends each page but the last.
    assert report.cells == len(text) + report.pages - 1
    assert report.split_total == report.pages - 1
    assert len(report.splits) == 100
    assert scene.text_frames.check().text_equal


@pytest.mark.slow
def test_a_line_of_a_megabyte_without_a_space():
    scene = encode_text("abcdefghij" * 100_000, GRID, TextOptions())
    assert scene.text_frames.check().text_equal


def test_pieces_of_a_long_line_do_not_part_letters_from_their_marks():
    text = "x" + "e\u0301" * 3000
    scene = encode_text(text, GRID, TextOptions())
    assert scene.text_frames.check().text_equal
    assert scene.text_frames.report.undefined == ()


def test_memory_does_not_grow_with_the_text(monkeypatch):
    # The frames of a short text are kept; those of this one are taken for a long one's.
    monkeypatch.setattr("encoders.braille.text.MOST_KEPT", 0)
    paragraph = "The river ran under the old stone bridge, and people knew it.\n\n"

    def peak(times: int) -> int:
        scene = encode_text(paragraph * times, GRID, TextOptions())
        tracemalloc.start()
        for _ in scene.frames:
            pass
        highest = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return highest

    # What is kept of any text, and what the interpreter keeps to use again, is there then.
    peak(400)
    assert peak(400) < 1.5 * peak(40) + 200_000


def test_equal_pages_share_one_pattern():
    frames = frames_of("but\n\n" * 3)
    assert len(frames) == 3
    assert len({id(frame.pattern) for frame in frames}) == 1
