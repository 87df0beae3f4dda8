"""A recorded session as a source: its windows come again, when they came."""

from __future__ import annotations

import asyncio

from .port import WindowPort
from .session_file import SessionRecord
from .window import BrailleWindow, Key

__all__ = ["ReplayPort"]


class ReplayPort(WindowPort):
    """Plays a recording.

    Parameters
    ----------
    record : what was recorded, fitted to the grid.
    """

    kind = "replay"

    def __init__(self, record: SessionRecord) -> None:
        super().__init__()
        self._record = record
        self._window: BrailleWindow | None = None
        self._timer: asyncio.TimerHandle | None = None

    @property
    def window(self) -> BrailleWindow | None:
        """What was shown at this moment of the recording."""
        return self._window

    async def open(self) -> None:
        """Begin."""
        self.how = (f"{len(self._record.windows)} windows in {self._record.seconds:.1f} s, recorded on "
                    f"{self._record.device}",)  # fmt: skip
        self._began = asyncio.get_running_loop().time()
        self._at = 0
        self._next()

    def press(self, key: Key) -> None:
        """Nobody is there to hear it."""

    async def close(self) -> None:
        """Stop."""
        if self._timer is not None:
            self._timer.cancel()

    def _next(self) -> None:
        loop, windows = asyncio.get_running_loop(), self._record.windows
        now = loop.time() - self._began
        while self._at < len(windows) and windows[self._at][0] <= now:
            self._window = windows[self._at][1]
            self._at += 1
        left = self._at < len(windows)
        due = windows[self._at][0] if left else self._record.seconds
        self.ended = not left and now >= due
        if not self.ended:
            self._timer = loop.call_at(self._began + due, self._next)
        self.changed()
