"""What is to be encoded, checked: from characters, a document, bytes, a file or a stream."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

from ...choices import Mathematics
from ...errors import DocumentsMissing, EmptyText, InvalidText, UnsupportedSource

if TYPE_CHECKING:
    from ...documents.flat import FlatDocument
    from ...documents.model import Document

__all__ = ["SourceKind", "TextSource"]


# A thick book has some megabytes; one with pictures more.
MAX_BYTES = 64_000_000


class SourceKind(StrEnum):
    """What the characters of a source are."""

    TEXT = "text"
    BRAILLE = "braille"


@dataclass(frozen=True)
class TextSource:
    """Checked input; build it with `of_text`, `of_document`, `of_bytes`, `of_path` or `of_stream`.

    Attributes
    ----------
    text : the characters, without byte order mark, lines ended by a newline, pages by a form feed. For
        Braille these are cells U+2800..U+28FF. All positions in frames and reports count in it.
    kind : text or Braille.
    name : how the source is called in messages.
    document : where in `text` its blocks, emphases and pictures are; None of a plain text.
    emphases : (start, end, emphasis) of what is written with indicators, in order; see `encoders.Emphasis`.
    follows : of a part that begins inside a paragraph, the white space before it, at least a blank; else empty.
    """

    text: str
    kind: SourceKind
    name: str
    document: FlatDocument | None = None
    emphases: tuple[tuple[int, int, int], ...] = ()
    follows: str = ""

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
    def of_document(
        cls, document: Document, name: str = "document", *, math: Mathematics = Mathematics.NEMETH
    ) -> TextSource:
        """A source from the blocks of a document; what stands in `text` for formulas is chosen by `math`.

        Raises
        ------
        EmptyText, InvalidText
            As `of_text` does.
        DocumentsMissing
            When there are formulas, and no converter of them.
        """
        from ...documents.flat import flattened
        from ...documents.maths import formula_writer

        flat = flattened(document, formula_writer(math))
        plain = cls.of_text(flat.text, name)
        if len(plain.text) != len(flat.text):
            raise InvalidText(f"{name}: {flat.place_at(0)}: a carriage return or a byte order mark in its text")
        return cls(plain.text, plain.kind, name, flat)

    @classmethod
    def of_bytes(
        cls,
        data: bytes,
        name: str = "text",
        *,
        suffix: str = "",
        encoding: str | None = None,
        math: Mathematics = Mathematics.NEMETH,
    ) -> TextSource:
        """A source from the bytes of a file, by `readers.formats`.

        Parameters
        ----------
        data : the bytes.
        name : how the source is called in messages.
        suffix : ending of the file, such as ``.brf``; '' for none.
        encoding : of its characters, before what it says itself; None for UTF-8 where it says nothing.
        math : what becomes of formulas.

        Raises
        ------
        UnsupportedSource
            When the bytes are of another known kind (an archive, a picture ...), or too many.
        InvalidText
            With the place of what is broken: an offset in bytes, or a part and a line.
        EmptyText
            When there is nothing to show.
        DocumentsMissing
            When a library that reads such files is not installed.
        """
        from .formats import reader_of

        reader = reader_of(data, suffix, name)
        try:
            found = reader.read(data, encoding)
            if isinstance(found, str):
                return cls.of_text(found, name)
            return cls.of_document(found, name, math=math)
        except (InvalidText, UnsupportedSource, DocumentsMissing) as error:
            said = str(error)
            raise type(error)(said if said.startswith(f"{name}: ") else f"{name}: {said}") from None

    @classmethod
    def of_path(cls, path: Path, *, encoding: str | None = None, math: Mathematics = Mathematics.NEMETH) -> TextSource:
        """A source from a file.

        Raises
        ------
        UnsupportedSource, InvalidText, EmptyText, DocumentsMissing
            As `of_bytes` does; also when the suffix says another kind, or the file cannot be read.
        """
        # Imported here, as below: words that are given as such do without.
        from ...reading import first_bytes
        from .formats import check_suffix

        suffix = path.suffix.lower()
        check_suffix(suffix, str(path))
        try:
            data = first_bytes(path, MAX_BYTES + 1)
        except (OSError, ValueError) as error:
            raise UnsupportedSource(f"{path}: cannot be read: {getattr(error, 'strerror', None) or error}") from None
        _check_size(data, str(path))
        source = cls.of_bytes(data, str(path), suffix=suffix, encoding=encoding, math=math)
        return replace(source, document=source.document and source.document.beside(path.parent))

    @classmethod
    def of_stream(
        cls,
        stream: BinaryIO,
        name: str = "standard input",
        *,
        suffix: str = "",
        encoding: str | None = None,
        math: Mathematics = Mathematics.NEMETH,
    ) -> TextSource:
        """A source from a binary stream, read once to its end, which comes within 64 MB; raises as `of_bytes` does."""
        try:
            data = stream.read(MAX_BYTES + 1)
        except OSError as error:
            raise UnsupportedSource(f"{name}: cannot be read: {error.strerror or error}") from None
        _check_size(data, name)
        return cls.of_bytes(data, name, suffix=suffix, encoding=encoding, math=math)

    @property
    def notes(self) -> tuple[str, ...]:
        """Sentences on how it was read, for the person who reads it."""
        return self.document.notes if self.document else ()

    def part(self, start: int, end: int) -> TextSource:
        """The characters from `start` to `end` as a source of their own; positions count from `start`.

        Raises
        ------
        EmptyText
            When there is nothing but white space.
        """
        text = self.text[start:end]
        if not text.replace("\u2800", " ").strip():
            raise EmptyText(f"{self.name}: there is nothing to show in characters {start} to {end}")
        head = self.text[:start].rstrip()
        space = (self.text[len(head) : start] or " ") + text[: len(text) - len(text.lstrip())]
        follows = space if head and not _APART.search(space) else "" if head else self.follows
        document = self.document and self.document.part(start, end)
        return replace(self, text=text, document=document, emphases=(), follows=follows)


def _check_size(data: bytes, name: str) -> None:
    """Refuse the first bytes of something that are one more than may be."""
    if len(data) > MAX_BYTES:
        raise UnsupportedSource(f"{name}: more than {MAX_BYTES} bytes; give it in parts (is this really a text?)")


_APART = re.compile("\n[^\\S\n]*\n|[\f\u2029]")
_SURROGATE = re.compile("[\ud800-\udfff]")
_NOT_BRAILLE = re.compile("[^\u2800-\u28ff\\s]")
