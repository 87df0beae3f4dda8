"""Noise, floods, and clients that end anywhere: no bridge ends, grows, or forgets the next good client."""

from __future__ import annotations

import os
import random
import socket
import struct
import subprocess
import time
import tracemalloc
from collections.abc import Callable
from pathlib import Path

import pytest

from dotwave.bridges.baum import BaumDisplay
from dotwave.bridges.brlapi_port import BrlapiPort
from dotwave.bridges.canute import CanuteDisplay, crc_x25
from dotwave.bridges.grid_fold import GridFold
from dotwave.bridges.line_source import LineSource
from dotwave.bridges.pty_port import PtyPort
from dotwave.bridges.window import Key, KeyName
from encoders import GridShape
from tests.support.bridge_bytes import ACK, ENTER, HELLO, entered, packet, priority, server, writing
from tests.support.bridge_clients import SYSTEM_PYTHON, running, until

NARROW = GridFold(2, 3)
FEW, MANY = 2_000, 100_000
GROWTH_BYTES = 200_000

how_many = pytest.mark.parametrize("count", [FEW, pytest.param(MANY, marks=pytest.mark.slow)])


def noise(chance: random.Random, size: int) -> bytes:
    return chance.randbytes(chance.randrange(size))


def spoiled(chance: random.Random, good: bytes) -> bytes:
    """As it is, cut, or with some bytes changed."""
    data = bytearray(good)
    for _ in range(chance.choice((0, 0, 1, 3))):
        data[chance.randrange(len(data))] = chance.randrange(256)
    return bytes(data[: chance.randrange(1, len(data) + 1)] if chance.random() < 0.1 else data)


def brlapi_packet(chance: random.Random) -> bytes:
    at = chance.randrange(99)
    masks = (chance.choice((None, chance.randbytes(6))), chance.choice((None, chance.randbytes(6))))
    kinds: list[Callable[[], bytes]] = [
        lambda: writing(noise(chance, 12), charset=chance.choice((None, b"UTF-8", b"UCS-4LE", noise(chance, 9)))),
        lambda: writing(b"abcdef"[: chance.randrange(7)], masks=masks, cursor=chance.randrange(9)),
        lambda: writing(b"abc", region=(chance.randrange(8), chance.randrange(-8, 8))),
        lambda: packet(chance.choice("vasntFLmuw*#pSRZ?"), noise(chance, 40)),
        lambda: packet(chance.choice("mu"), struct.pack(">QQ", *sorted(chance.getrandbits(64) for _ in range(2)))),
        lambda: packet(chance.choice(("PV", "PR")), struct.pack(">IIQI", 256, chance.randrange(40), 0, at)),
        lambda: priority(chance.randrange(120)), lambda: ENTER, lambda: noise(chance, 60),
    ]  # fmt: skip
    return spoiled(chance, chance.choice(kinds)() or b"\0")


def flat(work: Callable[[int], None], count: int) -> None:
    """`work` leaves nothing behind: after its second half there is as much as after its first."""
    tracemalloc.start()
    try:
        for at in range(count // 2):
            work(at)
        before = tracemalloc.get_traced_memory()[0]
        for at in range(count // 2, count):
            work(at)
        assert tracemalloc.get_traced_memory()[0] - before < GROWTH_BYTES
    finally:
        tracemalloc.stop()


@how_many
def test_fuzzed_brlapi(count: int) -> None:
    chance, among = random.Random(16), server()
    clients = [entered(among)]

    def work(at: int) -> None:
        client = chance.choice(clients)
        client.receive(brlapi_packet(chance))
        among.press(Key(chance.choice(list(KeyName)), chance.randrange(99)))
        if at % 20 == 0:
            assert among.window is None or len(among.window.cells) == 6
        if client.finished or chance.random() < 0.02:
            among.leave(client)
            clients.remove(client)
        if len(clients) < 1 + at % 4:
            clients.append(entered(among) if chance.random() < 0.8 else among.join())

    flat(work, count)
    for client in clients:
        among.leave(client)
    good = entered(among)
    good.receive(writing(b"good"))
    assert among.window is not None
    assert among.window.text == "good  "


@how_many
def test_fuzzed_baum(count: int) -> None:
    chance, display = random.Random(16), BaumDisplay(6)
    good = b"\x1b\x01\x01\x02\x03\x04\x05\x06"

    def work(at: int) -> None:
        kind = chance.choice((b"\x01", b"\x84", b"\x8a", b"\x08", b"\x50", noise(chance, 4)))
        display.receive(spoiled(chance, b"\x1b" + kind + noise(chance, 12)))
        display.press(Key(chance.choice(list(KeyName)), chance.randrange(99)))

    flat(work, count)
    # A display may be in the midst of what came before; the frame after that is whole.
    display.receive(good + good)
    assert display.window is not None
    assert display.window.braille == "⠁⠂⠃⠄⠅⠆"


@how_many
def test_fuzzed_canute(count: int) -> None:
    chance, display = random.Random(16), CanuteDisplay(3, 2)

    def framed(body: bytes) -> bytes:
        whole = body + crc_x25(body).to_bytes(2, "little")
        return b"\x7e" + whole.replace(b"\x7d", b"\x7d\x5d").replace(b"\x7e", b"\x7d\x5e") + b"\x7e"

    def work(at: int) -> None:
        display.receive(spoiled(chance, framed(bytes([chance.randrange(16)]) + noise(chance, 6))) + noise(chance, 4))
        display.press(Key(chance.choice(list(KeyName)), chance.randrange(99)))

    flat(work, count)
    display.receive(b"\x7e" + framed(b"\6\0\1\2\3") + framed(b"\6\1\4\5\6"))
    assert display.window is not None
    assert display.window.braille == "⠁⠂⠃⠄⠅⠆"


@how_many
def test_fuzzed_lines(count: int) -> None:
    chance, lines = random.Random(16), LineSource(GridShape(6, 6))
    looks = 0

    def work(at: int) -> None:
        nonlocal looks
        lines.receive(noise(chance, 60))
        # A look lays the line out, and the tables remember each character they were asked for: few are enough.
        if at % (count // 8) == 7 and at < count // 2:
            looks += lines.window is not None
            lines.press(Key(chance.choice(list(KeyName))))

    flat(work, count)
    assert looks >= 3
    lines.receive(b"\ngood\n")
    assert lines.window is not None
    assert lines.window.text == "good"


def connected(port: BrlapiPort) -> socket.socket:
    return socket.create_connection(("127.0.0.1", 4101 + port.number), timeout=20)


def good_client(port: BrlapiPort, words: bytes) -> socket.socket:
    line = connected(port)
    line.sendall(HELLO + ENTER + writing(words))
    heard = b""
    while not heard.endswith(ACK):
        part = line.recv(100)
        assert part, heard
        heard += part
    return line


def test_clients_that_end_anywhere_leave_room_for_the_next() -> None:
    port = BrlapiPort(server())
    whole = HELLO + ENTER + writing(b"abcdef")
    with running(port, NARROW) as live:
        for cut in range(0, len(whole), 3):
            with connected(port) as line:
                line.sendall(whole[:cut])
        for garbage in (b"GET / HTTP/1.0\r\n\r\n", b"\xff" * 5000, bytes(5000), os.urandom(5000)):
            with connected(port) as line:
                line.sendall(garbage)
        killed = connected(port)
        killed.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        killed.sendall(whole + writing(b"half")[:9])
        until(lambda: live.grid.last == "⠁⠃⠉⠙⠑⠋", live.grid)
        killed.close()
        until(lambda: live.grid.held, live.grid)
        with good_client(port, b"good"):
            until(lambda: live.grid.last == "⠛⠕⠕⠙⠀⠀", live.grid)


def test_forty_silent_clients_and_one_that_never_reads() -> None:
    port = BrlapiPort(server())
    with running(port, NARROW) as live:
        silent = [connected(port) for _ in range(40)]
        greedy = connected(port)
        greedy.setblocking(False)
        asked = HELLO + packet("n") * 100
        greedy.send(HELLO)
        sent = 0
        try:
            for _ in range(100_000):
                sent += greedy.send(asked[12:])
        except (BlockingIOError, ConnectionError):
            pass
        with good_client(port, b"good"):
            until(lambda: live.grid.last == "⠛⠕⠕⠙⠀⠀", live.grid)
        assert len(port.server.clients) <= 32
        for line in [*silent, greedy]:
            line.close()


def test_two_clients_that_fight_do_not_make_the_display_flicker() -> None:
    port = BrlapiPort(server())
    with running(port, NARROW) as live, good_client(port, b"first") as first, good_client(port, b"second") as second:
        until(lambda: live.grid.last == "⠎⠑⠉⠕⠝⠙", live.grid)
        before = live.grid.shown
        for at in range(500):
            first.sendall(writing(f"one{at}".encode()))
            second.sendall(writing(b"second"))
        first.sendall(priority(60) + writing(b"first"))
        until(lambda: live.grid.last == "⠋⠊⠗⠎⠞⠀", live.grid)
        # The one that has the display wrote one thing; then the other took it.
        assert live.grid.shown - before <= 3


def test_a_flood_is_not_queued() -> None:
    port = BrlapiPort(server())
    with running(port, NARROW) as live, good_client(port, b"flood") as line:
        line.sendall(b"".join(writing(f"{at:06}".encode()) for at in range(20_000)) + writing(b"last"))
        until(lambda: live.grid.last == "⠇⠁⠎⠞⠀⠀", live.grid)
        assert live.grid.shown < 5_000


@pytest.mark.slow
def test_two_thousand_windows_a_second_for_a_minute() -> None:
    port = BrlapiPort(server())
    with running(port, NARROW) as live, good_client(port, b"flood") as line:
        tracemalloc.start()
        try:
            sizes, began = [], time.monotonic()
            for at in range(120_000):
                line.sendall(writing(f"{at:06}".encode()))
                if at % 20_000 == 19_999:
                    live.grid.shown_cells.clear()
                    sizes.append(tracemalloc.get_traced_memory()[0])
                time.sleep(max(0.0, began + at / 2_000 - time.monotonic()))
            assert sizes[-1] - sizes[0] < 1_000_000
        finally:
            tracemalloc.stop()
        line.sendall(writing(b"last"))
        until(lambda: live.grid.last == "⠇⠁⠎⠞⠀⠀", live.grid)


def test_garbage_on_a_terminal() -> None:
    display = BaumDisplay(6)
    port = PtyPort("baum", display)
    with running(port, NARROW) as live:
        number = os.open(port.name, os.O_RDWR | os.O_NOCTTY)
        os.write(number, random.Random(1).randbytes(3000))
        os.close(number)
        number = os.open(port.name, os.O_RDWR | os.O_NOCTTY)
        os.write(number, b"\x1b\x01\x01\x02\x03\x04\x05\x06" * 2)
        until(lambda: live.grid.last == "⠁⠂⠃⠄⠅⠆", live.grid)
        # Nobody reads the keys: nothing waits for it.
        for _ in range(2_000):
            live.press("next")
        os.write(number, b"\x1b\x01\x06\x05\x04\x03\x02\x01")
        until(lambda: live.grid.last == "⠆⠅⠄⠃⠂⠁", live.grid)
        os.close(number)
        until(lambda: live.grid.held, live.grid)


def test_only_loopback_is_bound() -> None:
    port = BrlapiPort(server())
    with running(port, NARROW):
        wanted = f"{4101 + port.number:04X}"
        lines = [line.split() for line in Path("/proc/net/tcp").read_text().splitlines()[1:]]
        bound = {line[1] for line in lines if line[3] == "0A" and line[1].endswith(":" + wanted)}
        assert bound == {f"0100007F:{wanted}"}
        assert not any(
            line.split()[1].endswith(":" + wanted) and line.split()[3] == "0A"
            for line in Path("/proc/net/tcp6").read_text().splitlines()[1:]
        )


@pytest.mark.skipif(os.name != "posix" or os.geteuid() != 0, reason="only root may become another user")
def test_another_user_without_the_key_is_refused() -> None:
    port = BrlapiPort(server(secret=b"secret"))
    code = (
        "import socket, sys; line = socket.create_connection(('127.0.0.1', int(sys.argv[1])), 20); "
        "line.sendall(bytes.fromhex(sys.argv[2])); print(line.makefile('rb').read().hex())"
    )
    asked = HELLO + packet("a", struct.pack(">I", ord("K")) + b"guess") + ENTER + writing(b"felt")
    with running(port, NARROW) as live:
        ran = subprocess.run(
            [SYSTEM_PYTHON, "-c", code, str(4101 + port.number), asked.hex()],
            user="nobody", capture_output=True, text=True, check=True, timeout=30,
        )  # fmt: skip
        assert bytes.fromhex(ran.stdout)[-4:] == struct.pack(">I", 17)
        assert not live.grid.shown_cells
