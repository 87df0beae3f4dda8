"""Pages of several lines: blocks one after another, the line ends that are kept, Braille as it stands."""

import textwrap
from pathlib import Path

import pytest

from encoders import GridShape, LayoutError, LineEnds, TextOptions, TextSource, cells_to_brf, encode_text

WIDE = GridShape(40, 96)
TIGER = (
    "Tyger Tyger, burning bright,\nIn the forests of the night;\nWhat immortal hand or eye,\n"
    "Could frame thy fearful symmetry?"
)
BOOK = """# A book

Some words of a first paragraph, as many as are needed to run over into the next line.

## Chapter

- an item of a list that has as many words as it takes to run over
  - an inner one
- two

After it.

| a | b |
|---|---|
| c | d |

Roses are red\\
Violets are blue
"""


def lines_of(source: TextSource | str, shape: GridShape = WIDE, **options) -> list[list[str]]:
    """For each page its lines as ASCII Braille without the blanks at their ends; read back on the way."""
    scene = encode_text(source, shape, TextOptions(table="en-ueb-g1.ctb", **options))
    check = scene.text_frames.check()
    assert check.cells_equal
    assert check.alone == ()
    return [[cells_to_brf(line).decode().rstrip() for line in frame.cells.split("\n")] for frame in scene.frames]


def document(markdown: str) -> TextSource:
    return TextSource.of_bytes(markdown.encode(), "a.md", suffix=".md")


def test_blocks_follow_each_other_as_braille_lays_them_out():
    first, second = lines_of(document(BOOK))
    assert first == [
        "                    ,A BOOK",
        "  ,SOME WORDS OF A FIRST PARAGRAPH1 AS MANY AS",
        "ARE NEEDED TO RUN OVER INTO THE NEXT LINE4",
        "",
        "    ,CHAPTER",
        "AN ITEM OF A LIST THAT HAS AS MANY WORDS AS IT",
        "    TAKES TO RUN OVER",
        "  AN INNER ONE",
        "TWO",
        "  ,AFTER IT4",
        "",
        "A2 B",
        "C2 D",
    ]
    assert second[:3] == [",ROSES ARE RED", ",VIOLETS ARE BLUE", ""]


def test_an_empty_line_stands_before_what_begins_where_the_block_before_went_on():
    (page,) = lines_of("A list:\n\n- one\n- two\n\nAnd the\nlast words.")
    assert page[:6] == ["  ,A LIST3", "", "- ONE", "- TWO", "", "  ,AND THE LAST WORDS4"]


def test_a_heading_never_ends_a_page():
    words = "\n\n".join(["A paragraph of one line."] * 11)
    first, second = lines_of(document(f"{words}\n\n## Chapter\n\nIts words."))
    assert first[11:] == ["", ""]
    assert second[:3] == ["    ,CHAPTER", "  ,ITS WORDS4", ""]
    # Here it was on the last line already, two headings together.
    words = "\n\n".join(["A paragraph of one line."] * 8)
    long = "## A chapter with a heading that is longer than what is left of its first line"
    first, second = lines_of(document(f"{words}\n\n# Part\n\n{long}\n\nIts words."))
    assert first[8:] == [""] * 5
    assert [line.strip()[:6] for line in second[:6]] == [",PART", "", ",A CHA", "THAN W", ",ITS W", ""]


def test_devices_of_one_run_show_a_block_on_pages_of_its_own():
    for shape in (GridShape(6, 6), GridShape(3, 6), GridShape(3, 96)):
        frames = list(encode_text("one\n\ntwo", shape, TextOptions()).frames)
        assert [frame.text for frame in frames if frame.text.strip()][-1] == "two"
        assert not any("one" in frame.text and "two" in frame.text for frame in frames)


def test_verse_and_lists_of_plain_text_are_recognised():
    (page,) = lines_of(f"{TIGER}\n\n1. one\n2. two that\n   goes on\n3. three")
    assert page[:4] == [
        ",TYGER ,TYGER1 BURNING BRIGHT1", ",IN THE FORESTS OF THE NIGHT2", ",WHAT IMMORTAL HAND OR EYE1",
        ",COULD FRAME THY FEARFUL SYMMETRY8",
    ]  # fmt: skip
    assert page[4:7] == ["#A4 ONE", "#B4 TWO THAT GOES ON", "#C4 THREE"]


@pytest.mark.parametrize("width", [30, 40, 61, 76])
def test_text_that_a_program_has_wrapped_is_no_verse(width):
    prose = (Path(__file__).parents[2] / "samples" / "texts" / "en.txt").read_text()
    words = " ".join(prose.split())
    assert lines_of(textwrap.fill(words, width)) == lines_of(words)


def test_line_ends_are_kept_or_joined_by_choice():
    prose = "one long line of words\ntwo"
    assert lines_of(prose)[0][:2] == ["  ONE LONG LINE OF WORDS TWO", ""]
    assert lines_of(prose, lines="keep")[0][:3] == ["ONE LONG LINE OF WORDS", "TWO", ""]
    assert lines_of(TIGER, lines="join")[0][1] == "OF THE NIGHT2 ,WHAT IMMORTAL HAND OR EYE1 ,COULD"
    # Numbers one below the other are not one number.
    assert lines_of("100\n200", lines="keep")[0][:2] == ["#AJJ", "#BJJ"]
    small = [frame.text for frame in encode_text("ab\ncd", GridShape(6, 6), TextOptions(lines=LineEnds.KEEP)).frames]
    assert small == ["ab\u2028", "cd"]
    assert [frame.text for frame in encode_text("a\nb", GridShape(6, 6), TextOptions()).frames] == ["a\nb"]
    with pytest.raises(LayoutError, match="lines: expected one of keep, join, got 'cut'"):
        TextOptions(lines="cut")  # type: ignore[arg-type]


def test_braille_keeps_its_lines_and_pages_where_they_fit():
    brf = b"     ,TITLE\n\n  ,HELLO   _W\nABC\x0c\n ,BYE"
    source = TextSource.of_bytes(brf, suffix=".brf")
    first, second = lines_of(source)
    assert first[:5] == ["     ,TITLE", "", "  ,HELLO   _W", "ABC", ""]
    assert second[:3] == ["", " ,BYE", ""]
    assert lines_of(source, GridShape(3, 24))[2:3] == [["ABC"]]
    # Not where a line is longer than those of the device, nor where they are joined.
    assert lines_of(source, GridShape(40, 20))[0][:3] == ["  ,TITLE", "  ,HELLO", "_W ABC"]
    assert lines_of(source, lines="join")[0][:4] == ["  ,TITLE", "  ,HELLO _W ABC", "  ,BYE", ""]


def test_a_page_of_braille_longer_than_the_device_goes_on_on_the_next():
    source = TextSource.of_bytes(
        "\n".join(f"L{'ABCDEFGHIJ'[k % 10]}" for k in range(25)).encode() + b"\x0cX", suffix=".brf"
    )
    pages = lines_of(source)
    assert [sum(map(bool, page)) for page in pages] == [13, 12, 1]


def test_a_part_has_the_pages_of_the_whole():
    prose = (Path(__file__).parents[2] / "samples" / "texts" / "en.txt").read_text()
    text = "\n\n".join([" ".join(prose.split())] * 8 + [TIGER])
    whole = lines_of(text)
    assert len(whole) > 3
    part = lines_of(text, pages="2-4")
    assert part[0] == whole[1]
    assert part[1] == whole[2]


def test_the_text_of_a_page_says_its_lines():
    (frame,) = encode_text(TIGER, WIDE, TextOptions()).frames
    assert frame.text == TIGER.replace("\n", "\u2028")
