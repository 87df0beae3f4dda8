"""The folder in which a sweep keeps its chunks until all are done; only what dotwave put there is ever removed."""

from __future__ import annotations

import json
import os
import re
import secrets
import sys
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from stat import S_ISDIR, S_ISREG
from typing import Any

from drivers import PartFile, held, is_at, part_of, settle_alone, settled

from ..errors import AppError

__all__ = ["claimed", "removed"]

NOTE = "sweep.json"
LONGEST_NOTE = 1 << 20
CHUNK = re.compile(r"\d{12}\.npz")
FOLDER = os.O_RDONLY | getattr(os, "O_DIRECTORY", 0) | getattr(os, "O_NOFOLLOW", 0)


@contextmanager
def claimed(folder: Path, note: Mapping[str, Any]) -> Iterator[None]:
    """Make the folder, or go on in one that was left with the same note; no other run gets it meanwhile.

    Parameters
    ----------
    note : what the sweep is, JSON types, ``"schema"`` among them.

    Raises
    ------
    AppError
        When the folder is not one that dotwave made, was left by another sweep, or is worked on.
    OSError
        When it cannot be made.
    """
    _clear(folder)
    while True:
        if not os.path.lexists(folder):
            _make(folder, note)
        _check_made(folder, note["schema"])
        with ExitStack() as stack:
            try:
                number = _opened(folder, stack)
            except FileNotFoundError:
                continue  # another run came to its end and took the folder away
            if number is not None and held(number) is False:
                raise AppError(f"{folder}: another run is at this sweep; wait for it, or give -o another name")
            if number is None or is_at(folder, number):
                if _read(folder) != note:
                    raise AppError(f"{folder}: left by another sweep; finish that one, or delete the folder")
                if number is not None:
                    # Whoever writes into it would wait for the folder to be free, which it is not until we are done.
                    with suppress(OSError):
                        settle_alone(folder, _is_chunk, others=True)
                yield
                return


def _is_chunk(name: str) -> bool:
    return CHUNK.fullmatch(name) is not None


def removed(folder: Path, firsts: range) -> None:
    """Delete the chunks that begin at `firsts`, then the folder; it stays when there is anything else in it."""
    settled(folder / NOTE, _is_chunk)
    for first in firsts:
        (folder / f"{first:012d}.npz").unlink(missing_ok=True)
    if os.listdir(folder) == [NOTE]:
        # Aside first: an empty folder of that name would not be known as ours.
        aside = _aside(folder)
        os.rename(folder, aside)
        _discard(aside)
        with suppress(FileNotFoundError):
            os.rename(aside, folder)  # something came in between
    else:
        (folder / NOTE).unlink()


def _aside(folder: Path) -> Path:
    return PartFile(folder, secrets.token_hex(8)).part


def _make(folder: Path, note: Mapping[str, Any]) -> None:
    """The folder with its note, at once."""
    aside = _aside(folder)
    aside.mkdir()
    with ExitStack() as stack:
        try:
            number = _opened(aside, stack)
        except FileNotFoundError:
            return  # another run took it for one of a dead run; try again
        if number is not None and (held(number) is False or not is_at(aside, number)):
            return
        try:
            with (aside / NOTE).open("xb") as file:
                file.write(json.dumps(dict(note)).encode())
                file.flush()
                os.fsync(file.fileno())
            os.rename(aside, folder)
        except OSError:
            if not os.path.lexists(folder):
                raise  # else another run was first
        finally:
            _discard(aside)


def _discard(aside: Path) -> None:
    """Delete a folder with nothing but a note in it, if it is there."""
    with suppress(OSError):
        (aside / NOTE).unlink(missing_ok=True)
        aside.rmdir()


def _clear(folder: Path) -> None:
    """Remove folders that dead runs of this user were making, or taking away."""
    if sys.platform == "win32":
        return
    with suppress(OSError):
        for name in os.listdir(folder.parent):
            part, path = part_of(folder.parent / name), folder.parent / name
            if part is None or part.path.name != folder.name:
                continue
            with ExitStack() as stack, suppress(OSError):
                seen = path.lstat()
                if not S_ISDIR(seen.st_mode) or seen.st_uid != os.geteuid():
                    continue
                number = _opened(path, stack)
                if number is not None and held(number) is True and is_at(path, number):
                    _discard(path)


def _check_made(folder: Path, schema: str) -> None:
    with suppress(FileNotFoundError):
        if not S_ISDIR(folder.lstat().st_mode) or _read(folder).get("schema") != schema:
            raise AppError(f"{folder}: not a folder that dotwave sweep made; move it away, or give -o another name")


def _read(folder: Path) -> dict[str, Any]:
    """The note; empty when there is none that can be read."""
    path = folder / NOTE
    try:
        if not S_ISREG(path.lstat().st_mode):
            return {}
        with path.open("rb") as file:
            note = json.loads(file.read(LONGEST_NOTE))
    except (OSError, ValueError, RecursionError):
        return {}
    return note if isinstance(note, dict) else {}


def _opened(folder: Path, stack: ExitStack) -> int | None:
    """The folder open, to lock it; None on Windows, which opens no folders."""
    if sys.platform == "win32":
        return None
    number = os.open(folder, FOLDER)
    stack.callback(os.close, number)
    return number
