"""BrlAPI packets as a client makes them, for tests without one."""

from __future__ import annotations

import struct

from dotwave.bridges.brlapi import BrlapiServer
from dotwave.bridges.brlapi_client import BrlapiClient, BrlapiDisplay
from dotwave.bridges.glyphs import glyphs

HELLO = struct.pack(">II", 4, ord("v")) + struct.pack(">I", 8)
ENTER = struct.pack(">IIIB", 5, ord("t"), 0, 0)
ACK = struct.pack(">II", 0, ord("A"))


def packet(kind: str, data: bytes = b"") -> bytes:
    number = ord(kind) if len(kind) == 1 else ord(kind[0]) << 8 | ord(kind[1])
    return struct.pack(">II", len(data), number) + data


def error(code: int) -> bytes:
    return packet("e", struct.pack(">I", code))


def writing(
    text: bytes | None = None,
    *,
    region: tuple[int, int] | None = None,
    masks: tuple[bytes | None, bytes | None] = (None, None),
    cursor: int | None = None,
    charset: bytes | None = None,
) -> bytes:
    flags, data = 0, b""
    for bit, part in (
        (2, region and struct.pack(">Ii", *region)),
        (4, None if text is None else struct.pack(">I", len(text)) + text),
        (8, masks[0]),
        (16, masks[1]),
        (32, None if cursor is None else struct.pack(">I", cursor)),
        (64, None if charset is None else bytes([len(charset)]) + charset),
    ):
        if part is not None:
            flags |= bit
            data += part
    return packet("w", struct.pack(">I", flags) + data)


def priority(number: int) -> bytes:
    return packet("PV", struct.pack(">IIQI", 0, 1, 0, number))


def server(columns: int = 6, rows: int = 1, secret: bytes | None = None) -> BrlapiServer:
    return BrlapiServer(BrlapiDisplay(columns, rows, "linked-6x6", secret), glyphs())


def entered(among: BrlapiServer) -> BrlapiClient:
    client = among.join()
    client.receive(HELLO + ENTER)
    return client


def cells(among: BrlapiServer) -> str:
    return among.window.braille if among.window else ""
