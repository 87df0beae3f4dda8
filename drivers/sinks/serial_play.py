"""A session over a real line: opens it, keeps it going, opens it again, and stops the output on every way out."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from typing import Protocol

from ..protocol.host_session import STOP, HostSession
from .uart import LinkLost, PortUnavailable

__all__ = ["NoAnswer", "SerialLine", "run_session"]

log = logging.getLogger(__name__)

POLL_S = 0.002
SILENT_S = 1.0
RETRY_S = 0.1


class NoAnswer(LinkLost, TimeoutError):
    """The controller is not heard any more, or never was.

    Examples: wrong port; controller switched off; cable pulled for longer than the patience.
    """


class SerialLine(Protocol):
    """Bytes to and from a controller."""

    def read(self, wait_s: float) -> bytes:
        """What has come; waits up to `wait_s` for it. Raises LinkLost."""
        ...

    def write(self, data: bytes) -> None:
        """Send bytes. Raises LinkLost."""
        ...

    def close(self) -> None:
        """Give the line back."""
        ...


def run_session(
    session: HostSession,
    open_line: Callable[[], SerialLine],
    *,
    patience_s: float,
    progress: Callable[[float], None] | None = None,
    clock: Callable[[], float] = time.monotonic,
) -> None:
    """Run `session` to its end.

    A line that breaks, or is silent for a second, is opened again, and the session goes on where the controller
    stands. On Ctrl-C and on every error the controller is told to stop; if that does not reach it, its
    watchdog does the same.

    Parameters
    ----------
    open_line : opens the line anew each time.
    patience_s : how long to try without hearing anything.
    progress : gets the seconds played.

    Raises
    ------
    PortUnavailable
        When the line cannot be opened the first time.
    NoAnswer
        When the controller is not heard for `patience_s`.
    ControllerRefused, SessionLost, UnfitController
        As the session raises them.
    """
    heard_at = clock()
    line: SerialLine | None = open_line()
    try:
        while not session.finished:
            if line is None:
                line = _reopened(open_line)
            if line is not None:
                session.connected()
                heard_at = _converse(session, line, heard_at, progress, clock)
                if not session.finished:
                    line.close()
                    line = None
            if clock() - heard_at > patience_s:
                raise NoAnswer(f"nothing was heard from the controller for {patience_s:g} s; check port and cable")
    finally:
        if line is not None:
            _stop(line, session)


def _converse(
    session: HostSession, line: SerialLine, heard_at: float, progress: Callable[[float], None] | None,
    clock: Callable[[], float],
) -> float:  # fmt: skip
    """Exchange bytes until the session ends or the line breaks; returns when the controller was last heard."""
    opened_at, out = clock(), b""
    try:
        while not session.finished:
            # No wait while there may be more to send: a busy machine does not let this process run again soon.
            data = line.read(0.0 if out else POLL_S)
            now = clock()
            if session.receive(data, now):
                heard_at = now
                if progress is not None:
                    progress(session.played_s)
            elif now - max(heard_at, opened_at) > SILENT_S:
                log.info("the controller is silent; opening the line again")
                break
            out = session.poll(now)
            if out:
                line.write(out)
    except LinkLost as error:
        log.info("%s", error)
    return heard_at


def _reopened(open_line: Callable[[], SerialLine]) -> SerialLine | None:
    time.sleep(RETRY_S)
    try:
        return open_line()
    except PortUnavailable:
        return None


def _stop(line: SerialLine, session: HostSession) -> None:
    try:
        if not session.finished:
            line.write(b"\0" + STOP * 3)
            # Closing throws away what is not sent yet.
            time.sleep(0.02)
    except LinkLost:
        log.info("STOP could not be sent; the controller's watchdog ends the output")
    finally:
        line.close()
