"""ASCII Braille (BRF): one byte a cell, form feeds between pages."""

from __future__ import annotations

from ...errors import InvalidText

__all__ = ["brf_to_cells", "cells_to_brf"]

# North American ASCII Braille: the character at index b is the cell with bits b.
ASCII_BRAILLE = " A1B'K2L@CIF/MSP\"E3H9O6R^DJG>NTQ,*5<-U8V.%[$+X!&;:4\\0Z7(_?W]#Y)="

_TO_CELL = {ord(char): 0x2800 + bits for bits, char in enumerate(ASCII_BRAILLE)}
_TO_CELL |= {lower: _TO_CELL[lower - 32] for lower in range(0x60, 0x7F)}
_LAYOUT = {ord(char): ord(char) for char in "\n\f"}
_TO_ASCII = {0x2800 + bits: ord(char) for bits, char in enumerate(ASCII_BRAILLE)} | _LAYOUT


def brf_to_cells(data: bytes) -> str:
    """Cells of a BRF file, one character for each byte; line ends become newlines, form feeds stay.

    Lower case is read as upper case. A control-Z at the end (from DOS) and carriage returns are left out.

    Raises
    ------
    InvalidText
        With the offset of the first byte that is not ASCII Braille.
    """
    text = data.rstrip(b"\x1a").decode("latin-1")
    for offset, char in enumerate(text) if not set(text) <= _READABLE else ():
        if char not in _READABLE:
            raise InvalidText(
                f"not ASCII Braille at byte {offset} (0x{ord(char):02x}); a BRF file holds bytes 0x20..0x7e, "
                "line ends and form feeds"
            )
    return text.replace("\r\n", "\n").replace("\r", "\n").replace("\t", " ").translate(_TO_CELL | _LAYOUT)


_READABLE = {chr(code) for code in (*_TO_CELL, *b"\t\n\f\r")}


def cells_to_brf(cells: str) -> bytes:
    """BRF bytes of Unicode Braille with newlines and form feeds.

    Raises
    ------
    InvalidText
        When a character is neither a six-dot cell nor a newline nor a form feed.
    """
    for offset, char in enumerate(cells):
        if ord(char) not in _TO_ASCII:
            raise InvalidText(f"not a six-dot cell at character {offset}: {char!r}; BRF has six dots only")
    return cells.translate(_TO_ASCII).encode("ascii")
