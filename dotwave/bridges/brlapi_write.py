"""What one BrlAPI client has written: texts, masks and cursor, region by region, as BRLTTY's server keeps them."""

from __future__ import annotations

import struct

from .brlapi_packets import BrlapiCode, BrlapiRefused
from .charsets import characters
from .window import BrailleWindow, CellsOf

__all__ = ["WrittenCells"]

_DISPLAY, _REGION, _TEXT, _AND, _OR, _CURSOR, _CHARSET = (1 << bit for bit in range(7))
_DISPLAYS = (1, 0xFFFFFFFF)  # the first one, or the default


class _Reader:
    """Takes fields off a packet, in order."""

    def __init__(self, data: bytes) -> None:
        self._data, self._at = data, 0

    def take(self, size: int) -> bytes:
        """The next `size` bytes."""
        part = self._data[self._at : self._at + size]
        if len(part) < size:
            raise BrlapiRefused(BrlapiCode.PACKET, "packet too small")
        self._at += size
        return part

    def number(self, form: str = ">I") -> int:
        """The next number; four bytes unless `form` says otherwise."""
        return int(struct.unpack(form, self.take(struct.calcsize(form)))[0])

    def end(self) -> None:
        """Nothing may be left."""
        if self._at != len(self._data):
            raise BrlapiRefused(BrlapiCode.PACKET, "packet too big")


class WrittenCells:
    """The display as one client sees it.

    cells = (cells of the text & AND) | OR; what a region with a negative size leaves is blank.
    """

    def __init__(self, size: int) -> None:
        self._size = size
        self._text = [" "] * size
        self._and, self._or = bytearray(b"\xff" * size), bytearray(size)
        self._cursor = 0
        self.shown = False

    def write(self, data: bytes) -> None:
        """Take a write packet; one that is refused changes nothing.

        Raises
        ------
        BrlapiRefused
            When it is malformed, goes beyond the display, or has characters of an unknown set.
        """
        packet = _Reader(data)
        flags = packet.number()
        if not flags and len(data) == 4:
            self.shown = False
            return
        if flags & _DISPLAY and packet.number() not in _DISPLAYS:
            raise BrlapiRefused(BrlapiCode.UNSUPPORTED, "there is one display")
        begin, size, fill = self._region(packet) if flags & _REGION else (0, self._size, True)
        raw = packet.take(packet.number()) if flags & _TEXT else None
        masks = [packet.take(size) if flags & mask else None for mask in (_AND, _OR)]
        cursor = packet.number() if flags & _CURSOR else self._cursor
        if cursor > self._size:
            raise BrlapiRefused(BrlapiCode.PACKET, "the cursor is beyond the display")
        charset = packet.take(packet.number("B")).decode("latin-1") if flags & _CHARSET else None
        packet.end()
        text = None if raw is None else _text(raw, charset)
        end = self._size if fill else begin + size
        self._put(begin, end, None if text is None else _fitted(text, end - begin, fill), masks)
        self._cursor, self.shown = cursor, True

    def window(self, cells_of: CellsOf, note: str) -> BrailleWindow:
        """What is to be felt of it."""
        text = "".join(self._text)
        cells = bytes(c & a | o for c, a, o in zip(cells_of(text), self._and, self._or, strict=True))
        return BrailleWindow(cells, text, self._cursor - 1 if self._cursor else None, note)

    def _region(self, packet: _Reader) -> tuple[int, int, bool]:
        """Where it begins, from 0, how many cells it says, and whether the rest of the display is blank then."""
        begin, size = packet.number(), packet.number(">i")
        if not (1 <= begin <= self._size and 1 <= abs(size) <= self._size - begin + 1):
            raise BrlapiRefused(BrlapiCode.PARAMETER, "the region is beyond the display")
        return begin - 1, abs(size), size < 0

    def _put(self, begin: int, end: int, text: str | None, masks: list[bytes | None]) -> None:
        room = end - begin
        for kept, mask, unset in zip((self._and, self._or), masks, (0xFF, 0), strict=True):
            if mask is not None:
                kept[begin:end] = mask.ljust(room, b"\0")
            elif text is not None:
                kept[begin:end] = bytes([unset]) * room
        if text is not None:
            self._text[begin:end] = text


def _text(raw: bytes, charset: str | None) -> str:
    try:
        return characters(raw, charset)
    except ValueError as error:
        raise BrlapiRefused(BrlapiCode.PACKET, str(error)) from None


def _fitted(text: str, room: int, fill: bool) -> str:
    if not fill and len(text) != room:
        raise BrlapiRefused(BrlapiCode.PACKET, f"{len(text)} characters for {room} cells")
    return text[:room].ljust(room)
