"""A BrlAPI server on bytes: what clients such as Orca, BRLTTY's own driver and python3-brlapi find.

It knows no sockets and no clocks. Of several clients the one with the highest priority is shown and gets the keys; of
equals the one that took the display last.
"""

from __future__ import annotations

import struct
from itertools import count

from .brlapi_client import BrlapiClient, BrlapiDisplay
from .brlapi_keys import key_code
from .brlapi_packets import packed
from .brlapi_parameters import NO_PRIORITY
from .window import BrailleWindow, CellsOf, Key

__all__ = ["BrlapiServer"]

_KEY = ord("k")


class BrlapiServer:
    """One display for many clients.

    Parameters
    ----------
    display : what clients are told of it.
    cells_of : characters to cells.
    """

    def __init__(self, display: BrlapiDisplay, cells_of: CellsOf) -> None:
        self._display, self._cells_of = display, cells_of
        self._clients: list[BrlapiClient] = []
        self._numbers, self._turns = count(1), count(1)

    @property
    def clients(self) -> tuple[BrlapiClient, ...]:
        """Those that are connected, in the order they came."""
        return tuple(self._clients)

    def join(self) -> BrlapiClient:
        """Somebody connected; `BrlapiClient.greeting` goes to it first."""
        client = BrlapiClient(self._display, next(self._numbers), self._turns)
        self._clients.append(client)
        return client

    def leave(self, client: BrlapiClient) -> None:
        """It is gone, and what it wrote with it."""
        if client in self._clients:
            self._clients.remove(client)

    @property
    def window(self) -> BrailleWindow | None:
        """What is to be felt now; None when nobody has anything to show."""
        client = self._shown()
        return None if client is None else client.window(self._cells_of)

    def press(self, key: Key) -> tuple[BrlapiClient, bytes] | None:
        """Who gets a key, and the bytes; None when nobody wants it."""
        client, number = self._shown(), key_code(key)
        if client is None or number not in client.ranges:
            return None
        return client, packed(_KEY, struct.pack(">Q", number))

    def _shown(self) -> BrlapiClient | None:
        having = [c for c in self._clients if c.written is not None and c.written.shown and c.priority > NO_PRIORITY]
        return max(having, key=lambda client: (client.priority, client.turn), default=None)
