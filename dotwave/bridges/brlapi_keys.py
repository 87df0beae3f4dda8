"""Keys as BrlAPI codes, and the ranges of codes that a client asked for."""

from __future__ import annotations

import struct

from .brlapi_packets import BrlapiCode, BrlapiRefused
from .window import Key, KeyName

__all__ = ["KeyRanges", "key_code"]

_CODES = {
    KeyName.UP: 0x20000001, KeyName.DOWN: 0x20000002, KeyName.TOP: 0x2000000B, KeyName.BOTTOM: 0x2000000C,
    KeyName.PREVIOUS: 0x20000017, KeyName.NEXT: 0x20000018, KeyName.HOME: 0x2000001D,
}  # fmt: skip
_ROUTE = 0x20010000
_RANGE = struct.Struct(">QQ")
_MOST_RANGES = 1024


def key_code(key: Key) -> int:
    """The code of BRLTTY's command for a key; flags are the upper 32 bits, and 0."""
    return _ROUTE + min(key.cell, 0xFFFF) if key.name is KeyName.ROUTE else _CODES[key.name]


class KeyRanges:
    """Which codes a client wants: all at first, then what it ignores and accepts, the last word counting."""

    def __init__(self) -> None:
        self._said: list[tuple[bool, int, int]] = []

    def say(self, accepted: bool, data: bytes) -> None:
        """Accept, or ignore, ranges as a packet has them: first and last code, 64 bits each.

        Raises
        ------
        BrlapiRefused
            When the packet is not made of ranges, or so many were said that they are no longer remembered.
        """
        if len(data) % _RANGE.size:
            raise BrlapiRefused(BrlapiCode.PACKET, "not a list of ranges")
        for first, last in _RANGE.iter_unpack(data):
            # What the range covers is said anew.
            self._said = [one for one in self._said if one[1] < first or one[2] > last]
            if len(self._said) >= _MOST_RANGES:
                raise BrlapiRefused(BrlapiCode.PARAMETER, "too many ranges")
            self._said.append((accepted, first, last))

    def __contains__(self, number: int) -> bool:
        said = (accepted for accepted, first, last in reversed(self._said) if first <= number <= last)
        return next(said, True)
