"""BrlAPI on the wire: packets of a byte stream, their kinds, and the codes of refusals."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from enum import IntEnum

__all__ = [
    "ACK", "AUTH", "AUTH_KEY", "AUTH_NONE", "ERROR", "EXCEPTION", "LARGEST", "VERSION", "BrlapiCode", "BrlapiFrames",
    "BrlapiRefused", "packed",
]  # fmt: skip

VERSION = 8
LARGEST = 4096
ACK, AUTH, ERROR, EXCEPTION = (ord(letter) for letter in "AaeE")
AUTH_NONE, AUTH_KEY = ord("N"), ord("K")
_HEAD = struct.Struct(">II")


class BrlapiCode(IntEnum):
    """Why something is refused, as a number on the wire."""

    ILLEGAL = 5
    PARAMETER = 6
    PACKET = 7
    UNSUPPORTED = 9
    VERSION = 13
    AUTHENTICATION = 17
    READ_ONLY = 18


class BrlapiRefused(Exception):
    """A request cannot be done; `code` is what the client is told.

    Examples: a region beyond the display; a character set nobody knows; writing without a tty.
    """

    def __init__(self, code: BrlapiCode, words: str) -> None:
        super().__init__(words)
        self.code = code


def packed(kind: int, data: bytes = b"") -> bytes:
    """A packet as bytes."""
    return _HEAD.pack(len(data), kind) + data


class BrlapiFrames:
    """Cuts a byte stream into packets; keeps at most one that is not complete."""

    def __init__(self) -> None:
        self._rest = bytearray()
        self._skip = 0

    def feed(self, data: bytes) -> Iterator[tuple[int, bytes | None]]:
        """Kind and content of each packet that is complete; None for one too large, whose content is passed over."""
        self._rest += data
        while True:
            passed = min(self._skip, len(self._rest))
            del self._rest[:passed]
            self._skip -= passed
            if self._skip or len(self._rest) < _HEAD.size:
                return
            size, kind = _HEAD.unpack_from(self._rest)
            if size > LARGEST:
                del self._rest[: _HEAD.size]
                self._skip = size
                yield kind, None
                continue
            if len(self._rest) < _HEAD.size + size:
                return
            content = bytes(self._rest[_HEAD.size : _HEAD.size + size])
            del self._rest[: _HEAD.size + size]
            yield kind, content
