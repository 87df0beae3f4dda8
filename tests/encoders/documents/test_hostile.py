"""Documents that are broken or mean harm: read, or refused in one line.

``python -m tests.encoders.documents.test_hostile COUNT SEED`` feeds so many mutated files and prints what became of
them.
"""

from __future__ import annotations

import contextlib
import io
import random
import re
import subprocess
import sys
import tempfile
import zipfile
import zlib
from collections import Counter
from itertools import pairwise
from pathlib import Path

import pytest

from encoders import EncodeError, InvalidText, Mathematics, TextSource, UnsupportedSource
from tests.support.documents import MASTER, by_pandoc, package, zipped

CONTAINER = '<container><rootfiles><rootfile full-path="package.opf"/></rootfiles></container>'
LAUGHS = (
    '<?xml version="1.0"?><!DOCTYPE dtbook [<!ENTITY a "ha">'
    + "".join(f'<!ENTITY {after} "{f"&{name};" * 10}">' for name, after in pairwise("abcdefghi"))
    + "]><dtbook><book><p>&i;</p></book></dtbook>"
)
OUTSIDE = (
    '<?xml version="1.0"?><!DOCTYPE dtbook [<!ENTITY x SYSTEM "file:///etc/passwd">]>'
    "<dtbook><book><p>&x; words</p></book></dtbook>"
)
PDF_LOOP = (
    b"%PDF-1.4\n1 0 obj<</Type/Catalog/Pages 2 0 R>>endobj\n2 0 obj<</Type/Pages/Count 1/Kids[3 0 R]>>endobj\n"
    b"3 0 obj<</Type/Pages/Count 1/Kids[2 0 R]>>endobj\ntrailer<</Root 1 0 R/Size 4>>\n%%EOF"
)


def bomb() -> bytes:
    return zipped({"META-INF/container.xml": CONTAINER, **package({"a.xhtml": "x" * 31_000_000})})


def many() -> bytes:
    return zipped({f"{number}": b"" for number in range(20_001)} | {"package.opf": b""})


def named(name: str) -> bytes:
    return zipped({"META-INF/container.xml": CONTAINER, **package({"a.xhtml": "<p>a</p>"}), name: b"x"})


def twice() -> bytes:
    files = package({"a.xhtml": "<p>a</p>"})
    opf = str(files["package.opf"])
    files["package.opf"] = opf.replace("<spine>", '<spine><itemref idref="p0"/>')
    return zipped({"META-INF/container.xml": CONTAINER, **files})


def locked() -> bytes:
    data = bytearray(zipped({"META-INF/container.xml": CONTAINER}))
    for mark, place in ((b"PK\x03\x04", 6), (b"PK\x01\x02", 8)):
        data[data.index(mark) + place] |= 1
    return bytes(data)


def docx_of_entities() -> bytes:
    inside = '<?xml version="1.0"?><!DOCTYPE a [<!ENTITY b "c">]><w:document/>'
    return zipped({"word/document.xml": inside, "[Content_Types].xml": "<Types/>"})


def pdf(packed: bytes = b"") -> bytes:
    """A PDF of one page with two words on it, or what is packed in its place."""
    stream = packed or b"BT /F1 12 Tf 72 700 Td (Hello there) Tj ET"
    how = b"/Filter/FlateDecode" if packed else b""
    objects = [
        b"<</Type/Catalog/Pages 2 0 R>>", b"<</Type/Pages/Count 1/Kids[3 0 R]>>",
        b"<</Type/Page/Parent 2 0 R/MediaBox[0 0 600 800]/Contents 4 0 R/Resources<</Font<</F1 5 0 R>>>>>>",
        b"<</Length %d%s>>stream\n%s\nendstream" % (len(stream), how, stream),
        b"<</Type/Font/Subtype/Type1/BaseFont/Helvetica>>",
    ]  # fmt: skip
    body, places = b"%PDF-1.4\n", []
    for number, content in enumerate(objects, 1):
        places.append(len(body))
        body += b"%d 0 obj%s endobj\n" % (number, content)
    table = b"".join(b"%010d 00000 n \n" % place for place in places)
    return body + b"xref\n0 6\n0000000000 65535 f \n%strailer<</Root 1 0 R/Size 6>>\nstartxref\n%d\n%%%%EOF" % (
        table,
        len(body),
    )


@pytest.mark.parametrize(
    ("suffix", "data", "says"),
    [
        (".xml", LAUGHS.encode(), "declares entities"),
        (".xml", LAUGHS.encode("utf-16"), "declares entities"),
        (".xml", OUTSIDE.encode(), "declares entities"),
        (".html", OUTSIDE.replace("dtbook", "html").encode(), "declares entities"),
        (".docx", docx_of_entities(), r"word/document.xml: declares entities"),
        (".epub", bomb(), "not packed so tight"),
        (".ebrl", many(), "20002 files; at most"),
        (".epub", named("../../etc/passwd"), "which leaves it"),
        (".epub", named("/etc/passwd"), "which leaves it"),
        (".epub", named("C:/x"), "which leaves it"),
        (".epub", named("a\\b"), "which leaves it"),
        (".epub", twice(), "one file twice"),
        (".epub", locked(), "cannot be taken out of the archive"),
        (".epub", zipped({"META-INF/container.xml": CONTAINER}), "names no package"),
        (".epub", b"PK\x03\x04" + b"\0" * 60 + b"application/epub+zip", "not a whole zip archive"),
        (".html", b"<div>" * 5000 + b"deep", "more than 255 deep"),
        (".xml", b"<?xml version='1.0'?><dtbook>" + b"<p>" * 5000, "more than 255 deep"),
        (".pef", b"<pef>" * 5000, "more than 255 deep"),
        (".pef", "<pef><row>⠁</row></pef>".encode(), "line 1: a row outside of a page"),
        (".docx", b"words", "not a whole zip archive"),
        (".docx", zipped({"word/document.xml": "<a/>"}), "not a whole DOCX file"),
        (".odt", zipped({"mimetype": "x"}), "'content.xml' is not in the archive"),
        (".pdf", b"%PDF-1.7 and no more", "not a whole PDF"),
        (".pdf", PDF_LOOP, "PDF"),
        (".pdf", pdf(zlib.compress(b" " * 200_000_000, 9)), "PDF"),
        (".md", b"# a\xff", "not UTF-8 at byte 3"),
        (".zip", zipped({"a.opf": "<package/>"}), "no DAISY book"),
    ],
)  # fmt: skip
def test_what_means_harm_is_one_clear_line(suffix: str, data: bytes, says: str) -> None:
    with pytest.raises((InvalidText, UnsupportedSource), match=says) as refused:
        TextSource.of_bytes(data, f"file{suffix}", suffix=suffix)
    assert "\n" not in str(refused.value)
    assert str(refused.value).startswith(f"file{suffix}: ")


def test_nothing_outside_is_fetched_or_read(tmp_path: Path) -> None:
    (tmp_path / "secret.png").write_bytes(b"secret")
    folder = tmp_path / "book"
    folder.mkdir()
    (folder / "inside.png").write_bytes(b"inside")
    (folder / "link.png").symlink_to(tmp_path / "secret.png")
    page = folder / "page.html"
    names = ("../secret.png", str(tmp_path / "secret.png"), "link.png", "http://127.0.0.1:9/x.png", "inside.png")
    page.write_text("".join(f'<p>word <img src="{name}" alt="a"></p>' for name in names))
    document = TextSource.of_path(page).document
    assert document is not None
    assert [one.image.load and one.image.load() for one in document.images] == [None, None, None, None, b"inside"]


def test_an_external_dtd_is_left_alone() -> None:
    text = '<!DOCTYPE dtbook SYSTEM "http://127.0.0.1:9/x.dtd"><dtbook><book><p>a&nbsp;b</p></book></dtbook>'
    assert TextSource.of_bytes(text.encode(), suffix=".xml").text == "a\xa0b"


@pytest.mark.parametrize("piece", ["<a ", "<!--", "<p>", "<table><tr><td>", "&amp", "<b>x</b>", "*a ", "[", "> ", "- "])
def test_work_grows_with_the_length(piece: str) -> None:
    """What would be read over and over for every piece would not come to its end here."""
    for suffix in (".html", ".md"):
        with contextlib.suppress(EncodeError):
            assert TextSource.of_bytes(b"x " + piece.encode() * 30_000, suffix=suffix).text


PIECES = (b"<", b">", b"&", b"&#0;", b"]]>", b"\0", b"\xff", b"</p>", b"<!--", b"%%", b"9" * 20)


def mutated(data: bytes, chance: random.Random) -> bytes:
    """A file with a few bytes changed, lost, doubled or put in."""
    made = bytearray(data)
    for _ in range(chance.choice((1, 1, 2, 5, 20))):
        at, length = chance.randrange(len(made) + 1), chance.choice((1, 1, 4, 30, 300))
        kind = chance.randrange(5)
        if kind == 0:
            made[at : at + 1] = bytes([chance.randrange(256)])
        elif kind == 1:
            del made[at : at + length]
        elif kind == 2:
            made[at:at] = made[at : at + length]
        elif kind == 3:
            made[at:at] = chance.choice(
                (b"<", b">", b"&", b"&#0;", b"]]>", b"\0", b"\xff", b"</p>", b"<!--", b"%%", b"9" * 20)
            )
        else:
            del made[at:]
        made = made or bytearray(b"x")
    return bytes(made)


def repacked(data: bytes, chance: random.Random) -> bytes:
    """An archive with one of its files mutated, packed again."""
    archive = zipfile.ZipFile(io.BytesIO(data))
    files = {name: archive.read(name) for name in archive.namelist()}
    name = chance.choice(sorted(files))
    archive.close()
    return zipped({**files, name: mutated(files[name], chance)})


def seeds(folder: Path) -> dict[str, bytes]:
    """A document of every kind."""
    from tests.encoders.documents.test_producers import DTBOOK, PEF

    found = {
        ".md": MASTER.encode(),
        ".pef": PEF.encode(),
        ".xml": DTBOOK.encode(),
        ".ebrl": zipped(package({"a.xhtml": "<h1>⠁⠃</h1><p>⠉⠙</p>"})),
        ".pdf": pdf(),
    }
    for suffix in ("html", "epub", "docx", "odt"):
        found[f".{suffix}"] = by_pandoc(MASTER, folder, suffix).read_bytes()
    return found


def complaint(data: bytes, name: str, suffix: str) -> str:
    """Why a file is refused, empty when it is read."""
    try:
        TextSource.of_bytes(data, name, suffix=suffix, math=Mathematics.WORDS)
    except EncodeError as error:
        return str(error)
    return ""


def fed(given: dict[str, bytes], count: int, seed: int) -> Counter[str]:
    """What became of so many mutated files; a line that is none is an error."""
    chance, became = random.Random(seed), Counter[str]()
    for number in range(count):
        suffix = sorted(given)[number % len(given)]
        packed = given[suffix].startswith(b"PK") and chance.random() < 0.7
        data = (repacked if packed else mutated)(given[suffix], chance)
        said = complaint(data, f"file{suffix}", suffix)
        became[f"{suffix} {'refused' if said else 'read'}"] += 1
        assert not said or said.startswith(f"file{suffix}: "), said
        assert not re.search(r"\n|Traceback|<[A-Z]\w+[.:]", said), said
    return became


def test_a_pdf_of_one_word() -> None:
    source = TextSource.of_bytes(pdf())
    assert source.text == "Hello there"
    assert "guess" in source.notes[0]


def test_mutated_files_are_read_or_refused(tmp_path: Path) -> None:
    became = fed(seeds(tmp_path), 450, 1)
    assert sum(became.values()) == 450
    assert len(became) == 18


@pytest.mark.slow
def test_ten_thousand_mutated_files(tmp_path: Path) -> None:
    assert sum(fed(seeds(tmp_path), 10_000, 2).values()) == 10_000


def test_the_command_line_says_one_line_of_what_is_broken(tmp_path: Path) -> None:
    path = tmp_path / "a.epub"
    path.write_bytes(bomb())
    ran = subprocess.run([sys.executable, "-m", "dotwave", "text", str(path)], capture_output=True, text=True)
    assert ran.returncode == 2
    assert len(ran.stderr.splitlines()) == 1


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as where:
        for what, times in sorted(fed(seeds(Path(where)), int(sys.argv[1]), int(sys.argv[2])).items()):
            print(what, times)
