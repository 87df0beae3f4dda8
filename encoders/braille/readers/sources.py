"""What is to be encoded, checked: from characters, bytes, a file or a stream."""

from __future__ import annotations

import re
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import BinaryIO

from ...errors import EmptyText, InvalidText, UnsupportedSource
from ...reading import first_bytes
from .formats import MAX_BYTES, check_suffix, reader_of

__all__ = ["SourceKind", "TextSource"]


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
    def of_bytes(cls, data: bytes, name: str = "text", *, suffix: str = "") -> TextSource:
        """A source from the bytes of a file with this ending (such as ``.brf``; '' for none), by `readers.formats`.

        Raises
        ------
        UnsupportedSource
            When the bytes are of another known kind (PDF, archive, picture, UTF-16 ...).
        InvalidText
            With the offset of the first byte that is not UTF-8 (or not ASCII Braille), or of a NUL.
        EmptyText
            When there is nothing to show.
        """
        reader = reader_of(data, suffix, name)
        try:
            text = reader.read(data)
        except InvalidText as error:
            raise InvalidText(f"{name}: {error}") from None
        return cls.of_text(text, name)

    @classmethod
    def of_path(cls, path: Path) -> TextSource:
        """A source from a file.

        Raises
        ------
        UnsupportedSource, InvalidText, EmptyText
            As `of_bytes` does; also when the suffix says another kind, or the file cannot be read.
        """
        suffix = path.suffix.lower()
        check_suffix(suffix, str(path))
        try:
            data = first_bytes(path, MAX_BYTES + 1)
        except (OSError, ValueError) as error:
            raise UnsupportedSource(f"{path}: cannot be read: {getattr(error, 'strerror', None) or error}") from None
        return cls._of_first(data, str(path), suffix)

    @classmethod
    def of_stream(cls, stream: BinaryIO, name: str = "standard input", *, suffix: str = "") -> TextSource:
        """A source from a binary stream, read once to its end, which comes within 64 MB; raises as `of_bytes` does."""
        try:
            data = stream.read(MAX_BYTES + 1)
        except OSError as error:
            raise UnsupportedSource(f"{name}: cannot be read: {error.strerror or error}") from None
        return cls._of_first(data, name, suffix)

    @classmethod
    def _of_first(cls, data: bytes, name: str, suffix: str) -> TextSource:
        """A source from the first bytes of something, which are one more than may be when it is too long."""
        if len(data) > MAX_BYTES:
            raise UnsupportedSource(f"{name}: more than {MAX_BYTES} bytes; give it in parts (is this really a text?)")
        return cls.of_bytes(data, name, suffix=suffix)


_SURROGATE = re.compile("[\ud800-\udfff]")
_NOT_BRAILLE = re.compile("[^\u2800-\u28ff\\s]")
