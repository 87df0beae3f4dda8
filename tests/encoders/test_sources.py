"""What is read, what is refused, and the place of what is broken."""

import io
import sys
from pathlib import Path

import pytest

from dotwave.cli.completion import completed_texts
from encoders import (
    READERS,
    EmptyText,
    EncodeError,
    InvalidText,
    Reader,
    SourceKind,
    TextSource,
    UnsupportedSource,
    text_suffixes,
)


def test_bom_and_line_ends():
    source = TextSource.of_bytes(b"\xef\xbb\xbfone\r\ntwo\rthree\n")
    assert source.text == "one\ntwo\nthree\n"
    assert source.kind is SourceKind.TEXT


def test_unicode_braille_is_braille_and_mixed_text_is_text():
    assert TextSource.of_text("⠠⠓⠊ ⠁\n").kind is SourceKind.BRAILLE
    assert TextSource.of_text("⠠⠓⠊ a").kind is SourceKind.TEXT


def test_brf_by_suffix(tmp_path: Path):
    path = tmp_path / "page.BRF"
    path.write_bytes(b",HI\x0c,A\r\n")
    source = TextSource.of_path(path)
    assert (source.text, source.kind) == ("⠠⠓⠊\f⠠⠁\n", SourceKind.BRAILLE)


def test_a_stream_is_read_once():
    stream = io.BytesIO("naïve".encode())
    assert TextSource.of_stream(stream).text == "naïve"
    assert stream.read() == b""


@pytest.mark.parametrize("empty", ["", " \n\t\n", "\ufeff", "\u00a0", "⠀⠀\n⠀"])
def test_empty_text_is_refused(empty):
    with pytest.raises(EmptyText, match="give at least one"):
        TextSource.of_text(empty)


def test_invalid_utf8_names_the_byte_offset():
    with pytest.raises(InvalidText, match=r"book.txt: not UTF-8 at byte 3 \(0xff\); save it as UTF-8"):
        TextSource.of_bytes(b"\xc3\xa9a\xffb", "book.txt")


def test_nul_names_its_offset():
    with pytest.raises(InvalidText, match="NUL byte at byte 3"):
        TextSource.of_bytes(b"\xc3\xa9a\0b")
    with pytest.raises(InvalidText, match="NUL character at character 2"):
        TextSource.of_text("éa\0b")


def test_half_a_surrogate_pair_is_refused():
    with pytest.raises(InvalidText, match="character 1"):
        TextSource.of_text("a\udcffb")


def test_bad_brf_names_file_and_offset():
    with pytest.raises(InvalidText, match=r"x.brf: not ASCII Braille at byte 1"):
        TextSource.of_bytes(b"A\xe9", "x.brf", suffix=".brf")


@pytest.mark.parametrize(
    ("data", "kind"),
    [
        (b"%!PS-Adobe", "PostScript"),
        (b"PK\x03\x04....", "zip"),
        (b"{\\rtf1 hello}", "RTF"),
        (b"\x89PNG\r\n\x1a\n", "PNG"),
        (b"\xff\xd8\xff\xe0", "JPEG"),
        (b"GIF89a", "GIF"),
        (b"\n <svg>", "SVG"),
        (b"<?xml version='1.0'?><song/>", "XML"),
    ],
)
def test_other_kinds_are_refused_by_name(data, kind):
    with pytest.raises(UnsupportedSource, match=f"{kind}.*give text, BRF, .*ODT, DAISY or PDF"):
        TextSource.of_bytes(data, "input")


@pytest.mark.parametrize("suffix", [".doc", ".rtf", ".png", ".gz"])
def test_other_suffixes_are_refused(tmp_path: Path, suffix):
    path = tmp_path / f"file{suffix}"
    path.write_text("plain")
    with pytest.raises(UnsupportedSource, match=f"file{suffix}"):
        TextSource.of_path(path)


def test_an_absent_file_is_one_line(tmp_path: Path):
    with pytest.raises(UnsupportedSource, match=r"nowhere.txt: cannot be read: No such file"):
        TextSource.of_path(tmp_path / "nowhere.txt")


def reversed_text(data: bytes) -> str:
    """A format of its own for the next test: the characters from last to first behind two bytes of zip."""
    if not data.startswith(b"PK"):
        raise InvalidText("no PK at byte 0")
    return data[4:].decode()[::-1]


def test_a_format_is_one_function_and_one_entry(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, dotwave):
    path = tmp_path / "file.rtf"
    path.write_bytes(b"PK\x03\x04olleH")
    with pytest.raises(UnsupportedSource, match="RTF is not read"):
        TextSource.of_path(path)
    monkeypatch.setitem(sys.modules, "another_reader", sys.modules[__name__])
    entry = Reader("RTF", (".rtf",), "another_reader:reversed_text", (b"PK\x03\x04",))
    monkeypatch.setattr("encoders.braille.readers.formats.READERS", (*READERS, entry))
    assert TextSource.of_path(path).text == "Hello"
    # By its content where no name tells.
    assert TextSource.of_stream(io.BytesIO(path.read_bytes())).text == "Hello"
    path.write_bytes(b"Hello")
    with pytest.raises(InvalidText, match=r"file.rtf: no PK at byte 0"):
        TextSource.of_path(path)
    # Messages, missing files and completion know of it.
    with pytest.raises(UnsupportedSource, match=r"give text, BRF, .*PDF or RTF"):
        TextSource.of_bytes(b"%!PS")
    assert "lost.rtf: no such file" in dotwave("text", "lost.rtf").err
    monkeypatch.chdir(tmp_path)
    assert completed_texts()("fi") == ["file.rtf"]


def test_endings_of_texts_that_are_missing_are_paths(dotwave):
    for suffix in text_suffixes():
        assert f"lost{suffix}: no such file" in dotwave("text", f"lost{suffix}").err


def test_errors_share_a_root_and_a_builtin():
    assert issubclass(InvalidText, EncodeError)
    assert issubclass(InvalidText, ValueError)
