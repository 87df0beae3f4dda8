"""The text formats there are, and by which ending or first bytes a file is known as one, or as another kind."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module

from ...errors import UnsupportedSource

__all__ = ["MAX_BYTES", "READERS", "Reader", "check_suffix", "reader_of", "text_suffixes"]

# A thick book has some megabytes.
MAX_BYTES = 64_000_000


@dataclass(frozen=True)
class Reader:
    """A text format.

    Attributes
    ----------
    name : as a person is told to give it.
    suffixes : endings of its files, in lower case.
    place : ``module:function`` of the one that turns a file's bytes into characters, cells for Braille, or raises
        InvalidText with a place; loaded when a file is read.
    begins : first bytes its files are known by, if any.
    """

    name: str
    suffixes: tuple[str, ...]
    place: str
    begins: tuple[bytes, ...] = ()

    def read(self, data: bytes) -> str:
        """The characters in a file's bytes; raises InvalidText."""
        module, function = self.place.split(":")
        text: str = getattr(import_module(module), function)(data)
        return text


READERS: tuple[Reader, ...] = (
    Reader("UTF-8 text, Unicode Braille", (".txt",), f"{__package__}.utf8:utf8_to_text"),
    Reader("a BRF file", (".brf", ".brl"), f"{__package__}.brf:brf_to_cells"),
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
        When the bytes are of another known kind (PDF, archive, picture, UTF-16 ...).
    """
    ending = [reader for reader in READERS if suffix in reader.suffixes]
    known = [reader for reader in (*ending, *READERS) if data.startswith(reader.begins)]
    other = "" if known else _sniff(data)
    if other:
        raise UnsupportedSource(f"{name}: this is {other}; {_give()}")
    return (*known, *ending, READERS[0])[0]


def _give() -> str:
    names = [reader.name for reader in READERS]
    return f"give {', '.join(names[:-1])} or {names[-1]}"


_MAGIC = (
    (b"%PDF", "a PDF"),
    (b"%!PS", "PostScript"),
    (b"PK\x03\x04", "a zip archive (DOCX, ODT, EPUB and eBraille are such)"),
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
    (b"\xff\xfe\0\0", "UTF-32 text"),
    (b"\0\0\xfe\xff", "UTF-32 text"),
    (b"\xff\xfe", "UTF-16 text"),
    (b"\xfe\xff", "UTF-16 text"),
)
_MARKUP = ((b"<!doctype html", "HTML"), (b"<html", "HTML"), (b"<svg", "an SVG picture"), (b"<?xml", "XML"))

_SUFFIXES = {
    ".pdf": "PDF", ".ps": "PostScript", ".docx": "DOCX", ".doc": "DOC", ".odt": "ODT", ".rtf": "RTF",
    ".epub": "EPUB", ".ebrl": "eBraille", ".pef": "PEF", ".html": "HTML", ".htm": "HTML", ".xml": "XML",
    ".png": "a PNG picture", ".jpg": "a JPEG picture", ".jpeg": "a JPEG picture", ".gif": "a GIF picture",
    ".bmp": "a BMP picture", ".tif": "a TIFF picture", ".tiff": "a TIFF picture", ".webp": "a WEBP picture",
    ".svg": "an SVG picture", ".zip": "a zip archive", ".gz": "a gzip archive",
}  # fmt: skip


def _sniff(data: bytes) -> str:
    for magic, kind in _MAGIC:
        if data.startswith(magic):
            return kind
    start = data[:256].removeprefix(b"\xef\xbb\xbf").lstrip().lower()
    return next((kind for magic, kind in _MARKUP if start.startswith(magic)), "")
