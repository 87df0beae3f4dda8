"""Standard input, a line a window."""

from __future__ import annotations

import asyncio
import os
import threading

from .line_source import LineSource
from .port import WindowPort
from .window import BrailleWindow, Key

__all__ = ["StdinPort"]


class StdinPort(WindowPort):
    """Reads a file number to its end, as far as what was read before is worked off.

    Parameters
    ----------
    lines : makes windows of it.
    number : of the file; standard input by default.
    """

    kind = "lines"

    def __init__(self, lines: LineSource, number: int = 0) -> None:
        super().__init__()
        self._lines, self._number = lines, number
        self._closed = False

    @property
    def window(self) -> BrailleWindow | None:
        """Of the last line."""
        return self._lines.window

    async def open(self) -> None:
        """Begin to read, on a thread: not every standard input can be waited for otherwise."""
        self.how = ("a line on standard input is a window; the end of the input ends it",)
        threading.Thread(target=self._read, args=(asyncio.get_running_loop(),), daemon=True).start()

    def press(self, key: Key) -> None:
        """Turn the pages of the line."""
        self._lines.press(key)
        self.changed()

    async def close(self) -> None:
        """Take no more."""
        self._closed = True

    def _read(self, loop: asyncio.AbstractEventLoop) -> None:
        data = b"-"
        while data and not self._closed:
            try:
                data = os.read(self._number, 4096)
            except OSError:
                data = b""
            taken = threading.Event()
            try:
                loop.call_soon_threadsafe(self._take, data, taken)
            except RuntimeError:
                return  # the loop is closed: nobody wants it any more
            taken.wait()

    def _take(self, data: bytes, taken: threading.Event) -> None:
        if data:
            self._lines.receive(data)
        else:
            self._lines.end()
            self.ended = True
        self.changed()
        taken.set()
