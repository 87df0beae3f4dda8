"""What a person chooses of a text; light to import, so that a command line can list it."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from .errors import LayoutError

__all__ = [
    "EmphasisChoice", "Grade", "ImageChoice", "LineEnds", "Mathematics", "PageNumbering", "Presentation",
    "TextOptions", "Undefined",
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
    all cells dot 1, then dot 2, and so on. Parts without a dot are left out. ``scroll``: the text moves to the left
    in one line, column by column, under a finger that is still.
    """

    TOGETHER = "together"
    BY_ROW = "by-row"
    BY_DOT = "by-dot"
    SCROLL = "scroll"


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


_CHOICES: dict[str, type[StrEnum]] = {
    "undefined": Undefined, "presentation": Presentation, "emphasis": EmphasisChoice, "images": ImageChoice,
    "math": Mathematics, "lines": LineEnds, "page_numbers": PageNumbering,
}  # fmt: skip


@dataclass(frozen=True)
class TextOptions:
    """How a text is encoded.

    Attributes
    ----------
    table : translation table: a file name, a comma list, or a query such as ``language:de grade:2``.
    undefined : what becomes of characters the table cannot write.
    cell_gap, line_gap : actuators left free between cells and between lines.
    rate : cells per second; a page lasts (cells up to its last one) / rate, but at least 1 s or, where that is
        less, (cells it has room for) / rate. None means 6: 1 s for 3 x 2 cells.
    dwell_s : seconds a page lasts, instead of `rate`. Shown in parts, a page gives each part an equal share,
        but at least 0.6 s; it then lasts longer.
    presentation : dots together, by row, or by dot, or a text that scrolls. None: together, and whoever plans it may
        take another. A text that scrolls has a rate (None means 1 cell in a second), no `dwell_s` and no page numbers,
        and at least one free column between cells.
    blank_between : a blank frame between paragraphs.
    dots : 6, 8, or None: 8 for an 8-dot table on a grid whose rows make cells of four, else 6.
    emphasis : whether emphasis of documents is written; None for lines of 12 cells or more.
    images : whether images of documents are words or pictures; pictures are for `dotwave.text`, here they are words.
    math : how formulas of documents are written, where a file is read.
    encoding : of the characters of a file that is read; None for what it says itself, else UTF-8.
    start_at : a page from 1, the words of a heading, or words of the text, at which to begin.
    pages : such as ``10-20``, counted from there.
    lines : whether single line ends begin a line of the grid; None where they do by `encoders.braille.lines`.
    page_numbers : where the number of a page is felt, counted from `start_at` and `pages` on.

    A choice may be given as its word.

    Raises
    ------
    LayoutError
        When a word is not one of its choices.
    """

    table: str = "en-ueb-g2.ctb"
    undefined: Undefined = Undefined.NAME
    cell_gap: int = 0
    line_gap: int = 0
    rate: float | None = None
    dwell_s: float | None = None
    presentation: Presentation | None = None
    blank_between: bool = False
    dots: int | None = None
    emphasis: EmphasisChoice | None = None
    images: ImageChoice = ImageChoice.WORDS
    math: Mathematics = Mathematics.NEMETH
    encoding: str | None = None
    start_at: str | int | None = None
    pages: str | int | None = None
    lines: LineEnds | None = None
    page_numbers: PageNumbering = PageNumbering.NONE

    def __post_init__(self) -> None:
        for name, kind in _CHOICES.items():
            given = getattr(self, name)
            if given is None and name in ("emphasis", "lines", "presentation"):
                continue
            if given not in list(kind):
                raise LayoutError(f"{name}: expected one of {', '.join(kind)}, got {given!r}")
            object.__setattr__(self, name, kind(given))
