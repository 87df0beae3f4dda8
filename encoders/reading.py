"""The first bytes of a file or pipe that a person names; of a pipe that nobody writes to the log says so.

As chainsim has it, with which this package shares no code.
"""

from __future__ import annotations

import logging
import os
import select
from pathlib import Path
from stat import S_ISFIFO

__all__ = ["first_bytes"]

log = logging.getLogger(__name__)

# After so many seconds a person wonders.
PATIENCE_S = 2.0


def first_bytes(path: Path, most: int) -> bytes:
    """The first `most` bytes of `path`, fewer when it ends before.

    Raises
    ------
    OSError, ValueError
        When it cannot be read, or is no path at all.
    """
    # Opened without waiting, which would be for whoever writes to a pipe.
    with open(path, "rb", opener=lambda name, flags: os.open(name, flags | getattr(os, "O_NONBLOCK", 0))) as file:
        if S_ISFIFO(os.fstat(file.fileno()).st_mode) and not select.select([file], [], [], PATIENCE_S)[0]:
            log.warning("waiting for %s: it is a pipe, and nothing has come through it yet", path)
            select.select([file], [], [])
        if hasattr(os, "O_NONBLOCK"):
            os.set_blocking(file.fileno(), True)
        return file.read(most)
