"""Orca itself, on a desktop without a screen: what has the focus is felt, and it pans when a key asks for it."""

from __future__ import annotations

from pathlib import Path

import pytest

from dotwave.bridges.brlapi_port import BrlapiPort
from dotwave.bridges.grid_fold import GridFold
from tests.support.bridge_bytes import server
from tests.support.bridge_clients import running, until
from tests.support.desktop import desktop, needs_orca


@pytest.mark.slow
@needs_orca
def test_orca_moves_through_a_dialog(tmp_path: Path) -> None:
    port, names = BrlapiPort(server()), ("Save", "Open", "Quit")
    cells = {"Save": "⠎⠁⠧⠑⠀⠏", "Open": "⠕⠏⠑⠝⠀⠏", "Quit": "⠟⠥⠊⠞⠀⠏"}
    with running(port, GridFold(2, 3)) as live, desktop(tmp_path, port.number, *names) as dialog:
        # The window that has the focus when Orca is ready is told first.
        until(lambda: live.grid.shown, "Orca")
        for name in ("Open", "Save", "Quit", "Save"):
            dialog.focus(name)
            until(lambda wanted=cells[name]: live.grid.last == wanted, live.grid)  # type: ignore[misc]
        for key, wanted in (("next", "⠏⠥⠎⠓⠀⠃"), ("next", "⠃⠥⠞⠞⠕⠝"), ("previous", "⠀⠏⠥⠎⠓⠀")):
            live.press(key)
            until(lambda wanted=wanted: live.grid.last == wanted, live.grid)  # type: ignore[misc]
        assert port.window is not None
        assert port.window.text == " push "
