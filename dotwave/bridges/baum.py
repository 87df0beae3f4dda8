"""An emulated Baum display on bytes, as every BRLTTY, NVDA and JAWS know it: one line of cells, with routing keys."""

from __future__ import annotations

from .window import BrailleWindow, Key, KeyName

__all__ = ["MOST_CELLS", "BaumDisplay"]

MOST_CELLS = 84
_ESCAPE = 0x1B
_WRITE, _GET_KEYS, _IDENTITY, _SERIAL = 0x01, 0x08, 0x84, 0x8A
_ROUTING, _KEYS = 0x22, 0x24
_DISPLAY_KEYS = {KeyName.UP: 0x01, KeyName.PREVIOUS: 0x02, KeyName.DOWN: 0x04, KeyName.HOME: 0x08, KeyName.NEXT: 0x10}
_LONGEST_OTHER = 16  # of the requests that are passed over


class BaumDisplay:
    """A display of up to 84 cells in one line.

    Frames are ESC, code and data with every ESC doubled; they have no length, so that a short one ends where the next
    begins.

    Attributes
    ----------
    window : what was written last, None before.

    Parameters
    ----------
    cells : how many it has.
    """

    settle_s = 0.0

    def __init__(self, cells: int) -> None:
        if not 1 <= cells <= MOST_CELLS:
            raise ValueError(f"cells: expected 1 to {MOST_CELLS}, got {cells}")
        self.window: BrailleWindow | None = None
        self._cells = cells
        self._code: int | None = None
        self._data = bytearray()
        self._escaped = False

    def receive(self, data: bytes) -> bytes:
        """Take bytes, in pieces of any size; gives the answers."""
        answers = b""
        for byte in data:
            if self._escaped:
                self._escaped = False
                if byte != _ESCAPE:
                    answers += self._ended() + self._begun(byte)
                    continue
            elif byte == _ESCAPE:
                self._escaped = True
                continue
            self._take(byte)
        return answers

    def press(self, key: Key) -> bytes:
        """A key goes down; what it does not have, it does not send."""
        if key.name is KeyName.ROUTE:
            return self._routing(key.cell) if key.cell < self._cells else b""
        bits = _DISPLAY_KEYS.get(key.name)
        return b"" if bits is None else _framed(_KEYS, bytes([bits]))

    def release(self, key: Key) -> bytes:
        """It goes up again."""
        if key.name is KeyName.ROUTE:
            return self._routing(None) if key.cell < self._cells else b""
        return _framed(_KEYS, b"\0") if key.name in _DISPLAY_KEYS else b""

    def _routing(self, cell: int | None) -> bytes:
        # NVDA reads 5 or 10 bytes, BRLTTY one for each 8 cells; it passes over zeros beyond those.
        size = 5 if self._cells <= 40 else 10 if self._cells <= 80 else 11
        return _framed(_ROUTING, (0 if cell is None else 1 << cell).to_bytes(size, "little"))

    def _begun(self, code: int) -> bytes:
        """A frame begins; those without data are answered at once."""
        self._code = code
        if code == _IDENTITY:
            return _framed(code, f"dotwave {self._cells}".ljust(16).encode("ascii"))
        if code == _SERIAL:
            return _framed(code, b"dotwave ")
        return _framed(_KEYS, b"\0") if code == _GET_KEYS else b""

    def _take(self, byte: int) -> None:
        if self._code is None:
            return
        self._data.append(byte)
        if self._code == _WRITE and len(self._data) == self._cells:
            self.window = BrailleWindow(bytes(self._data), note="baum")
            self._code = None
            self._data.clear()
        elif len(self._data) > max(_LONGEST_OTHER, self._cells):
            self._code = None
            self._data.clear()

    def _ended(self) -> bytes:
        """The frame before ended early: too few cells ask how many there are."""
        asked = self._code == _WRITE
        self._code = None
        self._data.clear()
        return _framed(_WRITE, bytes([self._cells])) if asked else b""


def _framed(code: int, data: bytes) -> bytes:
    return bytes([_ESCAPE, code]) + data.replace(b"\x1b", b"\x1b\x1b")
