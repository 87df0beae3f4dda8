"""Packets on the wire: a kind, a number and a payload, sealed by a CRC-32; bytes in, values out, no port.

PROTOCOL.md is the page that says the same to a firmware author.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple
from zlib import crc32

from ..errors import DriverError
from .cobs import DELIMITER, FrameError, FrameSplitter, cobs_decode, cobs_encode

__all__ = ["MAX_PAYLOAD", "ORDERED", "SHAPES", "Kind", "Packet", "PacketError", "PacketReader", "decode", "encode"]

MAX_PAYLOAD = 4096
HEAD = struct.Struct("<BI")
SEAL = struct.Struct("<I")
LONGEST_BODY = HEAD.size + MAX_PAYLOAD + SEAL.size
LONGEST_FRAME = LONGEST_BODY + LONGEST_BODY // 254 + 1


class PacketError(DriverError, ValueError):
    """A frame is not a packet.

    Examples: a bit was flipped on the line; the kind is not known; the payload is not as long as its kind says.
    """


class Kind(IntEnum):
    """What a packet is; 0x80 and above go from the controller to the host."""

    HELLO = 0x01
    STATUS = 0x02
    HEARTBEAT = 0x03
    STOP = 0x04
    KEYED = 0x05
    START = 0x10
    COUPLING = 0x11
    BIAS = 0x12
    TONES = 0x13
    MARK = 0x14
    SAMPLES = 0x15
    END = 0x16
    MEASURE = 0x17
    ENVELOPE = 0x18
    LINKS_TO = 0x19
    CAPABILITIES = 0x81
    ACK = 0x82
    MARKED = 0x83
    REFUSED = 0x84
    MEASURED = 0x85
    KEY = 0x86


ORDERED = frozenset(kind for kind in Kind if Kind.START <= kind <= Kind.LINKS_TO)


class Shape(NamedTuple):
    """A payload is `fixed` bytes and then any number of items of `item` bytes; 0: no items."""

    fixed: int
    item: int


SHAPES = {
    Kind.HELLO: Shape(2, 0),
    Kind.STATUS: Shape(0, 0),
    Kind.HEARTBEAT: Shape(0, 0),
    Kind.STOP: Shape(0, 0),
    Kind.KEYED: Shape(4, 0),
    Kind.START: Shape(17, 1),
    Kind.COUPLING: Shape(14, 2),
    Kind.BIAS: Shape(18, 0),
    Kind.TONES: Shape(14, 12),
    Kind.MARK: Shape(12, 1),
    Kind.SAMPLES: Shape(10, 2),
    Kind.END: Shape(8, 0),
    Kind.MEASURE: Shape(16, 8),
    Kind.ENVELOPE: Shape(22, 8),
    Kind.LINKS_TO: Shape(14, 4),
    Kind.CAPABILITIES: Shape(45, 1),
    Kind.ACK: Shape(58, 4),
    Kind.MARKED: Shape(20, 0),
    Kind.REFUSED: Shape(4, 1),
    Kind.MEASURED: Shape(10, 24),
    Kind.KEY: Shape(4, 2),
}


@dataclass(frozen=True)
class Packet:
    """One message as bytes.

    Attributes
    ----------
    kind : what it is.
    number : place in the session of an ordered packet, 0 for the others (0 .. 2^32 - 1).
    payload : 0 to MAX_PAYLOAD bytes, of the length `SHAPES` gives its kind.
    """

    kind: Kind
    number: int = 0
    payload: bytes = b""


def encode(packet: Packet) -> bytes:
    """The bytes of `packet` on the wire, with the zero that ends them.

    Raises
    ------
    PacketError
        When the payload has not the length of its kind, or the number is out of range.
    """
    _check_shape(packet.kind, len(packet.payload))
    if not 0 <= packet.number <= 0xFFFFFFFF:
        raise PacketError(f"packet number: expected 0 to 2^32 - 1, got {packet.number}")
    body = HEAD.pack(packet.kind, packet.number) + packet.payload
    return cobs_encode(body + SEAL.pack(crc32(body))) + DELIMITER


def decode(frame: bytes) -> Packet:
    """The packet in `frame`, the bytes between two zeros.

    Raises
    ------
    PacketError
        When it holds none; nothing else is ever raised, whatever the bytes.
    """
    try:
        sealed = cobs_decode(frame)
    except FrameError as error:
        raise PacketError(str(error)) from None
    if len(sealed) < HEAD.size + SEAL.size:
        raise PacketError(f"{len(sealed)} bytes are too few for a packet")
    body, seal = sealed[: -SEAL.size], sealed[-SEAL.size :]
    if SEAL.pack(crc32(body)) != seal:
        raise PacketError("the CRC-32 does not fit")
    code, number = HEAD.unpack_from(body)
    try:
        kind = Kind(code)
    except ValueError:
        raise PacketError(f"kind 0x{code:02x} is not known") from None
    _check_shape(kind, len(body) - HEAD.size)
    return Packet(kind, number, body[HEAD.size :])


def _check_shape(kind: Kind, length: int) -> None:
    fixed, item = SHAPES[kind]
    items = length - fixed
    if items < 0 or length > MAX_PAYLOAD or (items % item if item else items):
        raise PacketError(f"{kind.name}: {length} bytes of payload are not {fixed} + k x {item} <= {MAX_PAYLOAD}")


class PacketReader:
    """Finds the packets in a stream of bytes; passes over everything else.

    Attributes
    ----------
    bad : how many frames were no packet.
    """

    def __init__(self) -> None:
        self._splitter = FrameSplitter(LONGEST_FRAME)
        self._unsealed = 0

    @property
    def bad(self) -> int:
        """How many frames were no packet so far."""
        return self._unsealed + self._splitter.overlong

    def feed(self, data: bytes) -> list[Packet]:
        """Take the next bytes; returns the packets that they complete, in order."""
        packets = []
        for frame in self._splitter.feed(data):
            try:
                packets.append(decode(frame))
            except PacketError:
                self._unsealed += 1
        return packets
