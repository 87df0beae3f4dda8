"""What every bridge has in common: a window of cells comes in, a key goes out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum

__all__ = ["BLANK_CELL", "BrailleWindow", "CellsOf", "Key", "KeyName", "braille_of", "cells_of_braille"]

BLANK_CELL = 0x2800

CellsOf = Callable[[str], bytes]
"""Characters to cells, one for each: bit 0 of a byte is dot 1."""


@dataclass(frozen=True, slots=True)
class BrailleWindow:
    """What a screen reader wants to be felt now.

    Attributes
    ----------
    cells : a byte a cell in reading order, bit 0 is dot 1 (ISO 11548-1).
    text : the characters, as far as they are known; one a cell.
    cursor : cell with the cursor, from 0; None without one. It is not in the cells.
    note : who wrote it.
    """

    cells: bytes
    text: str = ""
    cursor: int | None = None
    note: str = ""

    @property
    def braille(self) -> str:
        """The cells as Unicode Braille."""
        return braille_of(self.cells)


class KeyName(StrEnum):
    """What a key beside the grid asks for."""

    PREVIOUS = "previous"
    NEXT = "next"
    UP = "up"
    DOWN = "down"
    HOME = "home"
    TOP = "top"
    BOTTOM = "bottom"
    ROUTE = "route"


@dataclass(frozen=True, slots=True)
class Key:
    """A key that was pressed.

    Attributes
    ----------
    name : what it asks for.
    cell : of a routing key, from 0.
    """

    name: KeyName
    cell: int = 0

    def __str__(self) -> str:
        return f"{self.name} {self.cell}" if self.name is KeyName.ROUTE else str(self.name)

    @classmethod
    def of(cls, words: str) -> Key:
        """The key that words such as ``next`` or ``route 3`` name.

        Raises
        ------
        ValueError
            When they name none.
        """
        name, *rest = words.split() or [""]
        known = list(map(str, KeyName))
        if name not in known or len(rest) != (name == KeyName.ROUTE) or not all(n.isdecimal() for n in rest):
            wanted = ", ".join(known[:-1])
            raise ValueError(f"expected one of {wanted}, or route and a cell from 0, got {words[:60]!r}")
        return cls(KeyName(name), int(rest[0][:9]) if rest else 0)


def braille_of(cells: bytes) -> str:
    """Cells as Unicode Braille."""
    return "".join(chr(BLANK_CELL + bits) for bits in cells)


def cells_of_braille(braille: str) -> bytes:
    """The other way round.

    Raises
    ------
    ValueError
        When a character is not of U+2800..U+28FF.
    """
    codes = [ord(char) - BLANK_CELL for char in braille]
    return bytes(codes)
