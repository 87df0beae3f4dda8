"""The formats there are, and by which ending or first bytes a file is known as one, or as another kind."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING

from ...errors import InvalidText, UnsupportedSource

if TYPE_CHECKING:
    from ...documents.model import Document

__all__ = ["READERS", "Reader", "check_suffix", "reader_of", "text_suffixes"]

HEAD = 256


@dataclass(frozen=True)
class Reader:
    """A format of texts or documents.

    Attributes
    ----------
    name : as a person is told to give it.
    suffixes : endings of its files, in lower case.
    place : ``module:function`` of the one that turns a file's bytes into characters, cells for Braille, or a
        `encoders.Document`, or raises InvalidText with a place; loaded when a file is read.
    begins : first bytes its files are known by, if any; of markup in lower case, without white space before.
    holds : bytes of which one is in its files too, if any.
    encodable : whether the function takes the name of an encoding after the bytes; others say their own.
    """

    name: str
    suffixes: tuple[str, ...]
    place: str
    begins: tuple[bytes, ...] = ()
    holds: tuple[bytes, ...] = ()
    encodable: bool = False

    def read(self, data: bytes, encoding: str | None = None) -> str | Document:
        """What is in a file's bytes; raises InvalidText, UnsupportedSource, DocumentsMissing."""
        if encoding is not None and not self.encodable:
            raise InvalidText(f"{self.name} says its encoding itself; leave --encoding out")
        module, function = self.place.split(":")
        given = (data, encoding) if self.encodable else (data,)
        found: str | Document = getattr(import_module(module), function)(*given)
        return found

    def knows(self, data: bytes) -> bool:
        """Whether a file is of this format, by its bytes."""
        begins = data.startswith(self.begins) or _head(data).startswith(self.begins)
        return begins and (not self.holds or any(some in data for some in self.holds))


_ENCODERS = __package__.rpartition(".braille")[0]
_DOCUMENTS = f"{_ENCODERS}.documents"
_ZIP = (b"PK\x03\x04",)
READERS: tuple[Reader, ...] = (
    Reader("text", (".txt",), f"{_ENCODERS}.characters:decoded", encodable=True),
    Reader("BRF", (".brf", ".brl"), f"{__package__}.brf:brf_to_cells"),
    Reader("PEF", (".pef",), f"{_DOCUMENTS}.pef:read_pef", (b"<?xml", b"<pef"), (b"<pef", b":pef")),
    Reader("Markdown", (".md", ".markdown"), f"{_DOCUMENTS}.markdown:read_markdown", encodable=True),
    Reader("HTML", (".html", ".htm"), f"{_DOCUMENTS}.html:read_html", (b"<!doctype html", b"<html"), encodable=True),
    Reader(
        "EPUB", (".epub",), f"{_DOCUMENTS}.epub:read_epub", _ZIP, (b"application/epub+zip", b"META-INF/container.xml")
    ),
    Reader("eBraille", (".ebrl",), f"{_DOCUMENTS}.ebraille:read_ebraille", _ZIP, (b"package.opf",)),
    Reader("DOCX", (".docx",), f"{_DOCUMENTS}.docx:read_docx", _ZIP, (b"word/document.xml",)),
    Reader("ODT", (".odt",), f"{_DOCUMENTS}.odt:read_odt", _ZIP, (b"application/vnd.oasis.opendocument.text",)),
    Reader(
        "DAISY",
        (".xml", ".zip"),
        f"{_DOCUMENTS}.daisy:read_daisy",
        (b"<?xml", b"<dtbook", *_ZIP),
        (b"<dtbook", b".opf", b"ncc.html"),
    ),
    Reader("PDF", (".pdf",), f"{_DOCUMENTS}.pdf:read_pdf", (b"%PDF",)),
    Reader("HTML", (".xhtml",), f"{_DOCUMENTS}.html:read_html", (b"<?xml",), (b"<html",), encodable=True),
)
"""All of them; the first reads what no other is known by."""


def text_suffixes() -> tuple[str, ...]:
    """Endings of all text formats."""
    return tuple(suffix for reader in READERS for suffix in reader.suffixes)


def check_suffix(suffix: str, name: str) -> None:
    """Refuse a file by its ending, in lower case, before it is read.

    Raises
    ------
    UnsupportedSource
        When it is that of another kind.
    """
    if suffix in _SUFFIXES and suffix not in text_suffixes():
        raise UnsupportedSource(f"{name}: {_SUFFIXES[suffix]} is not read; {_give()}")


def reader_of(data: bytes, suffix: str, name: str) -> Reader:
    """The reader for a file's bytes: known by how they begin, else by the ending ('' for none), else the first.

    Raises
    ------
    UnsupportedSource
        When the bytes are of another known kind (an old Office document, an archive, a picture ...).
    """
    ending = [reader for reader in READERS if suffix in reader.suffixes]
    known = [reader for reader in (*ending, *READERS) if reader.knows(data)]
    # Packed otherwise than usual, but as it is called.
    likely = [reader for reader in ending if data.startswith(reader.begins)]
    other = "" if known or likely else _sniff(data)
    if other:
        raise UnsupportedSource(f"{name}: this is {other}; {_give()}")
    return (*known, *likely, *ending, READERS[0])[0]


def _give() -> str:
    names = list(dict.fromkeys(reader.name for reader in READERS))
    return f"give {', '.join(names[:-1])} or {names[-1]}"


_MAGIC = (
    (b"%!PS", "PostScript"),
    (b"PK\x03\x04", "a zip archive that is no EPUB, eBraille, DOCX, ODT or DAISY"),
    (b"{\\rtf", "RTF"),
    (b"\xd0\xcf\x11\xe0", "an old Office document"),
    (b"\x89PNG", "a PNG picture"),
    (b"\xff\xd8\xff", "a JPEG picture"),
    (b"GIF8", "a GIF picture"),
    (b"II*\0", "a TIFF picture"),
    (b"MM\0*", "a TIFF picture"),
    (b"RIFF", "a RIFF file (WAV, WEBP)"),
    (b"\x1f\x8b", "a gzip archive"),
    (b"BZh", "a bzip2 archive"),
    (b"7z\xbc\xaf", "a 7z archive"),
    (b"\x7fELF", "a program"),
)
_MARKUP = ((b"<svg", "an SVG picture"), (b"<?xml", "XML that is no PEF, DAISY or XHTML"))

_SUFFIXES = {
    ".ps": "PostScript", ".doc": "DOC", ".rtf": "RTF", ".png": "a PNG picture", ".jpg": "a JPEG picture",
    ".jpeg": "a JPEG picture", ".gif": "a GIF picture", ".bmp": "a BMP picture", ".tif": "a TIFF picture",
    ".tiff": "a TIFF picture", ".webp": "a WEBP picture", ".svg": "an SVG picture", ".gz": "a gzip archive",
}  # fmt: skip


def _head(data: bytes) -> bytes:
    return data[:HEAD].removeprefix(b"\xef\xbb\xbf").lstrip().lower()


def _sniff(data: bytes) -> str:
    for magic, kind in _MAGIC:
        if data.startswith(magic):
            return kind
    return next((kind for magic, kind in _MARKUP if _head(data).startswith(magic)), "")
