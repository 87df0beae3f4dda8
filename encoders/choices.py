"""What a person chooses of a text by a word; light to import, so that a command line can list it."""

from __future__ import annotations

from enum import StrEnum

__all__ = [
    "EmphasisChoice", "Grade", "ImageChoice", "LineEnds", "Mathematics", "PageNumbering", "Presentation", "Undefined",
]  # fmt: skip


class Undefined(StrEnum):
    """What becomes of a character the table cannot write: its name in words, nothing, or an error."""

    NAME = "name"
    DROP = "drop"
    ERROR = "error"


class Grade(StrEnum):
    """Whether words are written sign by sign, or shortened by the rules of the language's Braille."""

    UNCONTRACTED = "uncontracted"
    CONTRACTED = "contracted"


class Presentation(StrEnum):
    """Order in which the dots of a page are shown.

    ``together``: all at once. ``by-row``: one row of the grid after another, from the top. ``by-dot``: in
    all cells dot 1, then dot 2, and so on. Parts without a dot are left out.
    """

    TOGETHER = "together"
    BY_ROW = "by-row"
    BY_DOT = "by-dot"


class EmphasisChoice(StrEnum):
    """Whether emphasis of a document (italic, bold, underlined) is written with the table's indicators."""

    KEEP = "keep"
    DROP = "drop"


class ImageChoice(StrEnum):
    """What is shown of the images in a document: the words they bring along, or their picture."""

    WORDS = "words"
    PICTURE = "picture"


class Mathematics(StrEnum):
    """How formulas of a document (MathML) are written: in Nemeth code by a converter, or in the words they bring."""

    NEMETH = "nemeth"
    WORDS = "words"


class LineEnds(StrEnum):
    """What becomes of single line ends of a text: a new line begins there too, or the words run on."""

    KEEP = "keep"
    JOIN = "join"


class PageNumbering(StrEnum):
    """Where the number of a page is felt.

    ``none``: nowhere. ``corner``: in the last cells of the page; on lines of fewer than 12 cells in the last cell
    alone, by its last digit. ``frame``: in a frame of its own before the page, with the number of pages.
    """

    NONE = "none"
    CORNER = "corner"
    FRAME = "frame"
