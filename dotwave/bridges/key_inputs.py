"""Keys that come from elsewhere than the screen reader: buttons beside the grid, a file or pipe, the terminal."""

from __future__ import annotations

import os
import stat
import sys
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from drivers import GridKey, KeyEvent, naming

from .window import Key, KeyName

__all__ = ["KeyFile", "TerminalKeys", "grid_key", "keys_typed"]

_GRID = {
    GridKey.PREVIOUS: KeyName.PREVIOUS, GridKey.NEXT: KeyName.NEXT, GridKey.HOME: KeyName.HOME,
    GridKey.UP: KeyName.UP, GridKey.DOWN: KeyName.DOWN,
}  # fmt: skip
_TYPED = {
    "\x1b[D": KeyName.PREVIOUS, "\x1b[C": KeyName.NEXT, "\x1b[A": KeyName.UP, "\x1b[B": KeyName.DOWN,
    "\x1b[H": KeyName.HOME, "p": KeyName.PREVIOUS, "n": KeyName.NEXT, " ": KeyName.NEXT, "u": KeyName.UP,
    "d": KeyName.DOWN, "h": KeyName.HOME, "t": KeyName.TOP, "b": KeyName.BOTTOM,
}  # fmt: skip
_MOST = 4096


def grid_key(event: KeyEvent) -> Key | None:
    """The key of a button that went down; None for one that went up or has no meaning here."""
    if not event.down:
        return None
    if event.cell is not None:
        return Key(KeyName.ROUTE, event.cell)
    name = _GRID.get(GridKey(event.code)) if event.code in list(GridKey) else None
    return None if name is None else Key(name)


def keys_typed(typed: str) -> Iterator[Key]:
    """Keys of what was typed: arrows or p n u d h t b, and 1 to 9 for the cell of that place."""
    at = 0
    while at < len(typed):
        size = 3 if typed[at : at + 3] in _TYPED else 1
        word = typed[at : at + size]
        if word in _TYPED:
            yield Key(_TYPED[word])
        elif word in "123456789":
            yield Key(KeyName.ROUTE, int(word) - 1)
        at += size


class KeyFile:
    """A file or named pipe to which lines such as ``next`` or ``route 3`` are added; only what is new counts.

    Raises
    ------
    FileError
        When it cannot be opened.
    """

    def __init__(self, path: Path) -> None:
        self._rest = b""
        with naming(path):
            pipe = stat.S_ISFIFO(path.stat().st_mode)
            # A pipe opened for writing too never ends when its writers go.
            how = (os.O_RDWR if pipe else os.O_RDONLY) | getattr(os, "O_NONBLOCK", 0)
            self._number = os.open(path, how)
            if not pipe:
                os.lseek(self._number, 0, os.SEEK_END)

    def read(self) -> tuple[list[Key], str]:
        """Keys that came since, and what is wrong with the last line that is none."""
        with suppress(BlockingIOError):
            self._rest += os.read(self._number, _MOST)
        *lines, self._rest = self._rest.split(b"\n")
        self._rest = self._rest[:_MOST]
        keys, wrong = [], ""
        for line in filter(None, (line.decode("utf-8", "replace").strip() for line in lines)):
            try:
                keys.append(Key.of(line))
            except ValueError as error:
                wrong = str(error)
        return keys, wrong

    def close(self) -> None:
        """Read no more."""
        os.close(self._number)


class TerminalKeys:
    """Keys typed in the terminal, one by one and without an echo; where there is no terminal there are none."""

    def __init__(self) -> None:
        self._before: list[object] | None = None
        if sys.platform == "win32" or not os.isatty(0):
            return
        import termios
        import tty

        with suppress(termios.error):
            self._before = termios.tcgetattr(0)
            tty.setcbreak(0)

    @property
    def here(self) -> bool:
        """Whether there is a terminal."""
        return self._before is not None

    def read(self) -> list[Key]:
        """Keys that were typed; to be called when there is something to read."""
        with suppress(OSError):
            return list(keys_typed(os.read(0, _MOST).decode("utf-8", "replace")))
        return []

    def close(self) -> None:
        """The terminal as it was."""
        if sys.platform != "win32" and self._before is not None:
            import termios

            with suppress(termios.error):
                termios.tcsetattr(0, termios.TCSADRAIN, self._before)  # type: ignore[arg-type]
            self._before = None
