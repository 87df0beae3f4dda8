"""Locks on open files and folders that the kernel drops when their process ends, however it ends."""

from __future__ import annotations

import errno
import sys

__all__ = ["held"]

# What a system says of a lock that somebody else has; anything else means that it has no such locks here.
TAKEN = (errno.EWOULDBLOCK, errno.EAGAIN, errno.EACCES)


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
