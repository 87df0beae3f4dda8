"""Files on their way: written beside their names, then put in place as one, whenever their writer may die.

A write has a random token and makes ``.NAME.dotwave-TOKEN.part`` for each of its files. When all are whole, the part of
the last one is renamed to end in ``.ready``. From this one rename on the new files count, before it the old ones. Then
the others get their names, and the last one after them. Of a writer that died, a token without ``.ready`` is thus
deleted; with one, what is left gets its name.

A living writer holds a lock on each of its parts, and one on the folder while several files get their names, so that no
two writes are mixed. Where a file system has no locks, nothing of others is touched.
"""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Callable, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from pathlib import Path
from stat import S_ISREG
from typing import BinaryIO

from .locks import alone_in, awaited, held

__all__ = ["Belongs", "PartFile", "finish", "is_at", "make", "part_of", "settle", "settle_alone", "sync_folder"]

Belongs = Callable[[str], bool]
"""Whether a file of this name may be put in place."""

PATTERN = re.compile(r"\.(?P<name>.+)\.dotwave-(?P<token>[0-9a-f]{16})\.(?P<state>part|ready)", re.DOTALL)
# What a system lacks of these is 0. A part is never looked for behind a link.
NEW = os.O_RDWR | os.O_CREAT | os.O_EXCL | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_BINARY", 0)
# A pipe of that name must not make us wait.
OLD = os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0)


@dataclass(frozen=True)
class PartFile:
    """A file on its way to `path`, of the write `token`."""

    path: Path
    token: str

    @property
    def part(self) -> Path:
        """Where it lies before the write counts."""
        return self._beside("part")

    @property
    def ready(self) -> Path:
        """Where the last one of a write lies once the write counts."""
        return self._beside("ready")

    def _beside(self, state: str) -> Path:
        return self.path.with_name(f".{self.path.name}.dotwave-{self.token}.{state}")


def part_of(path: Path) -> PartFile | None:
    """What `path` is a part of, by its name; None for any other file."""
    found = PATTERN.fullmatch(path.name)
    return None if found is None else PartFile(path.with_name(found["name"]), found["token"])


def make(part: PartFile) -> BinaryIO:
    """Make the file of a part, with the permissions any new file gets, open for writing and reading, and locked."""
    while True:
        file = os.fdopen(os.open(part.part, NEW, 0o666), "w+b")
        # Between its making and its lock it looked like one of a dead writer. Who took it for that is waited for: a
        # new one of that name would be deleted in place of the first.
        if awaited(file.fileno()) is not False and is_at(part.part, file.fileno()):
            return file
        file.close()
        part.part.unlink(missing_ok=True)


def finish(parts: Sequence[PartFile]) -> None:
    """Put the files of a write in place when it counts; else delete its parts. Goes by what is on the disk.

    Raises
    ------
    OSError
        When one cannot be put in place; `filename2` is its path.
    """
    if not any(os.path.lexists(one.ready) for one in parts):
        for one in parts:
            with suppress(OSError):
                one.part.unlink()
        return
    for one, lies in [*((one, one.part) for one in parts), *((one, one.ready) for one in parts)]:
        with suppress(FileNotFoundError):
            os.replace(lies, one.path)


def settle(folder: Path, belongs: Belongs, *, others: bool) -> frozenset[str]:
    """Finish or undo what dead processes of this user left in `folder`.

    A write that counts is put in place only when all of its files belong: a name made up by someone else is no reason
    to replace a file.

    Parameters
    ----------
    others : also delete parts of writes that do not count and have nothing that belongs.

    Returns
    -------
    Names of files whose writes count and were left as they are.

    Raises
    ------
    OSError
        When a file that belongs cannot be put in place.
    """
    if sys.platform == "win32" or not _left_in(folder):
        return frozenset()
    with alone_in(folder):
        return settle_alone(folder, belongs, others=others)


def settle_alone(folder: Path, belongs: Belongs, *, others: bool) -> frozenset[str]:
    """The same, for who holds the folder (`alone_in`) already."""
    left: set[str] = set()
    for token, parts in _left_in(folder).items():
        if others or any(belongs(one.path.name) for one in parts):
            left |= _settle(folder, token, parts, belongs)
    return frozenset(left)


def _settle(folder: Path, token: str, parts: Sequence[PartFile], belongs: Belongs) -> set[str]:
    with ExitStack() as stack:
        if not all(_locked(one, stack) for one in parts):
            return set()
        # Its writer is dead, and nobody else can be at it: what is there now is what it left.
        parts = _left_in(folder).get(token, [])
        counts = any(os.path.lexists(one.ready) for one in parts)
        if counts and not all(belongs(one.path.name) for one in parts):
            return {one.path.name for one in parts}
        if parts:
            finish(parts)
        return set()


def _left_in(folder: Path) -> dict[str, list[PartFile]]:
    """Parts by token: plain files with one name that belong to this user."""
    found: dict[str, list[PartFile]] = {}
    with suppress(OSError), os.scandir(folder) as entries:
        for entry in entries:
            part = part_of(folder / entry.name) if PATTERN.fullmatch(entry.name) else None
            if part is None:
                continue
            with suppress(OSError):
                seen = entry.stat(follow_symlinks=False)
                if S_ISREG(seen.st_mode) and seen.st_uid == os.geteuid() and seen.st_nlink == 1:
                    found.setdefault(part.token, []).append(part)
    return found


def _locked(part: PartFile, stack: ExitStack) -> bool:
    for path in (part.part, part.ready):
        with suppress(OSError):
            number = os.open(path, OLD)
            stack.callback(os.close, number)
            return held(number) is True and is_at(path, number)
    return False


def is_at(path: Path, number: int) -> bool:
    """Whether the open file is still the one of that name."""
    try:
        return os.path.samestat(os.lstat(path), os.fstat(number))
    except OSError:
        return False


def sync_folder(folder: Path) -> None:
    """Bring the names in a folder to the disk, where the system can."""
    with suppress(OSError):
        number = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(number)
        finally:
            os.close(number)
