"""Documents as real programs write them: text, headings, lists and emphasis come back, with their places."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from encoders import SourceKind, TextSource
from tests.support.documents import (
    BLOCKS,
    EMPHASES,
    MASTER,
    blocks_of,
    by_libreoffice,
    by_pandoc,
    emphases_of,
    package,
    zipped,
)  # fmt: skip

BRAILLE = "⠠⠉⠓⠁⠏⠞⠻⠀⠼⠁"


def rows_whole(blocks: list[tuple[str, int, str]]) -> list[tuple[str, int, str]]:
    return [(kind, level, text.rstrip()) for kind, level, text in blocks]


def test_markdown_is_read_with_lines() -> None:
    source = TextSource.of_bytes(MASTER.encode(), "a.md", suffix=".md")
    assert rows_whole(blocks_of(source)) == BLOCKS
    assert emphases_of(source) == EMPHASES
    assert source.document is not None
    assert [str(one.place) for one in source.document.blocks][:4] == ["line 1", "line 3", "line 6", "line 7"]
    assert str(source.document.place_at(source.text.index("on two lines"))) == "line 4"


@pytest.mark.parametrize("ending", ["html", "epub", "docx", "odt"])
def test_documents_of_pandoc(tmp_path: Path, ending: str) -> None:
    source = TextSource.of_path(by_pandoc(MASTER, tmp_path, ending))
    assert source.kind is SourceKind.TEXT
    assert rows_whole(blocks_of(source)) == BLOCKS
    assert emphases_of(source) == EMPHASES
    assert source.document is not None
    assert all(str(block.place) for block in source.document.blocks)
    # By its bytes too, where no name tells.
    again = TextSource.of_bytes((tmp_path / f"made.{ending}").read_bytes()) if ending != "html" else source
    assert again.text == source.text


def test_a_whole_page_of_pandoc_is_known_by_its_bytes(tmp_path: Path) -> None:
    path = by_pandoc(MASTER, tmp_path, "html", "--standalone", "--metadata", "title=Title")
    source = TextSource.of_bytes(path.read_bytes())
    assert rows_whole(blocks_of(source)) == [("heading", 1, "Title"), *BLOCKS]


@pytest.mark.slow
@pytest.mark.parametrize(("first", "second"), [("odt", "docx"), ("docx", "odt")])
def test_documents_of_libreoffice(tmp_path: Path, first: str, second: str) -> None:
    made = by_libreoffice(by_pandoc(MASTER, tmp_path, first), tmp_path, second)
    source = TextSource.of_path(made)
    found = rows_whole(blocks_of(source))
    said = [text.replace("1. ", "").replace("2. ", "") for _, _, text in found]
    assert said == [text.replace("1. ", "").replace("2. ", "") for _, _, text in BLOCKS]
    assert [one for one in found if one[0] == "heading"] == [one for one in BLOCKS if one[0] == "heading"]
    assert emphases_of(source) == EMPHASES


@pytest.mark.slow
def test_a_pdf_is_read_with_a_warning(tmp_path: Path) -> None:
    made = by_libreoffice(by_pandoc(MASTER, tmp_path, "odt"), tmp_path, "pdf")
    source = TextSource.of_path(made)
    words = source.text.replace("•", "").split()
    for _, _, text in BLOCKS:
        assert all(word.strip(";.") in "".join(words) for word in text.split())
    assert source.document is not None
    assert "guess" in source.document.notes[0]
    assert str(source.document.blocks[0].place) == "page 1"


def test_an_ebraille_file_is_cells(tmp_path: Path) -> None:
    pages = {"one.xhtml": f"<h1>{BRAILLE}</h1><p>⠁⠃⠉</p>", "two.xhtml": "<p>⠙⠑⠋<br/>⠛</p>"}
    path = tmp_path / "book.ebrl"
    path.write_bytes(zipped(package(pages)))
    source = TextSource.of_path(path)
    assert source.kind is SourceKind.BRAILLE
    assert blocks_of(source) == [("heading", 1, BRAILLE), ("paragraph", 0, "⠁⠃⠉"), ("verse", 0, "⠙⠑⠋\n⠛")]
    assert source.document is not None
    assert [block.place.part for block in source.document.blocks] == ["one.xhtml", "one.xhtml", "two.xhtml"]
    assert TextSource.of_bytes(path.read_bytes()).text == source.text


DTBOOK = """<?xml version="1.0" encoding="utf-8"?>
<!DOCTYPE dtbook PUBLIC "-//NISO//DTD dtbook 2005-3//EN" "http://www.daisy.org/z3986/2005/dtbook-2005-3.dtd">
<dtbook xmlns="http://www.daisy.org/z3986/2005/" version="2005-3"><head><meta name="dc:Title" content="No"/></head>
<book><frontmatter><doctitle>A book</doctitle></frontmatter><bodymatter><level1><h1>One</h1>
<pagenum id="p1">1</pagenum>
<p><sent>Some <em>leaning</em></sent> <sent>and <strong>heavy</strong> words.</sent></p>
<poem><linegroup><line>Roses are red</line><line>violets are blue</line></linegroup></poem>
<list type="ol"><li>first</li><li><lic>second</lic></li></list><list type="ul"><li>third</li></list>
<level2><h2>Two</h2><p>End.<noteref idref="#n1">1</noteref></p></level2></level1></bodymatter></book></dtbook>"""
DTBOOK_BLOCKS = [
    ("heading", 1, "A book"),
    ("heading", 1, "One"),
    ("paragraph", 0, "Some leaning and heavy words."),
    ("verse", 0, "Roses are red\nviolets are blue"),
    ("list-item", 1, "1. first"),
    ("list-item", 1, "2. second"),
    ("list-item", 1, "third"),
    ("heading", 2, "Two"),
    ("paragraph", 0, "End.1"),
]


def test_a_dtbook_and_a_zipped_daisy_book(tmp_path: Path) -> None:
    alone = TextSource.of_bytes(DTBOOK.encode())
    assert blocks_of(alone) == DTBOOK_BLOCKS
    assert emphases_of(alone) == [("leaning", 1), ("heavy", 4)]
    opf = (
        '<package><manifest><item id="t" href="text/book.xml" media-type="application/x-dtbook+xml"/>'
        '<item id="s" href="a.smil" media-type="application/smil"/></manifest><spine/></package>'
    )
    path = tmp_path / "daisy.zip"
    path.write_bytes(zipped({"book/speechgen.opf": opf, "book/text/book.xml": DTBOOK, "book/a.smil": "<smil/>"}))
    source = TextSource.of_path(path)
    assert source.text == alone.text
    assert source.document is not None
    assert str(source.document.blocks[1].place) == "book/text/book.xml, line 4"


def test_a_daisy_2_book_is_read_in_the_order_of_its_contents() -> None:
    ncc = '<html><body><h1><a href="b.html#x">B</a></h1><h1><a href="a.html#y">A</a></h1></body></html>'
    data = zipped({"ncc.html": ncc, "a.html": "<p>second</p>", "b.html": "<p>first</p>"})
    assert TextSource.of_bytes(data, suffix=".zip").text == "first\n\nsecond"


PEF = """<?xml version="1.0" encoding="UTF-8"?><pef version="2008-1" xmlns="http://www.daisy.org/ns/2008/pef">
<head><meta/></head><body><volume cols="8" rows="4" rowgap="0" duplex="true"><section>
<page><row>⠠⠓⠊⠀⠀⠀⠀⠀</row><row/><row>⠁⠃</row><row/></page>
<page><row>⠉</row></page></section></volume></body></pef>"""


def test_a_pef_file_reads_as_its_brf() -> None:
    source = TextSource.of_bytes(PEF.encode())
    assert source == TextSource.of_bytes(b",HI\n\nAB\x0cC", suffix=".brf")
    with pytest.raises(ValueError, match=r"x.pef: line 3: 'x' is no cell of Braille"):
        TextSource.of_bytes(PEF.replace("⠁⠃", "⠁x").encode(), "x.pef")


def test_no_library_is_one_line_with_its_cure(monkeypatch: pytest.MonkeyPatch, dotwave, tmp_path: Path) -> None:

    for module in ("lxml.html", "lxml.etree", "markdown_it", "mammoth", "pypdf"):
        monkeypatch.setitem(sys.modules, module, None)
    for suffix, data in {".md": b"# A", ".html": b"<p>A", ".pdf": b"%PDF-1.4", ".pef": PEF.encode()}.items():
        path = tmp_path / f"file{suffix}"
        path.write_bytes(data)
        ended = dotwave("text", path)
        assert ended.code == 2
        assert len(ended.err.splitlines()) == 1
        assert "pip install 'dotwave[documents]'" in ended.err
