"""The BrlAPI server, byte by byte."""

from __future__ import annotations

import struct

import pytest

from dotwave.bridges.brlapi_packets import packed
from dotwave.bridges.window import Key
from tests.support.bridge_bytes import (
    ACK,
    ENTER,
    HELLO,
    cells,
    entered,
    error,
    packet,
    priority,
    server,
    writing,
)

ALL_KEYS = struct.pack(">QQ", 0, 2**64 - 1)
PANNING = struct.pack(">QQQQ", 0x20000015, 0x20000019, 0x20010000, 0x2001FFFF)


def test_orca_from_hello_to_a_key() -> None:
    """The packets of a real Orca 43.1, in its order."""
    among = server()
    client = among.join()
    assert client.greeting == HELLO
    assert client.receive(HELLO) == packet("a", struct.pack(">I", ord("N")))
    assert client.receive(packet("s")) == packet("s", struct.pack(">II", 6, 1))
    assert client.receive(ENTER) == ACK
    assert client.receive(priority(0)) == ACK
    assert client.receive(packet("m", ALL_KEYS)) == ACK
    assert client.receive(packet("u", PANNING)) == ACK
    assert client.receive(priority(0x32)) == ACK
    assert client.receive(writing("Jä OK".encode(), region=(1, -5), cursor=2, charset=b"UTF-8")) == b""
    assert cells(among) == "⡚⠁⠀⡕⡅⠀"
    assert among.window is not None
    assert (among.window.text, among.window.cursor) == ("Jä OK ", 1)
    assert among.press(Key.of("next")) == (client, packed(ord("k"), struct.pack(">Q", 0x20000018)))
    assert among.press(Key.of("route 5")) == (client, packed(ord("k"), struct.pack(">Q", 0x20010005)))
    assert among.press(Key.of("home")) is None


def test_what_is_asked_is_answered() -> None:
    client = entered(server(48, 10))
    assert client.receive(packet("s")) == packet("s", struct.pack(">II", 48, 10))
    assert client.receive(packet("n")) == packet("n", b"dotwave\0")
    assert client.receive(packet("d")) == packet("d", b"linked-6x6\0")
    assert client.receive(packet("Z")) == ACK
    assert client.receive(packet("F", struct.pack(">I", 1))) == b""
    assert client.receive(packet("PR", struct.pack(">IIQ", 0x100, 6, 0))) == packet(
        "PV", struct.pack(">IIQII", 0, 6, 0, 48, 10)
    )
    assert client.receive(packet("PR", struct.pack(">IIQ", 0x100, 1, 0))) == packet(
        "PV", struct.pack(">IIQI", 0, 1, 0, 50)
    )
    assert client.receive(packet("PR", struct.pack(">IIQ", 0x200, 1, 0))) == ACK
    assert client.receive(packet("L")) == ACK


@pytest.mark.parametrize(
    ("request_", "code"),
    [
        (packet("?"), 5), (packet("XY"), 5), (packet("*", b"1234"), 9), (ENTER, 5),
        (packet("m", b"\0"), 7), (packet("PV", struct.pack(">IIQ", 0, 99, 0)), 6), (packet("PV", b"\0"), 7),
        (packet("PV", struct.pack(">IIQII", 0, 6, 0, 1, 1)), 18), (priority(101), 6),
        (struct.pack(">II", 5000, ord("s")) + bytes(5000), 7),
    ],
)  # fmt: skip
def test_what_cannot_be_is_refused_and_the_next_is_not(request_: bytes, code: int) -> None:
    client = entered(server())
    assert client.receive(request_) == error(code)
    assert client.receive(packet("s")) == packet("s", struct.pack(">II", 6, 1))


@pytest.mark.parametrize(
    "wrong",
    [
        writing(b"abc", region=(1, 6)), writing(b"abc", region=(0, 3)), writing(b"abc", region=(5, 3)),
        writing(b"abc", region=(1, -(2**31))), writing(b"abc", cursor=7), writing(b"\xff", charset=b"UTF-8"),
        writing(b"abc", charset=b"KLINGON"), writing(b"abc", charset=b"hex"), packet("w", b"\0"),
        packet("w", struct.pack(">III", 4, 2**32 - 1, 0)), packet("w", struct.pack(">I", 4) + bytes(9)),
    ],
)  # fmt: skip
def test_a_wrong_write_is_told_as_an_exception_and_changes_nothing(wrong: bytes) -> None:
    among = server()
    client = entered(among)
    client.receive(writing(b"before"))
    told = client.receive(wrong)
    assert told[4:8] == struct.pack(">I", ord("E"))
    assert told[12:] == struct.pack(">I", ord("w")) + wrong[8:]
    assert cells(among) == "⠃⠑⠋⠕⠗⠑"


@pytest.mark.parametrize(
    ("charset", "codec"),
    [
        (b"UTF-8", "utf-8"), (b"utf8", "utf-8"), (b"UCS-4LE", "utf-32-le"), (b"UCS-4BE", "utf-32-be"),
        (b"WCHAR_T", "utf-32-le"), (b"UCS-2LE", "utf-16-le"), (b"UTF-16BE", "utf-16-be"),
        (b"ISO-8859-1", "latin-1"), (b"ISO8859-15", "iso8859-15"), (b"latin1", "latin-1"), (b"CP1252", "cp1252"),
        (None, "utf-8"), (None, "latin-1"),
    ],
)  # fmt: skip
def test_every_charset_clients_send(charset: bytes | None, codec: str) -> None:
    among = server()
    entered(among).receive(writing("né 42".encode(codec), charset=charset))
    assert cells(among) == "⠝⠑⠀⠲⠆⠀"


def test_regions_masks_and_cells_as_text() -> None:
    among = server()
    client = entered(among)
    client.receive(writing(b"abcdef"))
    client.receive(writing(b"x", region=(2, 1)))
    assert cells(among) == "⠁⠭⠉⠙⠑⠋"
    # cells = (text & AND) | OR; masks alone leave the text.
    client.receive(writing(region=(1, 2), masks=(b"\x00\xff", b"\x3f\xc0")))
    assert cells(among) == "⠿⣭⠉⠙⠑⠋"
    client.receive(writing("⠓⠊".encode(), region=(3, 2), charset=b"UTF-8"))
    assert cells(among) == "⠿⣭⠓⠊⠑⠋"
    # A negative size blanks what is behind; text without masks clears those of before.
    client.receive(writing(b"ab", region=(1, -2)))
    assert cells(among) == "⠁⠃⠀⠀⠀⠀"
    # BRLTTY's own driver sends cells as OR masks under an AND of 0, with the text in UCS-4LE.
    raw = writing("Hallo ".encode("utf-32-le"), region=(1, 6), masks=(bytes(6), b"\x13\x01\x07\x07\x15\0"), cursor=0,
                  charset=b"UCS-4LE")  # fmt: skip
    assert client.receive(raw) == b""
    assert cells(among) == "⠓⠁⠇⠇⠕⠀"
    client.receive(packet("w", bytes(4)))
    assert among.window is None


def test_priorities_then_who_came_last() -> None:
    among = server()
    first, second, third = (entered(among) for _ in range(3))
    for client, words in ((first, b"first"), (second, b"second"), (third, b"third")):
        client.receive(writing(words))
    first.receive(writing(b"again"))
    assert cells(among) == "⠞⠓⠊⠗⠙⠀"
    third.receive(priority(0))
    assert cells(among) == "⠎⠑⠉⠕⠝⠙"
    first.receive(priority(51))
    assert cells(among) == "⠁⠛⠁⠊⠝⠀"
    found = among.press(Key.of("next"))
    assert found is not None
    assert found[0] is first
    among.leave(first)
    second.receive(packet("L"))
    assert among.window is None
    assert among.press(Key.of("next")) is None


def test_bytes_may_come_one_by_one() -> None:
    whole = HELLO + packet("s") + ENTER + writing(b"abcdef") + packet("?") + packet("s")
    together, apart = server(), server()
    client, other = together.join(), apart.join()
    answers = b"".join(other.receive(bytes([byte])) for byte in whole)
    assert client.receive(whole) == answers
    assert cells(together) == cells(apart) == "⠁⠃⠉⠙⠑⠋"


def test_a_key_is_asked_for_where_there_is_one() -> None:
    among = server(secret=b"secret\n")
    right, wrong, rude = (among.join() for _ in range(3))
    for client in (right, wrong):
        assert client.receive(HELLO) == packet("a", struct.pack(">I", ord("K")))
    assert right.receive(packet("a", struct.pack(">I", ord("K")) + b"secret\n") + ENTER) == ACK + ACK
    assert wrong.receive(packet("a", struct.pack(">I", ord("K")) + b"guess") + ENTER) == error(17)
    assert wrong.finished
    assert not right.finished
    assert rude.receive(ENTER) == error(13)
    assert rude.finished
    assert wrong.receive(ENTER + writing(b"felt")) == b""
    assert among.window is None


@pytest.mark.parametrize(
    ("path", "code"), [(b"\0\0\0\1", 7), (b"\0\0\0\0\2x", 7), (b"\xff" * 9, 7), (bytes(4) + b"\2ba", 6)]
)
def test_a_path_that_is_none(path: bytes, code: int) -> None:
    client = server().join()
    assert client.receive(HELLO + packet("t", path))[12:] == error(code)
    assert client.receive(packet("w", bytes(4)))[4:8] == struct.pack(">I", ord("E"))
    assert client.receive(packet("t", struct.pack(">III", 2, 1, 7) + b"\0")) == ACK


def test_an_older_client_is_told_why() -> None:
    client = server().join()
    assert client.receive(packet("v", struct.pack(">I", 7))) == error(13)
    assert client.finished
