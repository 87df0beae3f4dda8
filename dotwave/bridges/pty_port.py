"""An emulated display on a pseudo-terminal: it looks like a serial port to a screen reader."""

from __future__ import annotations

import asyncio
import errno
import os
from collections import deque
from pathlib import Path

from drivers import make_link, open_pty, remove_link

from .baum import BaumDisplay
from .canute import CanuteDisplay
from .port import WindowPort
from .window import BrailleWindow, Key

__all__ = ["PtyPort"]

PRESSED_S = 0.03
"""How long a key is down. BRLTTY acts on release."""
_LOOK_S = 0.05
_PUSH_S, _HEARD_S = 0.01, 2.0
_MOST_KEYS = 16
_MOST_PENDING = 1 << 14


class PtyPort(WindowPort):
    """A Baum or a Canute on a pty.

    While nobody has the terminal open its other end is held here, so that it stays raw; when somebody speaks it is let
    go, so that the system tells when that program ends.

    Parameters
    ----------
    kind : baum or canute.
    display : answers.
    link : a stable name for the port, a symbolic link.
    """

    def __init__(self, kind: str, display: BaumDisplay | CanuteDisplay, link: Path | None = None) -> None:
        super().__init__()
        self.kind, self.settle_s = kind, display.settle_s
        self.name = ""
        self._display, self._link = display, link
        self._master = self._held = -1
        self._pending = bytearray()
        self._keys: deque[Key] = deque()
        self._heard_at = -_HEARD_S
        self._timers: dict[str, asyncio.TimerHandle] = {}

    @property
    def window(self) -> BrailleWindow | None:
        """What was written; None while nobody has the terminal open."""
        return self._display.window if self._held < 0 else None

    async def open(self) -> None:
        """Make the terminal.

        Raises
        ------
        PtyUnavailable, FileError
            When it, or the link, cannot be made.
        """
        self._master, self._held, self._pty = open_pty("use --from brlapi or lines")
        self.name = self._pty
        if self._link is not None:
            make_link(self._link, self._pty)
            self.name = str(self._link)
        asyncio.get_running_loop().add_reader(self._master, self._read)
        driver = "bm" if self.kind == "baum" else "cn"
        self.how = (f"a {self.kind} display on {self.name}", f"brltty -b {driver} -d serial:{self.name}")
        if isinstance(self._display, CanuteDisplay):
            self._push()

    def press(self, key: Key) -> None:
        """Down, and up a moment later, one key after the other."""
        if self.window is None or len(self._keys) >= _MOST_KEYS:
            return
        self._keys.append(key)
        if len(self._keys) == 1:
            self._down()

    async def close(self) -> None:
        """Take the terminal and its link away."""
        for timer in self._timers.values():
            timer.cancel()
        if self._master < 0:
            return
        asyncio.get_running_loop().remove_reader(self._master)
        if self._link is not None:
            remove_link(self._link, self._pty)
        for number in (self._master, self._held):
            if number >= 0:
                os.close(number)
        self._master = self._held = -1

    def _later(self, name: str, seconds: float, call: object) -> None:
        assert callable(call)
        self._timers[name] = asyncio.get_running_loop().call_later(seconds, call)

    def _hold(self, slave: int) -> None:
        import tty

        tty.setraw(slave)
        self._held = slave

    def _read(self) -> None:
        try:
            data = os.read(self._master, 4096)
        except BlockingIOError:
            return
        except OSError as error:
            if error.errno != errno.EIO:
                raise
            data = b""
        if not data:
            self._gone()
            return
        if self._held >= 0:
            os.close(self._held)
            self._held = -1
        self._heard_at = asyncio.get_running_loop().time()
        self._write(self._display.receive(data))
        self.changed()

    def _gone(self) -> None:
        """Nobody has it open: hold it again."""
        self._pending.clear()
        self._keys.clear()
        self._hold(os.open(self._pty, os.O_RDWR | os.O_NOCTTY))
        self.changed()

    def _down(self) -> None:
        self._write(self._display.press(self._keys[0]))
        self._later("key", PRESSED_S, self._up)

    def _up(self) -> None:
        if self._keys:
            self._write(self._display.release(self._keys.popleft()))
        if self._keys:
            self._later("key", PRESSED_S, self._down)

    def _push(self) -> None:
        """A Canute tells of its keys unasked, as long as somebody listens."""
        now = asyncio.get_running_loop().time()
        if now - self._heard_at < _HEARD_S and isinstance(self._display, CanuteDisplay) and not self._pending:
            self._write(self._display.idle())
        self._later("push", _PUSH_S, self._push)

    def _write(self, data: bytes) -> None:
        """As far as it goes; the rest when there is room, or never where nobody reads."""
        if len(self._pending) + len(data) <= _MOST_PENDING:
            self._pending += data
        try:
            while self._pending:
                del self._pending[: os.write(self._master, self._pending)]
        except BlockingIOError:
            self._later("write", _LOOK_S, lambda: self._write(b""))
        except OSError as error:
            if error.errno != errno.EIO:
                raise
