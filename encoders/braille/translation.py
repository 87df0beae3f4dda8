"""Text to cells by liblouis, to the end of the text and with cells in it kept as they are."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from ..errors import TableMissing
from . import louis_binding

__all__ = ["Translation", "translate", "translated"]

_BRAILLE_RUN = re.compile("([\u2801-\u28ff]+)")


@dataclass(frozen=True)
class Translation:
    """Cells of a text, with positions both ways.

    Attributes
    ----------
    cells : Unicode Braille, a blank is U+2800.
    text_of_cell : for each cell the position of the character it comes from, never falling.
    cell_of_text : for each character the position of its first cell (or the cell it is contracted into).
    """

    cells: str
    text_of_cell: tuple[int, ...]
    cell_of_text: tuple[int, ...]


def translate(tables: tuple[str, ...], text: str) -> Translation:
    """Cells of `text`; Unicode Braille in it passes through, whatever the table says of it.

    Raises
    ------
    TableMissing
        When the tables cannot be used.
    """
    cells, text_of_cell, cell_of_text = translated(tables, text)
    last = 0
    repaired = []
    for position in cell_of_text:  # the library leaves -1 where a character has no cell of its own
        last = position if position >= 0 else last
        repaired.append(last)
    return Translation(cells, tuple(text_of_cell), tuple(repaired))


def translated(
    tables: tuple[str, ...], text: str, emphases: Sequence[int] | None = None
) -> tuple[str, list[int], list[int]]:
    """Cells of `text`, the text position of each cell, the cell position of each character (-1: none of its own).

    `emphases` has the emphasis of each character, None where nothing stands out.
    """
    if not _BRAILLE_RUN.search(text):
        return _complete(tables, text, emphases)
    cells, text_of_cell, cell_of_text = "", list[int](), list[int]()
    at = 0
    for part in _BRAILLE_RUN.split(text):
        if not part:
            continue
        if _BRAILLE_RUN.match(part):
            some, back, forth = part, list(range(len(part))), list(range(len(part)))
        else:
            some, back, forth = _complete(tables, part, emphases and emphases[at : at + len(part)])
        text_of_cell += [at + position for position in back]
        cell_of_text += [len(cells) + position if position >= 0 else -1 for position in forth]
        cells += some
        at += len(part)
    return cells, text_of_cell, cell_of_text


def _complete(
    tables: tuple[str, ...], text: str, emphases: Sequence[int] | None = None
) -> tuple[str, list[int], list[int]]:
    """As the library does it, but to the end of the text also where it stops early."""

    def given(start: int) -> list[int] | None:
        # Without emphasis it is told of none: zeros are not the same to old tables.
        return list(emphases[start:]) if emphases and any(emphases[start:]) else None

    try:
        cells, text_of_cell, cell_of_text = louis_binding.translate(tables, text, given(0))
        while len(cell_of_text) < len(text):
            done = len(cell_of_text)
            more, back, forth = louis_binding.translate(tables, text[done:], given(done))
            if not forth:
                raise TableMissing(f"table {','.join(tables)}: stops at {text[done : done + 20]!r}; choose another")
            text_of_cell += [done + position for position in back]
            cell_of_text += [len(cells) + position if position >= 0 else -1 for position in forth]
            cells += more
    except RuntimeError:
        why = louis_binding.complaint() or "unknown reason"
        raise TableMissing(f"table {','.join(tables)}: cannot translate: {why}") from None
    last = 0
    for index, position in enumerate(text_of_cell):
        if position < last:
            text_of_cell[index] = last
        else:
            last = position
    return cells, text_of_cell, cell_of_text
