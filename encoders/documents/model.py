"""The one form all documents take: blocks (a heading, a paragraph ...) made of runs of text with their emphasis."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import IntFlag, StrEnum
from typing import NamedTuple

__all__ = ["Block", "BlockKind", "Document", "DocumentPlace", "EmbeddedImage", "Emphasis", "TextRun"]


class BlockKind(StrEnum):
    """What a block is; `verse` is a paragraph whose lines the source ends itself."""

    HEADING = "heading"
    PARAGRAPH = "paragraph"
    LIST_ITEM = "list-item"
    TABLE_ROW = "table-row"
    VERSE = "verse"
    MATH = "math"
    IMAGE = "image"


class Emphasis(IntFlag):
    """How text stands out; the bits are those of liblouis (its typeforms)."""

    NONE = 0
    ITALIC = 1
    UNDERLINE = 2
    BOLD = 4


class DocumentPlace(NamedTuple):
    """Where something stands in a document.

    Attributes
    ----------
    part : file in an archive, page of a PDF, and so on; empty where the document has no parts.
    line : in that part, from 1; 0 where there are no lines.
    """

    part: str = ""
    line: int = 0

    def __str__(self) -> str:
        return ", ".join(filter(None, (self.part, f"line {self.line}" if self.line else "")))


NOWHERE = DocumentPlace()


@dataclass(frozen=True)
class EmbeddedImage:
    """A picture in a document.

    Attributes
    ----------
    name : as the document calls it.
    load : gives the bytes of its file; raises UnsupportedSource. None where they are not in the document.
    """

    name: str
    load: Callable[[], bytes] | None = None


@dataclass(frozen=True)
class TextRun:
    """Text of one emphasis.

    Attributes
    ----------
    text : its characters; of an image its alternative text, of a formula what its element says in words.
    emphasis : how it stands out.
    place : where it begins.
    mathml : the formula, when it is one.
    image : the picture, when it is one.
    """

    text: str
    emphasis: Emphasis = Emphasis.NONE
    place: DocumentPlace = NOWHERE
    mathml: str = ""
    image: EmbeddedImage | None = None


@dataclass(frozen=True)
class Block:
    """A heading, a paragraph and so on.

    Attributes
    ----------
    kind : what it is.
    runs : in reading order.
    level : of a heading 1 to 6, of a list item how many lists it stands in; else 0.
    """

    kind: BlockKind
    runs: tuple[TextRun, ...]
    level: int = 0

    @property
    def text(self) -> str:
        """All characters of its runs."""
        return "".join(run.text for run in self.runs)


@dataclass(frozen=True)
class Document:
    """What a file holds.

    Attributes
    ----------
    blocks : in reading order.
    notes : sentences for the person who reads it, such as that the order of a PDF is a guess.
    """

    blocks: tuple[Block, ...]
    notes: tuple[str, ...] = ()
