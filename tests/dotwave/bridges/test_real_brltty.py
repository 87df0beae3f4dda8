"""BRLTTY itself, and clients of it, on every bridge: the right cells come, keys go back."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path

import pytest

from dotwave.bridges.baum import BaumDisplay
from dotwave.bridges.brlapi import BrlapiServer
from dotwave.bridges.brlapi_client import BrlapiDisplay
from dotwave.bridges.brlapi_port import BrlapiPort
from dotwave.bridges.canute import CanuteDisplay
from dotwave.bridges.glyphs import glyphs
from dotwave.bridges.grid_fold import GridFold
from dotwave.bridges.pty_port import PtyPort
from tests.support.bridge_clients import (
    CONSOLE,
    BrlapiProcess,
    RunningSession,
    brlapi_client,
    brltty,
    free_number,
    needs_brlapi,
    needs_brltty,
    needs_console,
    running,
    until,
    written_through,
)

NARROW = GridFold(2, 3)
FWINRT, FWINLT, ROUTE = 0x20000018, 0x20000017, 0x20010000


def brlapi_port(fold: GridFold = NARROW, **options) -> BrlapiPort:
    return BrlapiPort(BrlapiServer(BrlapiDisplay(fold.columns, fold.rows, "test", **options), glyphs()))


@needs_brlapi
def test_a_client_finds_the_server_and_writes() -> None:
    port = brlapi_port()
    with running(port, NARROW) as live, brlapi_client(host=f"127.0.0.1:{port.number}") as client:
        assert client.ask("get", "displaySize") == [6, 1]
        assert client.ask("get", "driverName") == "dotwave"
        client.ask("enterTtyModeWithPath", [])
        client.ask("writeText", "Hello W")
        # Capitals have dot 7, which six dots leave out.
        until(lambda: live.grid.last == "⠓⠑⠇⠇⠕⠀", live.grid)
        client.ask("write", {"regionBegin": 2, "regionSize": 1, "text": "o", "attrOr": "\xc0", "cursor": 2})
        until(lambda: live.grid.last == "⠓⠕⠇⠇⠕⠀")
        client.send("readKey", True)
        live.press("route 5")
        assert client.answer() == ROUTE + 5


@needs_brlapi
def test_the_client_with_the_highest_priority_has_the_display() -> None:
    port = brlapi_port()
    host = {"host": f"127.0.0.1:{port.number}"}
    with running(port, NARROW) as live:
        host["host"] = f"127.0.0.1:{port.number}"
        with brlapi_client(**host) as first, brlapi_client(**host) as second:
            for client, words in ((first, "first"), (second, "second")):
                client.ask("enterTtyModeWithPath", [])
                client.ask("writeText", words)
            until(lambda: live.grid.last == "⠎⠑⠉⠕⠝⠙")
            second.ask("priority", 0)
            until(lambda: live.grid.last == "⠋⠊⠗⠎⠞⠀")
            first.send("readKey", True)
            live.press("next")
            assert first.answer() == FWINRT
        until(lambda: live.grid.held)


@needs_brltty
@needs_console
def test_a_text_console_on_every_bridge_at_once(tmp_path: Path) -> None:
    """The screen of the console is one; so all three are tried together."""
    api = brlapi_port()
    baum, canute = (
        PtyPort(kind, display) for kind, display in (("baum", BaumDisplay(6)), ("canute", CanuteDisplay(6, 1)))
    )
    with ExitStack() as stack:
        grids = [stack.enter_context(running(port, NARROW)) for port in (api, baum, canute)]
        ways = [
            ["-b", "ba", "-B", f"ba:host=127.0.0.1:{api.number},ba:auth=none"],
            ["-b", "bm", "-d", f"serial:{baum.name}"],
            ["-b", "cn", "-d", f"serial:{canute.name}"],
        ]
        for number, way in enumerate(ways):
            folder = tmp_path / str(number)
            folder.mkdir()
            stack.enter_context(brltty(folder, *way, "-x", "lx", "-N", "-o", "braille-variant=computer6"))
        for words, cells in (("Now o there", "⠝⠕⠺⠀⠕"), ("hello there", "⠓⠑⠇⠇⠕")):
            # BRLTTY draws the cursor into the cells of a display: it stands in the sixth.
            CONSOLE.write_text(f"\033c{words}\033[1;6H")
            for live in grids:
                stands(live, cells)
        for live in grids:
            live.press("next")
            stands(live, "⠞⠓⠑⠗⠑⠀")
            live.press("previous")
            stands(live, "⠓⠑⠇⠇⠕")


@needs_brltty
@needs_brlapi
@pytest.mark.parametrize("driver", ["bm", "cn"])
def test_brltty_on_a_display(driver: str, tmp_path: Path) -> None:
    display = BaumDisplay(6) if driver == "bm" else CanuteDisplay(6, 1)
    port, number = PtyPort("baum" if driver == "bm" else "canute", display, tmp_path / "port"), free_number()
    with running(port, NARROW) as live:
        words = ["-b", driver, "-d", f"serial:{tmp_path / 'port'}", "-x", "no"]
        with brltty(tmp_path, *words, "-A", f"auth=none,host=127.0.0.1:{number}"), written_through(number) as client:
            checked(live, client, routing=driver == "bm")
        # A source that is gone leaves what it wrote standing.
        until(lambda: live.grid.held)


def stands(live: RunningSession, begin: str) -> None:
    until(lambda: live.grid.last.startswith(begin), live.grid)


def checked(live: RunningSession, client: BrlapiProcess, *, routing: bool = True) -> None:
    until(lambda: client.ask("get", "displaySize") == [6, 1], "the display's size")
    client.ask("enterTtyModeWithPath", [])
    client.ask("writeText", "Hello")
    until(lambda: live.grid.last == "⠓⠑⠇⠇⠕⠀", live.grid)
    for words, code in [("next", FWINRT), ("previous", FWINLT)] + [("route 5", ROUTE + 5)] * routing:
        client.send("readKey", True)
        live.press(words)
        assert client.answer() == code
    # What a client makes of the key: it pans.
    client.ask("writeText", " there")
    until(lambda: live.grid.last == "⠀⠞⠓⠑⠗⠑")
