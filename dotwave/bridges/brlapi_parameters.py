"""Parameters of a BrlAPI connection: what a client may ask for and set."""

from __future__ import annotations

import struct

from .brlapi_packets import ACK, BrlapiCode, BrlapiRefused, packed

__all__ = ["NO_PRIORITY", "PRIORITY", "BrlapiParameters"]

PRIORITY = 1
NO_PRIORITY = 0
_DEFAULT_PRIORITY, _HIGHEST_PRIORITY = 50, 100
_COUNT = 33
_GET = 0x100
_HEAD = struct.Struct(">IIQ")  # flags, parameter, part of it
_VALUE = ord("P") << 8 | ord("V")
_SERVER_VERSION, _NAME, _CODE, _VERSION, _MODEL, _SIZE, _ONLINE, _CELL_SIZE = 0, 2, 3, 4, 5, 6, 9, 31
_FIXED = {_SERVER_VERSION, _NAME, _CODE, _VERSION, _MODEL, _SIZE, 7, 8, _ONLINE, _CELL_SIZE, *range(20, 28)}


class BrlapiParameters:
    """Of one client.

    What a client sets that has no meaning here is taken and forgotten, as on a display that lacks it.

    Attributes
    ----------
    numbers : value of each parameter that can be set and counts.

    Parameters
    ----------
    name : of the device.
    columns, rows : of cells.
    """

    def __init__(self, name: str, columns: int, rows: int) -> None:
        self.numbers = {PRIORITY: _DEFAULT_PRIORITY}
        self._values = {
            _SERVER_VERSION: struct.pack(">I", 0x00060500),
            _NAME: b"dotwave",
            _CODE: b"dw",
            _VERSION: b"1",
            _MODEL: name.encode(),
            _SIZE: struct.pack(">II", columns, rows),
            _ONLINE: b"\1",
            _CELL_SIZE: b"\6",
        }

    def set(self, content: bytes) -> bytes:
        """Answer to a value that a client sets.

        Raises
        ------
        BrlapiRefused
            When it is no such packet, value or parameter, or one that cannot be set.
        """
        _, number = self._head(content)
        if number in _FIXED:
            raise BrlapiRefused(BrlapiCode.READ_ONLY, "it cannot be set")
        value = content[_HEAD.size :]
        if number == PRIORITY:
            if len(value) != 4 or struct.unpack(">I", value)[0] > _HIGHEST_PRIORITY:
                raise BrlapiRefused(BrlapiCode.PARAMETER, "priorities are 0 to 100")
            self.numbers[PRIORITY] = struct.unpack(">I", value)[0]
        return packed(ACK)

    def asked(self, content: bytes) -> bytes:
        """Answer to a client that asks for a value, or wants to hear of changes: there are none to tell.

        Raises
        ------
        BrlapiRefused
            When it is no such packet or parameter.
        """
        flags, number = self._head(content)
        if not flags & _GET:
            return packed(ACK)
        value = self._values.get(number, b"")
        if number in self.numbers:
            value = struct.pack(">I", self.numbers[number])
        return packed(_VALUE, _HEAD.pack(flags & 1, number, _HEAD.unpack_from(content)[2]) + value)

    @staticmethod
    def _head(content: bytes) -> tuple[int, int]:
        if len(content) < _HEAD.size:
            raise BrlapiRefused(BrlapiCode.PACKET, "too short for a parameter")
        flags, number, _ = _HEAD.unpack_from(content)
        if number >= _COUNT:
            raise BrlapiRefused(BrlapiCode.PARAMETER, "unknown parameter")
        return flags, number
