"""Recordings of sessions, `.jsonl`: what came and went, with its times; written and read."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, BinaryIO

from drivers import naming

from ..errors import AppError
from ..plain import one_line
from .grid_fold import GridFold
from .window import BLANK_CELL, BrailleWindow, Key, cells_of_braille

__all__ = ["SESSION_VERSION", "SessionRecord", "SessionWriter", "fitted", "read_session"]

SESSION_VERSION = 1
_LARGEST = 512 << 20


class SessionWriter:
    """Writes a recording line by line.

    Parameters
    ----------
    file : where to; whoever opened it closes it.
    device : name of the device.
    source : where the windows come from.
    columns, rows : of cells, as the screen reader was told.
    """

    def __init__(self, file: BinaryIO, device: str, source: str, columns: int, rows: int) -> None:
        self._file = file
        self._line(session="dotwave", version=SESSION_VERSION, device=device, source=source, columns=columns, rows=rows)

    def came(self, t: float, window: BrailleWindow | None) -> None:
        """A window at `t` seconds, or nobody is left to write one."""
        if window is None:
            self._line(t=round(t, 4), gone=True)
            return
        cursor = {} if window.cursor is None else {"cursor": window.cursor}
        self._line(t=round(t, 4), cells=window.braille, text=window.text, **cursor, note=window.note)

    def went(self, t: float, key: Key) -> None:
        """A key, to whoever wrote the window."""
        self._line(t=round(t, 4), key=str(key))

    def stood(self, t: float, cells: str, latency_s: float | None) -> None:
        """What stands on the grid, and how long after it was shown."""
        late = {} if latency_s is None else {"latency_s": round(latency_s, 4)}
        self._line(t=round(t, 4), stands=cells, **late)

    def end(self, t: float) -> None:
        """It is over."""
        self._line(t=round(t, 4), end=True)

    def _line(self, **what: Any) -> None:
        self._file.write(json.dumps(what, ensure_ascii=False).encode("utf-8", "backslashreplace") + b"\n")


@dataclass(frozen=True)
class SessionRecord:
    """What was recorded.

    Attributes
    ----------
    device : name of the device it was recorded on.
    columns, rows : of cells, as the screen reader was told.
    windows : seconds and window, in order; None where nobody was left.
    keys : seconds and key, in order.
    seconds : length of all.
    """

    device: str
    columns: int
    rows: int
    windows: tuple[tuple[float, BrailleWindow | None], ...]
    keys: tuple[tuple[float, Key], ...]
    seconds: float


def read_session(path: Path) -> SessionRecord:
    """Read a recording.

    Raises
    ------
    AppError, FileError
        With the line that is wrong, and what was expected.
    """
    with naming(path), path.open("rb") as file:
        data = file.read(_LARGEST + 1)
    if len(data) > _LARGEST:
        raise AppError(f"{path}: larger than {_LARGEST >> 20} MB; replay a part of it")
    windows: list[tuple[float, BrailleWindow | None]] = []
    keys: list[tuple[float, Key]] = []
    head: Mapping[str, Any] = {}
    t = 0.0
    for number, line in enumerate(data.splitlines(), 1):
        try:
            what = json.loads(line)
            if not isinstance(what, dict):
                raise ValueError("expected an object")
            if number == 1:
                head = _head(what)
                continue
            t = _time(what, t)
            if "key" in what:
                keys.append((t, Key.of(str(what["key"]))))
            elif "cells" in what or "gone" in what:
                windows.append((t, _window(what)))
        except (ValueError, RecursionError) as error:
            raise AppError(f"{path}:{number}: not a line of a session: {one_line(str(error))}") from None
    if not head:
        raise AppError(f"{path}: empty; `dotwave live --record` writes sessions")
    return SessionRecord(head["device"], head["columns"], head["rows"], tuple(windows), tuple(keys), t)


def fitted(record: SessionRecord, fold: GridFold, path: Path) -> SessionRecord:
    """The recording with its cells in the reading order of another grid.

    Raises
    ------
    AppError
        When something was felt where that grid has no cell.
    """
    step, width = record.columns, fold.per_line
    if record.rows == 1 or step == width:
        # One line, folded or not, or the same lines: reading order is all there is to it.
        step, width = record.columns * record.rows, fold.capacity
    windows = []
    for t, window in record.windows:
        placed = None if window is None else _placed(window, step, width, fold.capacity // width)
        if window is not None and placed is None:
            raise AppError(
                f"{path}: its windows of {record.columns} x {record.rows} cells have no room on a grid of "
                f"{fold.per_line} x {fold.lines}; replay it to a larger one"
            )
        windows.append((t, placed))
    return replace(record, windows=tuple(windows))


def _placed(window: BrailleWindow, step: int, width: int, most: int) -> BrailleWindow | None:
    """Lines of `step` cells as at most `most` lines of `width`; None where cells with dots have no room."""
    lines = [window.cells[at : at + step].rstrip(b"\0") for at in range(0, len(window.cells), step)]
    if any(len(line) > width for line in lines) or any(lines[most:]):
        return None
    cells = b"".join(line.ljust(width, b"\0") for line in lines[:most])
    line, column = divmod(window.cursor or 0, step)
    return replace(window, cells=cells, cursor=None if window.cursor is None else line * width + column)


def _head(what: Mapping[str, Any]) -> Mapping[str, Any]:
    if what.get("session") != "dotwave":
        raise ValueError("the first line does not say that it is a session of dotwave")
    if what.get("version") != SESSION_VERSION:
        raise ValueError(f"version {what.get('version')!r}, and this dotwave reads {SESSION_VERSION}")
    for name in ("columns", "rows"):
        if type(what.get(name)) is not int or not 1 <= what[name] <= 65536:
            raise ValueError(f"{name}: expected a whole number > 0, got {what.get(name)!r}")
    if not isinstance(what.get("device"), str):
        raise ValueError("device: expected a name")
    return what


def _time(what: Mapping[str, Any], before: float) -> float:
    t = what.get("t")
    if isinstance(t, bool) or not isinstance(t, int | float) or not math.isfinite(t) or t < before:
        raise ValueError(f"t: expected seconds, not before {before}, got {t!r}")
    return float(t)


def _window(what: Mapping[str, Any]) -> BrailleWindow | None:
    if "gone" in what:
        return None
    cells, text, cursor = what["cells"], what.get("text", ""), what.get("cursor")
    if not isinstance(cells, str) or not all(BLANK_CELL <= ord(char) <= BLANK_CELL + 0xFF for char in cells):
        raise ValueError(f"cells: expected Unicode Braille, got {cells!r}")
    if not isinstance(text, str) or (cursor is not None and (type(cursor) is not int or cursor < 0)):
        raise ValueError("text and cursor: expected characters, and a cell from 0")
    return BrailleWindow(cells_of_braille(cells), text, cursor, str(what.get("note", "")))
