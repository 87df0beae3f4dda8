"""Lines of text, cells on a grid, keys from elsewhere."""

from __future__ import annotations

import os
from io import StringIO
from pathlib import Path

import pytest

from chainsim import load_device
from dotwave.bridges.grid_fold import GridFold
from dotwave.bridges.key_inputs import KeyFile, grid_key, keys_typed
from dotwave.bridges.line_source import LineSource
from dotwave.bridges.mirror import LiveMirror, dot_numbers
from dotwave.bridges.run import fold_of
from dotwave.bridges.window import BrailleWindow, Key, KeyName
from dotwave.errors import AppError
from drivers import FileError, GridKey, KeyEvent
from encoders import CellGrid, GridShape


def shown(lines: LineSource) -> tuple[str, str]:
    assert lines.window is not None
    return lines.window.braille, lines.window.text


def test_the_last_whole_line_is_shown() -> None:
    lines = LineSource(GridShape(6, 6))
    assert lines.window is None
    lines.receive(b"one\ntwo\nHel")
    assert shown(lines) == ("⠞⠺⠕⠀⠀⠀", "two")
    lines.receive(b"lo\nrest")
    assert shown(lines) == ("⠠⠓⠑⠇⠇⠕", "Hello")
    lines.end()
    assert shown(lines) == ("⠗⠑⠌⠀⠀⠀", "rest")


def test_pages_of_a_line_turn_by_keys() -> None:
    lines = LineSource(GridShape(6, 6))
    lines.receive(b"Hello and people there\n")
    pages = [shown(lines)]
    for _ in range(3):
        lines.press(Key.of("next"))
        pages.append(shown(lines))
    assert [text for _, text in pages] == ["Hello", "and people there", "and people there", "and people there"]
    lines.press(Key.of("home"))
    assert shown(lines) == pages[0]
    lines.press(Key.of("previous"))
    assert shown(lines) == pages[0]
    lines.press(Key.of("bottom"))
    assert shown(lines) == pages[-1]


@pytest.mark.parametrize("line", [b"", b"   ", b"\0", b"\xff\xfe", b"\x1b[2J", "⠓⠊".encode(), b"x" * 100_000])
def test_any_line_is_a_window(line: bytes) -> None:
    lines = LineSource(GridShape(6, 6))
    lines.receive(line + b"\n")
    assert lines.window is not None
    lines.receive(b"good\n")
    assert shown(lines)[1] == "good"


def test_six_cells_are_folded_and_wide_grids_are_not() -> None:
    narrow = fold_of(load_device("linked-6x6"))
    assert (narrow.columns, narrow.rows, narrow.dots) == (6, 1, 6)
    assert [narrow.place(cell) for cell in range(6)] == [(0, 0), (0, 1), (0, 2), (1, 0), (1, 1), (1, 2)]
    wide = fold_of(load_device("linked-40x96"))
    assert (wide.columns, wide.rows, wide.dots) == (48, 10, 8)


@pytest.mark.parametrize("rows", [3, 4, 6, 8, 12, 24])
def test_a_source_is_told_the_cells_that_the_grid_shows(rows: int) -> None:
    fold = fold_of(load_device("linked-6x6").model_copy(update={"rows": rows}))
    grid = CellGrid(GridShape(rows, 6))
    assert (fold.lines, fold.per_line, fold.dots) == (grid.lines, grid.cells_per_line, grid.dots)


def test_a_grid_without_room_for_a_cell_is_named() -> None:
    with pytest.raises(AppError, match="linked-6x6: a grid of 2 x 6 actuators has no room for a cell"):
        fold_of(load_device("linked-6x6").model_copy(update={"rows": 2}))


def test_dots_seven_and_eight_are_left_out_where_there_are_none() -> None:
    window = BrailleWindow(b"\xc1\xff\x40", cursor=None)
    assert GridFold(2, 3).braille(window) == "⠁⠿⠀⠀⠀⠀"
    assert GridFold(1, 3, 8).braille(window) == "⣁⣿⡀"


@pytest.mark.parametrize(("dots", "cells", "drawn"), [(6, "⠓⠿", "⠿⠀"), (8, "⠓⣿", "⣓⠿")])
def test_the_cursor_always_differs_from_its_cell(dots: int, cells: str, drawn: str) -> None:
    fold = GridFold(1, 2, dots)
    for cell in (0, 1):
        window = BrailleWindow(bytes(ord(char) - 0x2800 for char in cells), cursor=cell)
        assert fold.braille(window) == cells
        assert fold.braille(window, cursor_drawn=True)[cell] == drawn[cell]
    assert fold.braille(BrailleWindow(b"\1", cursor=9), cursor_drawn=True) == "⠁⠀"


def test_keys_of_the_grid_and_of_the_terminal() -> None:
    assert grid_key(KeyEvent(GridKey.NEXT)) == Key(KeyName.NEXT)
    assert grid_key(KeyEvent(GridKey.NEXT, down=False)) is None
    assert grid_key(KeyEvent.over(5)) == Key(KeyName.ROUTE, 5)
    assert grid_key(KeyEvent(99)) is None
    assert list(map(str, keys_typed("n\x1b[D3x\x1b[A"))) == ["next", "previous", "route 2", "up"]


@pytest.mark.parametrize("kind", ["file", "pipe"])
def test_a_key_file_gives_what_is_added(kind: str, tmp_path: Path) -> None:
    path = tmp_path / "keys"
    if kind == "pipe":
        os.mkfifo(path)
    else:
        path.write_text("previous\n")
    keys = KeyFile(path)
    try:
        assert keys.read() == ([], "")
        with path.open("a") as file:
            file.write("next\nroute 3\nrou")
        assert keys.read() == ([Key.of("next"), Key.of("route 3")], "")
        with path.open("a") as file:
            file.write("te 4\njump\n")
        found, wrong = keys.read()
        assert found == [Key.of("route 4")]
        assert "got 'jump'" in wrong
    finally:
        keys.close()


def test_a_key_file_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(FileError, match="keys"):
        KeyFile(tmp_path / "keys")


def test_the_mirror_writes_lines_that_can_be_read_aloud() -> None:
    out = StringIO()
    mirror = LiveMirror(out, 3)
    mirror.stood("⠠⠓⠑⠇⠇⠕", "Hel\x1b[2Jlo", 0.1271)
    mirror.stood("", "", None)
    assert out.getvalue() == "⠠⠓⠑ ⠇⠇⠕; dots 6 125 15 123 123 135; Hel\\u001b[2Jlo; 127 ms\nat rest\n"
    assert dot_numbers("⠀⣿") == "0 12345678"
