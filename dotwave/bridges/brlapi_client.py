"""One BrlAPI connection on bytes: greeting, requests and their answers."""

from __future__ import annotations

import hmac
import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from .brlapi_keys import KeyRanges
from .brlapi_packets import (
    ACK,
    AUTH,
    AUTH_KEY,
    AUTH_NONE,
    ERROR,
    EXCEPTION,
    VERSION,
    BrlapiCode,
    BrlapiFrames,
    BrlapiRefused,
    packed,
)
from .brlapi_parameters import PRIORITY, BrlapiParameters
from .brlapi_write import WrittenCells
from .window import BrailleWindow, CellsOf

__all__ = ["BrlapiClient", "BrlapiDisplay"]

_WRITE = ord("w")
_LARGEST_PATH = 1024


@dataclass(frozen=True)
class BrlapiDisplay:
    """What clients are told of the display.

    Attributes
    ----------
    columns, rows : of cells.
    name : of the device.
    secret : what a client has to know, as the key file has it; None lets everybody in.
    """

    columns: int
    rows: int = 1
    name: str = "dotwave"
    secret: bytes | None = None


class BrlapiClient:
    """One connection.

    Attributes
    ----------
    number : counted from 1.
    greeting : what the server says first.
    finished : the connection is to be closed, once what `receive` gave is sent.
    trusted : the client may ask for things.
    written : what it wrote since it entered its tty; None outside of one.
    ranges : the keys it wants.
    turn : when it took the display.

    Parameters
    ----------
    display : what it is told.
    turns : numbers that grow, for those who take the display.
    """

    greeting = packed(ord("v"), struct.pack(">I", VERSION))

    def __init__(self, display: BrlapiDisplay, number: int, turns: Iterator[int]) -> None:
        self.number = number
        self.finished = self.trusted = False
        self.written: WrittenCells | None = None
        self.ranges = KeyRanges()
        self.turn = 0
        self._display, self._turns, self._frames = display, turns, BrlapiFrames()
        self._parameters = BrlapiParameters(display.name, display.columns, display.rows)
        self._greeted = False

    @property
    def priority(self) -> int:
        """0 to 100; 0 means that it has nothing to show."""
        return self._parameters.numbers[PRIORITY]

    def window(self, cells_of: CellsOf) -> BrailleWindow | None:
        """What it shows."""
        return self.written.window(cells_of, f"client {self.number}") if self.written else None

    def receive(self, data: bytes) -> bytes:
        """Take bytes, in pieces of any size; gives the answers."""
        answers = b""
        for kind, content in self._frames.feed(data):
            if self.finished:
                break
            answers += self._answered(kind, content)
        return answers

    def _answered(self, kind: int, content: bytes | None) -> bytes:
        try:
            if content is None:
                raise BrlapiRefused(BrlapiCode.PACKET, "packet too large")
            if not self.trusted:
                return self._introduced(kind, content)
            asked = _REQUESTS.get(kind)
            if asked is None:
                raise BrlapiRefused(BrlapiCode.ILLEGAL, "unknown request")
            return asked(self, content)
        except BrlapiRefused as refused:
            self.finished |= not self.trusted
            number = struct.pack(">I", refused.code)
            # Nobody waits for an answer to a write: it is told as something that happened, not as an answer.
            if kind == _WRITE and self.trusted:
                return packed(EXCEPTION, number + struct.pack(">I", kind) + (content or b""))
            return packed(ERROR, number)

    def _introduced(self, kind: int, content: bytes) -> bytes:
        secret = self._display.secret
        if not self._greeted:
            if kind != ord("v") or len(content) < 4 or struct.unpack_from(">I", content)[0] < VERSION:
                raise BrlapiRefused(BrlapiCode.VERSION, "protocol version 8 is spoken")
            self._greeted, self.trusted = True, secret is None
            return packed(AUTH, struct.pack(">I", AUTH_NONE if self.trusted else AUTH_KEY))
        right = struct.pack(">I", AUTH_KEY) + (secret or b"")
        if kind != AUTH or not hmac.compare_digest(content, right):
            raise BrlapiRefused(BrlapiCode.AUTHENTICATION, "the key is not right")
        self.trusted = True
        return packed(ACK)

    def _enter(self, content: bytes) -> bytes:
        if self.written is not None:
            raise BrlapiRefused(BrlapiCode.ILLEGAL, "in a tty already")
        count = struct.unpack_from(">I", content)[0] if len(content) >= 5 else _LARGEST_PATH
        named = content[4 + 4 * count :]
        if count >= _LARGEST_PATH or not named or len(named) != 1 + named[0]:
            raise BrlapiRefused(BrlapiCode.PACKET, "not a path of ttys")
        if named[0]:
            raise BrlapiRefused(BrlapiCode.PARAMETER, "keys of a driver are not sent, only commands")
        self.written = WrittenCells(self._display.columns * self._display.rows)
        self.ranges, self.turn = KeyRanges(), next(self._turns)
        return packed(ACK)

    def _leave(self, content: bytes) -> bytes:
        self._in_tty()
        self.written = None
        return packed(ACK)

    def _write(self, content: bytes) -> bytes:
        self._in_tty().write(content)
        return b""

    def _say(self, accepted: bool, content: bytes) -> bytes:
        self._in_tty()
        self.ranges.say(accepted, content)
        return packed(ACK)

    def _in_tty(self) -> WrittenCells:
        if self.written is None:
            raise BrlapiRefused(BrlapiCode.ILLEGAL, "not in a tty")
        return self.written

    def _size(self, content: bytes) -> bytes:
        return packed(ord("s"), struct.pack(">II", self._display.columns, self._display.rows))

    def _named(self, kind: str, name: str) -> bytes:
        return packed(ord(kind), name.encode() + b"\0")

    def _unsupported(self, content: bytes) -> bytes:
        raise BrlapiRefused(BrlapiCode.UNSUPPORTED, "there is no raw mode")


_REQUESTS: dict[int, Callable[[BrlapiClient, bytes], bytes]] = {
    ord("s"): BrlapiClient._size,
    ord("n"): lambda client, content: client._named("n", "dotwave"),
    ord("d"): lambda client, content: client._named("d", client._display.name),
    ord("t"): BrlapiClient._enter,
    ord("L"): BrlapiClient._leave,
    ord("F"): lambda client, content: b"",
    ord("m"): lambda client, content: client._say(False, content),
    ord("u"): lambda client, content: client._say(True, content),
    ord("Z"): lambda client, content: packed(ACK),
    _WRITE: BrlapiClient._write,
    ord("P") << 8 | ord("V"): lambda client, content: client._parameters.set(content),
    ord("P") << 8 | ord("R"): lambda client, content: client._parameters.asked(content),
} | {ord(kind): BrlapiClient._unsupported for kind in "*#pSR"}
