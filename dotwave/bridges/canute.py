"""An emulated Canute on bytes: several lines of six-dot cells, as BRLTTY's driver knows them.

A Canute moves its rows by motors, in seconds. This one says unasked that its motors are still, after each row: the
driver sends the next one at once.
"""

from __future__ import annotations

from .window import BrailleWindow, Key, KeyName

__all__ = ["CanuteDisplay", "crc_x25"]

_FRAME, _ESCAPE, _ESCAPE_BIT = 0x7E, 0x7D, 0x20
_COLUMNS, _ROWS, _PROTOCOL, _ROW, _RESET, _PRESSED, _FIRMWARE, _STATUS = 0, 1, 3, 6, 7, 0x0A, 0x0B, 0x0D
_SIX_DOTS = 0x3F
_LINE1, _BACK, _MENU, _FORWARD = 1 << 2, 1 << 11, 1 << 12, 1 << 13
_MOST_LINES = 9
_KEYS = {
    KeyName.UP: _BACK, KeyName.DOWN: _FORWARD, KeyName.HOME: _MENU, KeyName.PREVIOUS: _MENU | _BACK,
    KeyName.NEXT: _MENU | _FORWARD,
}  # fmt: skip
_LONGEST = 1024


class CanuteDisplay:
    """A display of any columns and rows.

    Attributes
    ----------
    window : what was written last, None before.
    settle_s : how long rows of one window may be apart.

    Parameters
    ----------
    columns, rows : of cells.
    """

    def __init__(self, columns: int, rows: int) -> None:
        if not (1 <= columns <= 255 and 1 <= rows <= 255):
            raise ValueError(f"expected 1 to 255 columns and rows, got {columns} x {rows}")
        self.window: BrailleWindow | None = None
        self.settle_s = 0.0 if rows == 1 else 0.01
        self._columns, self._rows = columns, rows
        self._cells = bytearray(columns * rows)
        self._keys = 0
        self._driven = False
        self._frame = bytearray()
        self._escaped = self._spoiled = False

    def receive(self, data: bytes) -> bytes:
        """Take bytes, in pieces of any size; gives the answers. What is spoiled is passed over: drivers ask again."""
        answers = b""
        for byte in data:
            if byte == _FRAME:
                answers += self._ended()
            elif byte == _ESCAPE:
                self._spoiled |= self._escaped
                self._escaped = True
            elif len(self._frame) < _LONGEST:
                self._frame.append(byte ^ _ESCAPE_BIT if self._escaped else byte)
                self._escaped = False
            else:
                self._spoiled = True
        return answers

    def press(self, key: Key) -> bytes:
        """A key goes down; it is told at once, and whenever the driver asks."""
        if key.name is KeyName.ROUTE:
            line = key.cell // self._columns
            self._keys = _LINE1 << line if line < min(self._rows, _MOST_LINES) else 0
        else:
            self._keys = _KEYS.get(key.name, 0)
        return self.idle()

    def release(self, key: Key) -> bytes:
        """It goes up again: that is when the driver acts."""
        self._keys = 0
        return self.idle()

    def idle(self) -> bytes:
        """Keys, unasked: said every some milliseconds, a driver writes sooner than it would ask.

        Nothing until it writes: before, it asks who is there, and takes no other answer.
        """
        return _framed(_PRESSED, self._keys) if self._driven else b""

    def _ended(self) -> bytes:
        frame, spoiled = bytes(self._frame), self._spoiled or self._escaped
        self._frame.clear()
        self._escaped = self._spoiled = False
        if spoiled or len(frame) < 3 or crc_x25(frame[:-2]) != int.from_bytes(frame[-2:], "little"):
            return b""
        return self._answered(frame[0], frame[1:-2])

    def _answered(self, asked: int, data: bytes) -> bytes:
        values = {_COLUMNS: self._columns, _ROWS: self._rows, _PROTOCOL: 1, _STATUS: 0, _PRESSED: self._keys}
        if asked in values:
            self._driven &= asked != _COLUMNS
            return _framed(asked, values[asked])
        if asked == _FIRMWARE:
            return _enclosed(bytes([asked]) + b"dotwave")
        self._driven |= asked in (_ROW, _RESET)
        if asked == _ROW:
            self._written(data)
        elif asked == _RESET:
            self._cells[:] = bytes(len(self._cells))
            self._show()
        else:
            return b""
        return _framed(asked, 0) + _framed(_STATUS, 0) + self.idle()

    def _written(self, data: bytes) -> None:
        row = data[0] if data else self._rows
        if row < self._rows and len(data) == 1 + self._columns:
            at = row * self._columns
            self._cells[at : at + self._columns] = bytes(bits & _SIX_DOTS for bits in data[1:])
            self._show()

    def _show(self) -> None:
        self.window = BrailleWindow(bytes(self._cells), note="canute")


def crc_x25(data: bytes) -> int:
    """The checksum of HDLC: CRC-16/X-25."""
    crc = 0xFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ (0x8408 if crc & 1 else 0)
    return crc ^ 0xFFFF


def _framed(code: int, value: int) -> bytes:
    return _enclosed(bytes([code]) + value.to_bytes(2, "little"))


def _enclosed(body: bytes) -> bytes:
    whole = body + crc_x25(body).to_bytes(2, "little")
    escaped = whole.replace(b"\x7d", b"\x7d\x5d").replace(b"\x7e", b"\x7d\x5e")
    return b"\x7e" + escaped + b"\x7e"
