"""Ordered packets that came before their turn: kept for it, in bounded memory."""

from __future__ import annotations

from .packet import Packet

__all__ = ["MOST_EARLY", "EarlyPackets"]

MOST_EARLY = 32  # an ACK tells of so many


class EarlyPackets:
    """Keeps at most `room` packets, none of them more than `MOST_EARLY` ahead of the awaited one.

    Parameters
    ----------
    room : packets, 0 to MOST_EARLY; 0 keeps none.
    """

    def __init__(self, room: int) -> None:
        self._room = room
        self._kept: dict[int, Packet] = {}

    def keep(self, packet: Packet, awaited: int) -> bool:
        """Whether `packet` is kept, now or from before; when it is not, the host has to send it again."""
        if packet.number in self._kept:
            return True
        if not awaited < packet.number <= awaited + MOST_EARLY or len(self._kept) >= self._room:
            return False
        self._kept[packet.number] = packet
        return True

    def take(self, number: int) -> Packet | None:
        """The packet `number`, once, if it was kept."""
        return self._kept.pop(number, None)

    def bits(self, awaited: int) -> int:
        """As an ACK has it: bit i is set when packet ``awaited + 1 + i`` is kept."""
        return sum(1 << (number - awaited - 1) for number in self._kept)

    def clear(self) -> None:
        """Forget all."""
        self._kept.clear()
