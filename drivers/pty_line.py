"""The controller's end of a serial line that is not there: a pseudo-terminal with a name to open."""

from __future__ import annotations

import errno
import os
import select
import sys
from pathlib import Path

from .errors import DriverError
from .files import naming

__all__ = ["PtyLine", "PtyUnavailable"]

MOST_PENDING = 1 << 20


class PtyUnavailable(DriverError, OSError):
    """This system has no pseudo-terminals (Windows), or none is left."""


class PtyLine:
    """A pty whose other end looks like a serial port to pyserial.

    Attributes
    ----------
    name : what to open: `link`, or the system's name for the pty.

    Parameters
    ----------
    link : a symbolic link to make to it, so that its name stays the same after `unplug`.

    Raises
    ------
    PtyUnavailable, FileError
        When it cannot be made.
    """

    def __init__(self, link: Path | None = None) -> None:
        self._link = link
        self._master = self._slave = -1
        self._pending = bytearray()
        self.plug()

    def plug(self) -> None:
        """Make the pty (again)."""
        if sys.platform == "win32":
            raise PtyUnavailable("Windows has no pseudo-terminals; run the emulator under Linux, macOS or WSL")
        import tty

        try:
            self._master, self._slave = os.openpty()
        except OSError as error:
            raise PtyUnavailable(f"no pseudo-terminal: {error.strerror}") from None
        # Raw: bytes pass as they are, and none of them is a signal. This side keeps the slave open too, so that
        # a host that goes away does not end the line.
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        self.name = os.ttyname(self._slave)
        if self._link is not None:
            with naming(self._link):
                aside = self._link.with_name(f".{self._link.name}.{os.getpid()}.part")
                aside.unlink(missing_ok=True)
                aside.symlink_to(self.name)
                aside.replace(self._link)
            self.name = str(self._link)

    def unplug(self) -> None:
        """As if the cable were pulled: the host's next read or write fails."""
        for number in (self._master, self._slave):
            if number >= 0:
                os.close(number)
        self._master = self._slave = -1
        self._pending.clear()
        if self._link is not None:
            self._link.unlink(missing_ok=True)

    @property
    def plugged(self) -> bool:
        """Whether the line is there."""
        return self._master >= 0

    def exchange(self, out: bytes, wait_s: float) -> bytes:
        """Send `out` as far as it goes, wait up to `wait_s` for bytes, and return what came."""
        if len(self._pending) + len(out) <= MOST_PENDING:
            self._pending += out
        if not self.plugged:
            self._pending.clear()
            select.select([], [], [], wait_s)
            return b""
        self._write()
        ready, _, _ = select.select([self._master], [], [], wait_s)
        return self._read() if ready else b""

    def close(self) -> None:
        """Take the pty and its link away."""
        self.unplug()

    def _write(self) -> None:
        try:
            while self._pending:
                del self._pending[: os.write(self._master, self._pending)]
        except BlockingIOError:
            pass

    def _read(self) -> bytes:
        data = bytearray()
        try:
            while len(data) < 1 << 18 and (part := os.read(self._master, 1 << 16)):
                data += part
        except BlockingIOError:
            pass
        except OSError as error:
            if error.errno != errno.EIO:
                raise
        return bytes(data)
