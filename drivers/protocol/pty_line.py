"""The controller's end of a serial line that is not there: a pseudo-terminal with a name to open."""

from __future__ import annotations

import errno
import os
import re
import select
import sys
from pathlib import Path
from typing import NamedTuple

from ..errors import DriverError, FileError
from ..files.whole import naming

__all__ = ["Pty", "PtyLine", "PtyUnavailable", "make_link", "open_pty", "remove_link"]

MOST_PENDING = 1 << 20
# Names of pseudo-terminals on Linux and the BSDs, and on macOS.
PTY = re.compile(r"/dev/(pts/|ttys)\d+")


class PtyUnavailable(DriverError, OSError):
    """This system has no pseudo-terminals (Windows), or none is left."""


class PtyLine:
    """A pty whose other end looks like a serial port to pyserial.

    Attributes
    ----------
    name : what to open: `link`, or the system's name for the pty.

    Parameters
    ----------
    link : a symbolic link to make to it, so that its name stays the same after `unplug`. One that a dead emulator left
        there is replaced, anything else is not.

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
        # This side keeps the slave open too, so that a host that goes away does not end the line.
        self._master, self._slave, self._pty = open_pty("run the emulator under Linux, macOS or WSL")
        self.name = self._pty
        if self._link is not None:
            try:
                make_link(self._link, self._pty)
            except FileError:
                self._hang_up()
                raise
            self.name = str(self._link)

    def unplug(self) -> None:
        """As if the cable were pulled: the host's next read or write fails."""
        if self._link is not None and self.plugged:
            remove_link(self._link, self._pty)
        self._hang_up()

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

    def _hang_up(self) -> None:
        for number in (self._master, self._slave):
            if number >= 0:
                os.close(number)
        self._master = self._slave = -1
        self._pending.clear()

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


class Pty(NamedTuple):
    """Both ends of a pseudo-terminal, and the name by which the second is opened."""

    master: int
    slave: int
    name: str


def open_pty(cure: str) -> Pty:
    """A pseudo-terminal that passes bytes as they are, none of them a signal; its master does not block.

    Parameters
    ----------
    cure : what to do on Windows, which has none.

    Raises
    ------
    PtyUnavailable
        When there is none to be had.
    """
    if sys.platform == "win32":
        raise PtyUnavailable(f"Windows has no pseudo-terminals; {cure}")
    import tty

    try:
        master, slave = os.openpty()
    except OSError as error:
        raise PtyUnavailable(f"no pseudo-terminal: {error.strerror}") from None
    tty.setraw(slave)
    os.set_blocking(master, False)
    return Pty(master, slave, os.ttyname(slave))


def make_link(link: Path, pty: str) -> None:
    """Make `link` to `pty`, in the place of a link that an emulator left when it died, and of nothing else.

    Such a link leads to a pty that is gone, or whose number is ours now.

    Raises
    ------
    FileError
        When something else is there, or the file system refuses.
    """
    target = _target(link)
    ours = target is not None and PTY.fullmatch(target) is not None
    with naming(link):
        if ours and (target == pty or not os.path.lexists(str(target))):
            link.unlink(missing_ok=True)
        try:
            link.symlink_to(pty)
        except FileExistsError:
            there = "the port of a terminal in use" if ours else "not a port that dotwave made"
            raise FileError(f"{link}: this is {there}; move it away, or give --link another name") from None


def remove_link(link: Path, pty: str) -> None:
    """Take `link` away if it leads to `pty`: as long as the pty is ours, such a link is ours too."""
    if _target(link) == pty:
        link.unlink(missing_ok=True)


def _target(link: Path) -> str | None:
    """Where a symbolic link leads; None when it is none, or not there."""
    try:
        return os.readlink(link)
    except OSError:
        return None
