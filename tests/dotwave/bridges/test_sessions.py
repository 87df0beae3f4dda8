"""Sessions: windows to the grid, the cursor, keys, recordings, and recordings played again."""

from __future__ import annotations

import asyncio
import json
from io import BytesIO, StringIO
from pathlib import Path
from typing import Any

import pytest

from dotwave import AppError
from dotwave.bridges import session as session_module
from dotwave.bridges.brlapi_port import PIPE, BrlapiLine, BrlapiPort, serve_pipe
from dotwave.bridges.grid_fold import GridFold
from dotwave.bridges.key_inputs import KeyFile
from dotwave.bridges.mirror import LiveMirror
from dotwave.bridges.port import WindowPort
from dotwave.bridges.replay_port import ReplayPort
from dotwave.bridges.session_file import SessionRecord, SessionWriter, fitted, read_session
from dotwave.bridges.window import BrailleWindow, Key
from drivers import GridKey, KeyEvent
from tests.support.bridge_bytes import ACK, ENTER, HELLO, server, writing
from tests.support.bridge_clients import ListeningGrid, running, until

NARROW = GridFold(2, 3)


class Told(WindowPort):
    """A source that shows what it is told to."""

    kind = "told"

    def __init__(self) -> None:
        super().__init__()
        self.now: BrailleWindow | None = None
        self.pressed: list[str] = []
        self.how = ("told",)

    @property
    def window(self) -> BrailleWindow | None:
        return self.now

    async def open(self) -> None:
        pass

    def press(self, key: Key) -> None:
        self.pressed.append(str(key))

    async def close(self) -> None:
        pass


def test_windows_keys_and_what_stood_are_recorded_and_mirrored(tmp_path: Path) -> None:
    port, file, out = Told(), BytesIO(), StringIO()
    (tmp_path / "keys").write_text("")
    writer = SessionWriter(file, "linked-6x6", "told", 6, 1)
    options: dict[str, Any] = {"mirror": LiveMirror(out, 3), "key_file": KeyFile(tmp_path / "keys")}
    with running(port, NARROW, writer=writer, **options) as live:
        port.now = BrailleWindow(b"\x13\x0a", "hi", 1, "client 1")
        live.loop.call_soon_threadsafe(port.changed)
        until(lambda: "hi" in out.getvalue())
        live.session.on_grid_key(KeyEvent(GridKey.NEXT))
        live.session.on_grid_key(KeyEvent(GridKey.NEXT, down=False))
        until(lambda: port.pressed == ["next"])
        with (tmp_path / "keys").open("a") as keys:
            keys.write("route 3\nnonsense\n")
        until(lambda: "nonsense" in out.getvalue())
        port.now = None
        live.loop.call_soon_threadsafe(port.changed)
        until(lambda: live.grid.held)
    assert port.pressed == ["next", "route 3"]
    assert out.getvalue().startswith("⠓⠊⠀ ⠀⠀⠀; dots 125 24 0 0 0 0; hi; 0 ms\n")
    path = tmp_path / "session.jsonl"
    path.write_bytes(file.getvalue())
    record = read_session(path)
    assert [window for _, window in record.windows] == [BrailleWindow(b"\x13\x0a", "hi", 1, "client 1"), None]
    assert [str(key) for _, key in record.keys] == ["next", "route 3"]
    assert (record.device, record.columns, record.rows) == ("linked-6x6", 6, 1)
    assert b'"stands": "\xe2\xa0\x93' in file.getvalue()


def test_the_cursor_blinks_and_is_not_told_as_news(monkeypatch) -> None:
    monkeypatch.setattr(session_module, "CURSOR_PERIOD_S", 0.1)
    port, out = Told(), StringIO()
    with running(port, NARROW, blink=True, mirror=LiveMirror(out, 3)) as live:
        port.now = BrailleWindow(b"\x13\x0a", "hi", 1)
        live.loop.call_soon_threadsafe(port.changed)
        until(lambda: live.grid.shown >= 6)
    assert set(live.grid.shown_cells) == {"⠓⠊⠀⠀⠀⠀", "⠓⠿⠀⠀⠀⠀"}
    assert "⠿" not in out.getvalue()


def test_rows_that_belong_together_are_shown_together() -> None:
    port = Told()
    port.settle_s = 0.02
    with running(port, NARROW) as live:

        def row(number: int) -> None:
            port.now = BrailleWindow(b"\x01" * number)
            port.changed()
            if number < 6:
                live.loop.call_later(0.001, row, number + 1)

        live.loop.call_soon_threadsafe(row, 1)
        until(lambda: live.grid.last == "⠁" * 6, live.grid)
    assert live.grid.shown <= 2


def test_the_end_of_the_source_is_the_end_of_the_session() -> None:
    port = Told()
    with running(port, NARROW) as live:
        port.now = BrailleWindow(b"\1")
        live.loop.call_soon_threadsafe(port.changed)
        until(lambda: live.grid.shown)
        port.ended = True
        live.loop.call_soon_threadsafe(port.changed)
        until(lambda: live.grid.held == 1)


def recorded(path: Path, *windows: tuple[float, BrailleWindow | None], columns: int = 6, rows: int = 1) -> Path:
    with path.open("wb") as file:
        writer = SessionWriter(file, "linked-6x6", "brlapi", columns, rows)
        for t, window in windows:
            writer.came(t, window)
        writer.end(windows[-1][0])
    return path


def test_a_replay_shows_the_same_windows_on_another_grid(tmp_path: Path) -> None:
    windows = [(0.01 * at, BrailleWindow(bytes([1, at]), f"a{at}", 1)) for at in range(1, 20)]
    path = recorded(tmp_path / "s.jsonl", *windows, (0.3, None))
    wide = GridFold(10, 48, 8)
    record = fitted(read_session(path), wide, path)
    port = ReplayPort(record)
    with running(port, wide) as live:
        until(lambda: port.ended)
        until(lambda: live.grid.held)
    felt = [cells.rstrip("⠀") for cells in live.grid.shown_cells]
    wanted = [window.braille for _, window in windows]
    # Of windows that came too close together the last is shown; none is shown out of turn, and the last always.
    assert felt[-1] == wanted[-1]
    assert felt == [cells for cells in wanted if cells in felt]
    assert [w and w.braille.rstrip("⠀") for _, w in record.windows] == [*wanted, None]


def test_lines_are_kept_where_the_other_grid_has_longer_ones(tmp_path: Path) -> None:
    path = recorded(tmp_path / "s.jsonl", (0.0, BrailleWindow(b"\1\2\3\4", "abcd", 3)), columns=2, rows=2)
    record = fitted(read_session(path), GridFold(2, 3), path)
    window = record.windows[0][1]
    assert window is not None
    assert (window.braille, window.cursor) == ("⠁⠂⠀⠃⠄⠀", 4)


@pytest.mark.parametrize(("columns", "rows", "cells"), [(48, 10, 480), (7, 1, 7), (2, 3, 6)])
def test_a_grid_without_room_is_refused(columns: int, rows: int, cells: int, tmp_path: Path) -> None:
    path = recorded(tmp_path / "s.jsonl", (0.0, BrailleWindow(b"\1" * cells)), columns=columns, rows=rows)
    with pytest.raises(AppError, match=f"s.jsonl: its windows of {columns} x {rows} cells have no room"):
        fitted(read_session(path), NARROW, path)


HEAD = {"session": "dotwave", "version": 1, "device": "d", "columns": 6, "rows": 1}


@pytest.mark.parametrize(
    ("lines", "said"),
    [
        ([], "empty"), (["{"], ":1: "), (["[]"], ":1: "), ([{}], ":1: .*does not say"),
        ([HEAD | {"version": 2}], ":1: .*version 2"), ([HEAD | {"columns": 0}], "columns"),
        ([HEAD, {"t": -1, "cells": "⠁"}], ":2: .*t: "), ([HEAD, {"t": 2, "cells": "⠁"}, {"t": 1}], ":3: .*before 2"),
        ([HEAD, {"t": 0, "cells": "abc"}], ":2: .*cells"), ([HEAD, {"t": 0, "cells": "⠁", "cursor": "x"}], "cursor"),
        ([HEAD, {"t": 0, "key": "jump"}], ":2: .*jump"), ([HEAD, {"t": 1e999, "cells": "⠁"}], ":2: .*t: "),
        ([HEAD | {"device": 3}], "device"), (["[" * 100_000], ":1: "),
    ],
)  # fmt: skip
def test_a_recording_that_is_none_says_the_line(lines: list[Any], said: str, tmp_path: Path) -> None:
    path = tmp_path / "s.jsonl"
    path.write_text("".join((line if isinstance(line, str) else json.dumps(line)) + "\n" for line in lines))
    with pytest.raises(AppError, match=said):
        read_session(path)


def test_a_record_has_no_times_of_day(tmp_path: Path) -> None:
    one, two = (recorded(tmp_path / name, (0.5, BrailleWindow(b"\1"))) for name in ("1.jsonl", "2.jsonl"))
    assert one.read_bytes() == two.read_bytes()
    assert read_session(one) == SessionRecord("linked-6x6", 6, 1, ((0.5, BrailleWindow(b"\1")),), (), 0.5)


class PipeLoop:
    """Stands in for asyncio's loop on Windows: it makes what talks to a client, and hands bytes to it."""

    def __init__(self) -> None:
        self.path = ""
        self.line: BrlapiLine | None = None

    async def start_serving_pipe(self, factory: Any, path: str) -> list[PipeLoop]:
        self.path, self.line = path, factory()
        return [self]

    def close(self) -> None:
        self.path = ""


class PipeEnd(asyncio.Transport):
    """A client's end of such a pipe."""

    def __init__(self) -> None:
        super().__init__()
        self.heard = b""
        self.closed = False

    def write(self, data: Any) -> None:
        self.heard += bytes(data)

    def get_write_buffer_size(self) -> int:
        return 0

    def is_closing(self) -> bool:
        return self.closed

    def abort(self) -> None:
        self.closed = True


def test_the_pipe_that_nvda_looks_for_speaks_the_same() -> None:
    port, end = BrlapiPort(server()), PipeEnd()

    async def talk() -> None:
        loop = PipeLoop()
        listening = await serve_pipe(loop, port.line)  # type: ignore[arg-type]
        assert loop.path == PIPE == r"\\.\pipe\BrlAPI0"
        line = loop.line
        assert line is not None
        line.connection_made(end)
        for at, byte in enumerate(HELLO + ENTER + writing(b"nvda")):
            line.get_buffer(-1)[:1] = bytes([byte])
            line.buffer_updated(1)
            assert not end.closed, at
        assert port.window is not None
        assert port.window.text == "nvda  "
        port.press(Key.of("next"))
        line.connection_lost(None)
        assert port.window is None
        listening[0].close()
        assert not loop.path

    asyncio.run(talk())
    assert end.heard.startswith(HELLO)
    assert ACK in end.heard
    assert end.heard.endswith(b"\x20\x00\x00\x18")


def test_a_system_without_such_pipes_says_so() -> None:
    with pytest.raises(AppError, match="no named pipes"):
        asyncio.run(serve_pipe(object(), lambda: BrlapiLine(BrlapiPort(server()))))  # type: ignore[arg-type]


def test_ctrl_c_that_comes_with_news_is_not_lost() -> None:
    port = Told()

    async def run() -> None:
        task = asyncio.create_task(session_module.LiveSession(port, ListeningGrid(), NARROW).run(lambda line: None))
        await asyncio.sleep(0.01)
        port.changed()
        task.cancel()
        done, _ = await asyncio.wait([task], timeout=5)
        task.cancel()
        assert done

    asyncio.run(run())


def test_a_grid_that_fails_ends_the_session_with_its_error() -> None:
    class Failing(ListeningGrid):
        def show(self, what: str, note: str | None = None) -> None:
            raise AppError("the cable is out")

    port = Told()
    port.now = BrailleWindow(b"\1")

    async def run() -> None:
        session = session_module.LiveSession(port, Failing(), NARROW)
        asyncio.get_running_loop().call_later(0.01, lambda: port.changed())
        await session.run(lambda line: None)

    with pytest.raises(AppError, match="cable"):
        asyncio.run(run())
