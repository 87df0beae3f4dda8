"""What a person chooses of a text by a word; light to import, so that a command line can list it."""

from __future__ import annotations

from enum import StrEnum

__all__ = ["Grade", "Presentation", "Undefined"]


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
