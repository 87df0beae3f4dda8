"""A live session: windows of a source to a grid, keys of the grid and of people back to the source."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field

from drivers import KeyEvent

from .grid_fold import CURSOR_PERIOD_S, GridFold
from .key_inputs import KeyFile, TerminalKeys, grid_key
from .live_grid import GridState, LiveGrid
from .mirror import LiveMirror
from .port import WindowPort
from .session_file import SessionWriter
from .window import BrailleWindow, Key

__all__ = ["LiveSession", "SessionCounts"]

_LOOK_S = 0.05
_PAUSE_S = 0.004
_LONGEST_SETTLING_S = 0.1


@dataclass
class SessionCounts:
    """What came and went.

    Attributes
    ----------
    windows : that differed from the one before.
    keys : that were handed on.
    latencies_s : from a window to the moment its pattern stood, of the last 10,000.
    """

    windows: int = 0
    keys: int = 0
    latencies_s: list[float] = field(default_factory=list)


class LiveSession:
    """Runs until the source has ended and the grid rests, or until it is cancelled.

    Parameters
    ----------
    port : where windows come from.
    grid : where they go.
    fold : how cells stand on the grid.
    blink : whether the cursor is drawn.
    writer : records; None for no recording.
    mirror : shows what is felt; None for not.
    key_file : further keys.
    terminal : keys that are typed.
    """

    def __init__(
        self,
        port: WindowPort,
        grid: LiveGrid,
        fold: GridFold,
        *,
        blink: bool = True,
        writer: SessionWriter | None = None,
        mirror: LiveMirror | None = None,
        key_file: KeyFile | None = None,
        terminal: TerminalKeys | None = None,
    ) -> None:
        self.counts = SessionCounts()
        self._port, self._grid, self._fold, self._blink = port, grid, fold, blink
        self._writer, self._mirror, self._key_file, self._terminal = writer, mirror, key_file, terminal
        self._window: BrailleWindow | None = None
        self._shown = self._covered = ""
        self._stood = 0
        self._refused = ""
        self._held = False
        self._time = 0.0
        self._loop: asyncio.AbstractEventLoop | None = None

    async def run(self, say: Callable[[str], None]) -> None:
        """Listen, and do what comes, until the end.

        Parameters
        ----------
        say : gets lines that tell how to connect.

        Raises
        ------
        AppError, DriverError
            When the source cannot be opened, or playing ends by an error.
        """
        self._loop = asyncio.get_running_loop()
        self._began = self._loop.time()
        news = asyncio.Event()
        self._port.changed = news.set
        try:
            await self._port.open()
            for line in self._port.how:
                say(line)
            if self._terminal is not None and self._terminal.here:
                self._loop.add_reader(0, self._typed)
            while not (self._held and self._idle()):
                await _wait(news, _LOOK_S)
                if news.is_set():
                    await self._settled(news)
                    self._offer()
                    # Of a flood the last is enough.
                    await asyncio.sleep(_PAUSE_S)
                if self._port.ended and not self._held:
                    self._held = True
                    self._grid.hold()
                self._look()
        finally:
            if self._terminal is not None and self._terminal.here:
                self._loop.remove_reader(0)
            self._loop = None
            await self._port.close()
            if self._writer is not None:
                self._writer.end(self._now)

    def on_grid_key(self, event: KeyEvent) -> None:
        """A button beside the grid, told by any thread."""
        key, loop = grid_key(event), self._loop
        if key is not None and loop is not None:
            loop.call_soon_threadsafe(self.press, key)

    def press(self, key: Key) -> None:
        """Hand a key on."""
        self.counts.keys += 1
        if self._writer is not None:
            self._writer.went(self._now, key)
        self._port.press(key)

    @property
    def _now(self) -> float:
        loop = self._loop
        if loop is not None:
            self._time = loop.time() - self._began
        return self._time

    async def _settled(self, news: asyncio.Event) -> None:
        """Wait until the parts of a window are together."""
        news.clear()
        for _ in range(int(_LONGEST_SETTLING_S / self._port.settle_s) if self._port.settle_s else 0):
            await asyncio.sleep(self._port.settle_s)
            if not news.is_set():
                return
            news.clear()

    def _offer(self) -> None:
        """Show the window of the source, where it has changed."""
        window = self._port.window
        if window == self._window:
            return
        self._window = window
        self.counts.windows += 1
        if self._writer is not None:
            self._writer.came(self._now, window)
        if window is None:
            self._shown = ""
            self._grid.hold()
        else:
            self._draw(window, covered=False)

    def _draw(self, window: BrailleWindow, covered: bool) -> None:
        cells = self._fold.braille(window, covered)
        self._covered = cells if covered else self._covered
        if cells != self._shown:
            self._shown = cells
            self._grid.show(cells, window.text)

    def _look(self) -> None:
        """What time brings: the cursor, keys of a file, and what stands by now."""
        now = self._now
        if self._blink and self._window is not None and self._window.cursor is not None:
            self._draw(self._window, covered=now % CURSOR_PERIOD_S >= CURSOR_PERIOD_S / 2)
        if self._key_file is not None:
            keys, wrong = self._key_file.read()
            for key in keys:
                self.press(key)
            if wrong and self._mirror is not None:
                self._mirror.say(f"key file: {wrong}")
        state = self._grid.state
        if state.shown != self._stood:
            self._stood = state.shown
            self._note(state, now)
        if state.refused != self._refused:
            self._refused = state.refused
            if self._mirror is not None and state.refused:
                self._mirror.say(state.refused)

    def _note(self, state: GridState, now: float) -> None:
        cells = "" if state.stands is None else state.stands.cells.replace("\n", "")
        if cells and cells == self._covered:
            return  # the same window, with its cursor drawn
        if state.latency_s is not None:
            del self.counts.latencies_s[:-9999]
            self.counts.latencies_s.append(state.latency_s)
        if self._writer is not None:
            self._writer.stood(now, cells, state.latency_s)
        if self._mirror is not None:
            self._mirror.stood(cells, "" if state.stands is None else state.stands.text, state.latency_s)

    def _idle(self) -> bool:
        state = self._grid.state
        return state.resting and not state.waiting

    def _typed(self) -> None:
        assert self._terminal is not None
        for key in self._terminal.read():
            self.press(key)


async def _wait(news: asyncio.Event, seconds: float) -> None:
    # Not `wait_for`, which in Python 3.11 loses a Ctrl-C that comes with the news.
    with suppress(TimeoutError):
        async with asyncio.timeout(seconds):
            await news.wait()
