"""What becomes of a document on its way to cells: emphasis, headings, where it begins, formulas, encodings."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

from encoders import (
    Block,
    BlockKind,
    Document,
    DocumentsMissing,
    Emphasis,
    EncodeError,
    EncodingReport,
    GridShape,
    InvalidText,
    LayoutError,
    Mathematics,
    TextOptions,
    TextRun,
    TextScene,
    TextSource,
    encode_text,
)  # fmt: skip
from tests.support.documents import MASTER

SMALL, WIDE = GridShape(6, 6), GridShape(3, 48)
ITALIC, BOLD_PASSAGE, BOLD_END = "⠨⠂", "⠘⠶", "⠘⠄"


def scene_of(markdown: str, shape: GridShape = WIDE, **options: object) -> TextScene:
    source = TextSource.of_bytes(markdown.encode(), "a.md", suffix=".md")
    return encode_text(source, shape, TextOptions(**options))  # type: ignore[arg-type]


def cells_of(scene: TextScene) -> str:
    return "".join(frame.cells.replace("\n", "") for frame in scene.frames)


def test_emphasis_is_written_on_long_lines_and_dropped_on_short_ones() -> None:
    assert ITALIC in cells_of(scene_of("an *old* house"))
    assert ITALIC not in cells_of(scene_of("an *old* house", SMALL))
    assert ITALIC not in cells_of(scene_of("an *old* house", emphasis="drop"))
    assert ITALIC in cells_of(scene_of("an *old* house", SMALL, emphasis="keep"))


def test_a_passage_has_its_indicators_where_pages_have_several_lines() -> None:
    tall = cells_of(scene_of("now **three bold words** end", GridShape(12, 48)))
    assert BOLD_PASSAGE in tall
    assert BOLD_END in tall
    # A page of one line is read alone: every word says it itself.
    assert BOLD_PASSAGE not in cells_of(scene_of("now **three bold words** end"))


def test_nothing_emphasised_gives_the_cells_of_plain_text() -> None:
    plain = encode_text("an old house", WIDE, TextOptions())
    marked = scene_of("an old house")
    assert cells_of(marked) == cells_of(plain)
    assert marked.encoding == plain.encoding


@pytest.mark.parametrize("shape", [SMALL, WIDE, GridShape(12, 32)])
def test_what_is_emphasised_checks(shape: GridShape) -> None:
    words = "*Every* word of **This Bold Passage 2026** and *internationalisation* is `kept` as __it__ is.\n\n*End*"
    check = scene_of(words, shape, emphasis="keep").text_frames.check()
    assert check.cells_equal
    assert check.text_equal, check.differences
    assert not check.alone


def test_a_wrong_indicator_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = scene_of("an *old* house", emphasis="keep")
    assert scene.text_frames.check().cells_equal
    # The frames stand; the check is told of no emphasis.
    monkeypatch.setattr(scene.text_frames, "source", TextSource.of_text("an old house"))
    assert not scene.text_frames.check().cells_equal


def test_headings_are_on_the_frames_they_begin_in() -> None:
    frames = list(scene_of(MASTER, SMALL, presentation="by-row").frames)
    found = [(frame.headings[0].level, frame.headings[0].text, frame.page) for frame in frames if frame.headings]
    assert [one[:2] for one in found] == [(1, "First chapter"), (2, "The second")]
    assert frames[0].headings
    second = next(number for number, frame in enumerate(frames) if frame.page == found[1][2])
    assert frames[second].text.startswith("The")


@pytest.mark.parametrize(
    ("start_at", "begins"),
    [
        (1, "First"),
        ("2", "chapter"),
        ("the second", "The second"),
        ("The sec", "The second"),
        ("leaning  WORDS", "leaning words"),
        ("1. first", "1. first"),
    ],
)
def test_it_begins_where_it_is_asked_to(start_at: str | int, begins: str) -> None:
    scene = scene_of(MASTER, SMALL, start_at=start_at)
    frames = list(scene.frames)
    assert scene.text_frames.source.text.startswith(begins)
    assert begins.startswith(frames[0].text.split()[0])
    assert frames[0].page == 0
    assert scene.text_frames.check().cells_equal
    document = scene.text_frames.source.document
    assert document is not None
    whole = TextSource.of_bytes(MASTER.encode(), "a.md", suffix=".md")
    assert whole.document is not None
    assert document.place_at(0) == whole.document.place_at(whole.text.index(scene.text_frames.source.text))


def test_pages_are_those_of_the_whole() -> None:
    whole = [frame.text.strip() for frame in scene_of(MASTER, SMALL).frames]
    part = scene_of(MASTER, SMALL, pages="3-5")
    assert [frame.text.strip() for frame in part.frames] == whole[2:5]
    assert scene_of(MASTER, SMALL, pages="25-").text_frames.source.text.split()[-1] == "it."
    from_there = scene_of(MASTER, SMALL, start_at="The second", pages=1)
    assert from_there.text_frames.source.text.strip() == "The second"[: len(from_there.text_frames.source.text.strip())]
    assert part.text_frames.check().cells_equal


def test_source_and_options_of_frames_give_them_again() -> None:
    frames = scene_of(MASTER, SMALL, start_at="The second", pages="2-3").text_frames
    again = encode_text(frames.source, SMALL, frames.options)
    assert [frame.cells for frame in again.frames] == [frame.cells for frame in frames]


def test_a_page_that_begins_inside_a_word_begins_with_the_word() -> None:
    text = "internationalisation and more"
    for page in (2, 3):
        source = encode_text(text, SMALL, TextOptions(pages=str(page))).text_frames.source
        assert source.text.split()[0] in text.split()


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"pages": "900"}, "has .* pages, so there is no page 900"),
        ({"pages": "5-3"}, "in their order"),
        ({"pages": "x"}, "expected pages such as 10-20"),
        ({"pages": "0"}, "from 1 on"),
        ({"start_at": 0}, "counted from 1"),
        ({"start_at": "nowhere"}, "no page, heading or words 'nowhere'; its headings are 'First chapter', 'The sec"),
    ],
)  # fmt: skip
def test_a_place_that_is_not_there(options: dict[str, object], says: str) -> None:
    with pytest.raises(LayoutError, match=says):
        scene_of(MASTER, SMALL, **options)


def test_the_manifest_has_headings_and_verifies_emphasis(tmp_path: Path, dotwave) -> None:
    book, out = tmp_path / "book.md", tmp_path / "book.wav"
    book.write_text("# One\n\nan *old* house\n\n## Two\n\nend\n")
    assert dotwave("text", book, "-d", "linked-6x6", "--emphasis", "keep", "-o", out).code == 0
    manifest = json.loads(out.with_suffix(".json").read_text())
    assert [(one["level"], one["text"]) for one in manifest["headings"]] == [(1, "One"), (2, "Two")]
    for one in manifest["headings"]:
        frame = manifest["frames"][one["frame"]]
        assert (frame["page"], frame["start_s"]) == (one["page"], one["start_s"])
        assert frame["text"].startswith(one["text"])
    ended = dotwave("verify", out, "--json")
    report = json.loads(ended.out)
    assert ended.code == 0
    assert report["cells_equal"]
    assert report["text_equal"]
    # Without the emphases the cells are not those of the text.
    del manifest["encoding"]["emphases"]
    out.with_suffix(".json").write_text(json.dumps(manifest))
    assert not json.loads(dotwave("verify", out, "--json").out)["cells_equal"]


def test_a_job_has_the_same_choices(tmp_path: Path, dotwave) -> None:
    (tmp_path / "book.txt").write_bytes("grüße aus dem süden".encode("cp1252"))
    job = tmp_path / "job.yaml"
    job.write_text("sequence:\n  - text: {file: book.txt, encoding: cp1252, from: aus, pages: 1}\n")
    ended = dotwave("render", job, "--json")
    assert ended.code == 0, ended.err
    assert json.loads(ended.out)["parts"] == ["text: aus"]
    job.write_text("sequence:\n  - text: {file: book.txt, encoding: klingon}\n")
    ended = dotwave("render", job)
    assert ended.code == 2
    assert "no encoding is called 'klingon'" in ended.err


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-le", "utf-16-be", "utf-8-sig", "utf-32"])
def test_marked_encodings_are_read(encoding: str) -> None:
    marks = {"utf-16-le": b"\xff\xfe", "utf-16-be": b"\xfe\xff"}
    data = marks.get(encoding, b"") + "naïve ⠁\nb".encode(encoding)
    assert TextSource.of_bytes(data).text == "naïve ⠁\nb"
    assert TextSource.of_bytes(data, suffix=".md").text == "naïve ⠁ b"


@pytest.mark.parametrize(
    ("text", "encoding"),
    [
        ("Viele Grüße aus Köln für alle, die schön träumen", "cp1252"),
        ("Съешь ещё этих мягких французских булок, да выпей чаю", "cp1251"),
        ("Příliš žluťoučký kůň úpěl ďábelské ódy", "cp1250"),
        ("吾輩は猫である。名前はまだ無い。どこで生れたかとんと見当がつかぬ。", "shift_jis"),
        ("hello there, this is text", "utf-16-le"),
    ],
)
def test_a_likely_encoding_is_named_and_reads_it(text: str, encoding: str) -> None:
    with pytest.raises(InvalidText, match=f"--encoding {encoding}"):
        TextSource.of_bytes(text.encode(encoding), "a.txt")
    assert TextSource.of_bytes(text.encode(encoding), "a.txt", encoding=encoding).text == text


def test_html_has_the_encoding_it_declares() -> None:
    page = '<meta charset="{}"><p>naïve'
    assert TextSource.of_bytes(page.format("iso-8859-1").encode("latin-1"), suffix=".html").text == "naïve"
    assert TextSource.of_bytes(page.format("nonsense").encode(), suffix=".html").text == "naïve"
    with pytest.raises(InvalidText, match="EPUB says its encoding itself"):
        TextSource.of_bytes(b"PK\x03\x04 application/epub+zip", encoding="latin-1")


FORMULA = (
    '<p>so <math xmlns="http://www.w3.org/1998/Math/MathML" alttext="half + x squared">'
    "<mfrac><mn>1</mn><mn>2</mn></mfrac><mo>+</mo><msup><mi>x</mi><mn>2</mn></msup></math> it is</p>"
)


def test_a_formula_without_a_converter(monkeypatch: pytest.MonkeyPatch) -> None:
    from encoders.documents import maths

    monkeypatch.setattr(shutil, "which", lambda name: None)
    maths._converter.cache_clear()
    with pytest.raises(
        DocumentsMissing, match=r"a.html: line 1: a formula .*npm install -g speech-rule-engine.*--math words"
    ):
        TextSource.of_bytes(FORMULA.encode(), "a.html", suffix=".html")
    words = TextSource.of_bytes(FORMULA.encode(), "a.html", suffix=".html", math=Mathematics.WORDS)
    assert words.text == "so half + x squared it is"
    assert TextSource.of_bytes(
        FORMULA.replace("alttext", "id").encode(), suffix=".html", math=Mathematics.WORDS
    ).text == ("so 12+x2 it is")


def test_a_formula_in_nemeth_code() -> None:
    if shutil.which("node") is None:
        pytest.skip("node is not installed")
    try:
        source = TextSource.of_bytes(FORMULA.encode(), "a.html", suffix=".html")
    except DocumentsMissing:
        pytest.skip("speech-rule-engine is not installed for node (npm install -g speech-rule-engine)")
    assert source.text == "so ⠸⠩⠀⠹⠂⠌⠆⠼⠬⠭⠘⠆⠀⠸⠱ it is"
    check = encode_text(source, WIDE, TextOptions()).text_frames.check()
    assert check.cells_equal


def test_images_are_words_or_pictures_by_choice(tmp_path: Path, dotwave) -> None:
    from PIL import Image, ImageDraw

    picture = Image.new("L", (60, 60), 255)
    ImageDraw.Draw(picture).ellipse((10, 10, 50, 50), fill=0)
    picture.save(tmp_path / "disc.png")
    page = tmp_path / "page.html"
    page.write_text('<p>one</p><img src="disc.png" alt="a disc"><p>two</p><img src="gone.png" alt="lost"><p>three</p>')
    words = dotwave("text", page, "-d", "paper-6x6", "--json")
    assert "a disc" in json.loads(words.out)["text"]
    ended = dotwave("text", page, "-d", "paper-6x6", "--images", "picture", "--json")
    assert ended.code == 0, ended.err
    kinds = [part.partition(":")[0] for part in json.loads(ended.out)["parts"]]
    assert kinds == ["text", "icon", "text", "image left out"]
    assert "lost" in ended.out


def test_a_document_of_ones_own_is_encoded() -> None:
    blocks = (
        Block(BlockKind.HEADING, (TextRun("Title"),), 1),
        Block(BlockKind.PARAGRAPH, (TextRun("so "), TextRun("it", Emphasis.BOLD), TextRun(" is"))),
    )
    source = TextSource.of_document(Document(blocks))
    assert source.text == "Title\n\nso it is"
    report: EncodingReport = encode_text(source, WIDE, TextOptions()).text_frames.report
    assert not report.undefined
    with pytest.raises(EncodeError, match="the text is empty"):
        TextSource.of_document(Document(()))


def test_reports_say_where_in_the_file_something_is(tmp_path: Path, dotwave) -> None:
    book = tmp_path / "book.md"
    book.write_text("# One\n\n\nsome \ue000 sign and internationalisation\n")
    report = json.loads(dotwave("text", book, "-d", "linked-6x6", "--json").out)
    assert "first at character 10 (line 4)" in report["undefined"][0]
    assert any("(line 4), page" in one for one in report["split"])


def test_a_layout_can_ask_what_stands_where() -> None:
    document = TextSource.of_bytes(MASTER.encode(), "a.md", suffix=".md").document
    assert document is not None
    item = document.block_at(document.text.index("1. first") + 3)
    assert item is not None
    assert (item.kind, item.level, document.text[item.start : item.end]) == (BlockKind.LIST_ITEM, 1, "1. first")
    assert document.block_at(item.end) is None
