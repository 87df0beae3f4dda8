"""One cell for each character, as screen readers count: a computer table of liblouis, asked once a character."""

from __future__ import annotations

import unicodedata
from functools import lru_cache

from encoders import cell_to_bits, resolve_tables, translate

from .window import BLANK_CELL, CellsOf

__all__ = ["COMPUTER_TABLE", "UNKNOWN", "glyphs"]

COMPUTER_TABLE = "en-us-comp8.ctb"
UNKNOWN = 0xFF
"""All dots, for a character that no cell stands for."""
_MOST_KEPT = 4096


def glyphs(table: str = COMPUTER_TABLE) -> CellsOf:
    """A function from characters to cells by a computer table; Unicode Braille stays as it is.

    A character that has no cell of its own gets that of its letter without marks.

    Raises
    ------
    encoders.EncodeError
        When the table cannot be used.
    """
    tables = resolve_tables(table)

    @lru_cache(maxsize=_MOST_KEPT)
    def cell(char: str) -> int:
        if BLANK_CELL <= ord(char) <= BLANK_CELL + 0xFF:
            return ord(char) - BLANK_CELL
        if char.isspace() or unicodedata.category(char) in ("Cc", "Cs"):
            return 0
        found = translate(tables, char).cells
        if len(found) == 1:
            return cell_to_bits(found)
        plain = unicodedata.normalize("NFKD", char)[0]
        return UNKNOWN if plain == char else cell(plain)

    return lambda text: bytes(map(cell, text))
