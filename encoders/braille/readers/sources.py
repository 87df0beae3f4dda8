"""Reading what is to be encoded: UTF-8 text, Unicode Braille or BRF; everything else is refused by name."""

from __future__ import annotations

import re
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import BinaryIO

from ...errors import EmptyText, InvalidText, UnsupportedSource
from ...reading import first_bytes
from .brf import brf_to_cells

__all__ = ["SourceKind", "TextSource"]

# A thick book has some megabytes.
MAX_BYTES = 64_000_000


class SourceKind(StrEnum):
    """What the characters of a source are."""

    TEXT = "text"
    BRAILLE = "braille"


@dataclass(frozen=True)
class TextSource:
    """Checked input; build it with `of_text`, `of_bytes`, `of_path` or `of_stream`.

    Attributes
    ----------
    text : the characters, without byte order mark, lines ended by a newline, pages by a form feed. For
        Braille these are cells U+2800..U+28FF. All positions in frames and reports count in it.
    kind : text or Braille.
    name : how the source is called in messages.
    """

    text: str
    kind: SourceKind
    name: str

    @classmethod
    def of_text(cls, text: str, name: str = "text") -> TextSource:
        """A source from characters.

        Raises
        ------
        EmptyText
            When there is nothing but white space.
        InvalidText
            When there is a NUL or half a surrogate pair, with its place.
        """
        lines = text.removeprefix("\ufeff")
        if "\r" in lines:
            lines = lines.replace("\r\n", "\n").replace("\r", "\n")
        if not lines.strip():
            raise EmptyText(f"{name}: the text is empty; give at least one character that can be written")
        nul = lines.find("\0")
        if nul >= 0:
            raise InvalidText(f"{name}: a NUL character at character {nul}; remove it (is this really a text?)")
        half = _SURROGATE.search(lines)
        if half:
            raise InvalidText(f"{name}: character {half.start()} is half a surrogate pair; give valid UTF-8 text")
        kind = SourceKind.TEXT if _NOT_BRAILLE.search(lines) else SourceKind.BRAILLE
        if kind is SourceKind.BRAILLE and not lines.replace("\u2800", " ").strip():
            raise EmptyText(f"{name}: the Braille has blank cells only; give at least one cell with a dot")
        return cls(lines, kind, name)

    @classmethod
    def of_bytes(cls, data: bytes, name: str = "text", *, brf: bool = False) -> TextSource:
        """A source from the bytes of a file: UTF-8, or ASCII Braille when `brf`.

        Raises
        ------
        UnsupportedSource
            When the bytes are of another known kind (PDF, archive, picture, UTF-16 ...).
        InvalidText
            With the offset of the first byte that is not UTF-8 (or not ASCII Braille), or of a NUL.
        EmptyText
            When there is nothing to show.
        """
        known = _sniff(data)
        if known:
            raise UnsupportedSource(f"{name}: this is {known}; {_READ}")
        nul = data.find(b"\0")
        if nul >= 0:
            raise InvalidText(f"{name}: a NUL byte at byte {nul}; remove it (is this really a text?)")
        try:
            text = brf_to_cells(data) if brf else data.decode("utf-8")
        except UnicodeDecodeError as error:
            bad = data[error.start]
            raise InvalidText(f"{name}: not UTF-8 at byte {error.start} (0x{bad:02x}); save it as UTF-8") from None
        except InvalidText as error:
            raise InvalidText(f"{name}: {error}") from None
        return cls.of_text(text, name)

    @classmethod
    def of_path(cls, path: Path) -> TextSource:
        """A source from a file; ``.brf`` and ``.brl`` are ASCII Braille.

        Raises
        ------
        UnsupportedSource, InvalidText, EmptyText
            As `of_bytes` does; also when the suffix says another kind, or the file cannot be read.
        """
        suffix = path.suffix.lower()
        if suffix in _SUFFIXES:
            raise UnsupportedSource(f"{path}: {_SUFFIXES[suffix]} is not read; {_READ}")
        try:
            data = first_bytes(path, MAX_BYTES + 1)
        except (OSError, ValueError) as error:
            raise UnsupportedSource(f"{path}: cannot be read: {getattr(error, 'strerror', None) or error}") from None
        return cls._of_first(data, str(path), brf=suffix in {".brf", ".brl"})

    @classmethod
    def of_stream(cls, stream: BinaryIO, name: str = "standard input", *, brf: bool = False) -> TextSource:
        """A source from a binary stream, read once to its end, which comes within 64 MB; raises as `of_bytes` does."""
        try:
            data = stream.read(MAX_BYTES + 1)
        except OSError as error:
            raise UnsupportedSource(f"{name}: cannot be read: {error.strerror or error}") from None
        return cls._of_first(data, name, brf=brf)

    @classmethod
    def _of_first(cls, data: bytes, name: str, *, brf: bool) -> TextSource:
        """A source from the first bytes of something, which are one more than may be when it is too long."""
        if len(data) > MAX_BYTES:
            raise UnsupportedSource(f"{name}: more than {MAX_BYTES} bytes; give it in parts (is this really a text?)")
        return cls.of_bytes(data, name, brf=brf)


_READ = "give UTF-8 text, Unicode Braille or a BRF file"
_SURROGATE = re.compile("[\ud800-\udfff]")
_NOT_BRAILLE = re.compile("[^\u2800-\u28ff\\s]")

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
