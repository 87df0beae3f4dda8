"""Locks on open files and folders that the kernel drops when their process ends, however it ends."""

from __future__ import annotations

import errno
import os
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

__all__ = ["alone_in", "awaited", "held"]

# What a system says of a lock that somebody else has; anything else means that it has no such locks here.
TAKEN = (errno.EWOULDBLOCK, errno.EAGAIN, errno.EACCES)
# Whoever renames files holds a folder for milliseconds, on a very busy machine for seconds; who holds it for longer
# does something else there.
PATIENCE_S, PAUSE_S = 60.0, 0.002


def held(number: int) -> bool | None:
    """Lock an open file or folder, without waiting, until it is closed.

    Parameters
    ----------
    number : file descriptor.

    Returns
    -------
    True when it is ours now, False when another process has it, None where there are no such locks.
    """
    if sys.platform == "win32":
        return None
    import fcntl

    try:
        fcntl.flock(number, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        return False if error.errno in TAKEN else None
    return True


def awaited(number: int) -> bool | None:
    """As `held`, after waiting a while for who has it."""
    until = time.monotonic() + PATIENCE_S
    while (found := held(number)) is False and time.monotonic() < until:
        time.sleep(PAUSE_S)
    return found


@contextmanager
def alone_in(folder: Path) -> Iterator[None]:
    """Hold the lock of a folder while the body runs, and wait for it a while.

    Where there are no such locks, or somebody keeps it, the body runs without.
    """
    number = None
    with suppress(OSError):
        number = os.open(folder, os.O_RDONLY)
    try:
        if number is not None:
            awaited(number)
        yield
    finally:
        if number is not None:
            os.close(number)
