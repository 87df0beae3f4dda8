"""The emulated displays, byte by byte."""

from __future__ import annotations

import pytest

from dotwave.bridges.baum import BaumDisplay
from dotwave.bridges.canute import CanuteDisplay, crc_x25
from dotwave.bridges.window import Key

# What BRLTTY 6.5 sends to a Baum when it starts.
PROBE = bytes.fromhex("1b8a 1b84 1b0100 1b08 1b5005 0000000004")


def written(display: BaumDisplay | CanuteDisplay) -> str:
    return display.window.braille if display.window else ""


def test_brltty_finds_a_baum() -> None:
    answers = BaumDisplay(6).receive(PROBE)
    assert answers == b"\x1b\x8adotwave \x1b\x84dotwave 6       \x1b\x01\x06\x1b\x24\x00"


def test_nvda_finds_a_baum() -> None:
    """It asks for cells without any data, before it asks who is there."""
    assert BaumDisplay(40).receive(bytes.fromhex("1b1501 1b01 1b84")) == b"\x1b\x01\x28\x1b\x84dotwave 40      "


def test_a_baum_takes_cells_in_any_pieces() -> None:
    display = BaumDisplay(6)
    whole = PROBE + b"\x1b\x01\x1b\x1b\x01\x07\x00\x1b\x1b\xff" + b"\x1b\x01\x01\x02"
    for byte in whole:
        display.receive(bytes([byte]))
    assert written(display) == "⠛⠁⠇⠀⠛⣿"
    display.receive(b"\x03\x04\x05\x06")
    assert written(display) == "⠁⠂⠃⠄⠅⠆"


@pytest.mark.parametrize(("cells", "size"), [(6, 5), (40, 5), (48, 10), (80, 10), (84, 11)])
def test_keys_of_a_baum(cells: int, size: int) -> None:
    display = BaumDisplay(cells)
    assert display.press(Key.of("next")) == b"\x1b\x24\x10"
    assert display.press(Key.of("previous")) == b"\x1b\x24\x02"
    assert display.release(Key.of("next")) == b"\x1b\x24\x00"
    last = Key.of(f"route {cells - 1}")
    data = display.press(last).replace(b"\x1b\x1b", b"\x1b")
    assert data[:2] == b"\x1b\x22"
    assert data[2:] == (1 << cells - 1).to_bytes(size, "little")
    assert display.release(last) == b"\x1b\x22" + bytes(size)
    assert display.press(Key.of(f"route {cells}")) == b""
    assert display.press(Key.of("top")) == b""
    # An ESC in the data is doubled.
    assert BaumDisplay(6).press(Key.of("route 4")) == b"\x1b\x22\x10" + bytes(4)


def framed(body: bytes) -> bytes:
    whole = body + crc_x25(body).to_bytes(2, "little")
    return b"\x7e" + whole.replace(b"\x7d", b"\x7d\x5d").replace(b"\x7e", b"\x7d\x5e") + b"\x7e"


def bodies(data: bytes) -> list[bytes]:
    found = []
    for part in data.split(b"\x7e"):
        body = part.replace(b"\x7d\x5e", b"\x7e").replace(b"\x7d\x5d", b"\x7d")
        if body:
            assert crc_x25(body[:-2]).to_bytes(2, "little") == body[-2:]
            found.append(body[:-2])
    return found


def test_the_checksum_is_that_of_hdlc() -> None:
    assert crc_x25(b"123456789") == 0x906E


def test_brltty_finds_a_canute() -> None:
    display = CanuteDisplay(3, 2)
    asked = b"".join(framed(bytes([code])) for code in (0, 1, 3, 0x0B, 0x0D))
    assert bodies(display.receive(asked)) == [b"\0\3\0", b"\1\2\0", b"\3\1\0", b"\x0bdotwave", b"\x0d\0\0"]
    assert display.idle() == b""


def test_rows_of_a_canute_are_answered_before_they_are_asked_for() -> None:
    display = CanuteDisplay(3, 2)
    assert bodies(display.receive(framed(b"\6\1\x41\x7e\x7d"))) == [b"\6\0\0", b"\x0d\0\0", b"\x0a\0\0"]
    assert written(display) == "⠀⠀⠀⠁⠾⠽"
    assert bodies(display.idle()) == [b"\x0a\0\0"]
    for wrong in (framed(b"\6\2abc"), framed(b"\6\0ab"), framed(b"\6"), b"\x7e\6\0abc\0\0\x7e", b"\x7e\x7d\x7e"):
        display.receive(wrong)
    assert written(display) == "⠀⠀⠀⠁⠾⠽"
    display.receive(framed(b"\7"))
    assert written(display) == "⠀" * 6


def test_keys_of_a_canute() -> None:
    display = CanuteDisplay(3, 2)
    display.receive(framed(b"\6\0abc"))
    for words, bits in {"next": 0x3000, "previous": 0x1800, "up": 0x800, "route 4": 8, "route 9": 0}.items():
        assert bodies(display.press(Key.of(words))) == [b"\x0a" + bits.to_bytes(2, "little")]
        assert bodies(display.receive(framed(b"\x0a"))) == [b"\x0a" + bits.to_bytes(2, "little")]
        assert bodies(display.release(Key.of(words))) == [b"\x0a\0\0"]


def test_sizes_that_cannot_be() -> None:
    for cells in (0, 85):
        with pytest.raises(ValueError, match="1 to 84"):
            BaumDisplay(cells)
    with pytest.raises(ValueError, match="256 x 1"):
        CanuteDisplay(256, 1)
