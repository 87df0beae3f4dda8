"""Files that appear whole or not at all, and one clear line when the file system refuses."""

from __future__ import annotations

import errno
import os
import secrets
import sys
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, nullcontext, suppress
from pathlib import Path
from stat import S_ISDIR, S_ISREG
from typing import BinaryIO

from ..errors import FileError
from .locks import alone_in
from .parts import Belongs, PartFile, finish, is_at, make, settle, settle_alone, sync_folder

__all__ = ["atomic_file", "atomic_files", "check_plain", "first_of_plain", "made_folder", "naming", "settled"]

TAKEN_AWAY = "another program took away what was written so far; write it again, or in a folder of your own"
NOT_A_FILE = "this is a device or a pipe; give the name of a file"


@contextmanager
def naming(path: Path) -> Iterator[None]:
    """Turn an OSError of the body into a FileError that names `path` and the cure, with the same `errno`."""
    try:
        yield
    except FileError:
        raise
    except OSError as error:
        refused = FileError(f"{path}: {_complaint(path, error)}")
        refused.errno = error.errno
        raise refused from None


def check_plain(path: Path) -> None:
    """Refuse what cannot be read twice, or from any place: a pipe, a device, a folder; nothing is opened.

    Raises
    ------
    FileError
        Also when there is no such file.
    """
    with naming(path):
        _check_mode(path.stat().st_mode)


def first_of_plain(path: Path, most: int) -> bytes:
    """The first `most` bytes of a plain file; raises as `check_plain` does, and when it cannot be read."""
    check_plain(path)
    with naming(path), path.open("rb") as file:
        return file.read(most)


@contextmanager
def atomic_file(path: Path) -> Iterator[BinaryIO]:
    """One file of `atomic_files`."""
    with atomic_files(path) as (file,):
        yield file


@contextmanager
def made_folder(path: Path) -> Iterator[None]:
    """Make the folder of `path` where missing; when the body fails, what was made and is empty goes again.

    Raises
    ------
    FileError
        When it cannot be made.
    """
    made: list[Path] = []
    try:
        with naming(path):
            _make_folder(path.parent, made)
        yield
        made.clear()
    finally:
        for folder in reversed(made):
            with suppress(OSError):
                folder.rmdir()


def _make_folder(folder: Path, made: list[Path]) -> None:
    """Make `folder` and what it lies in, where missing; each that is made is noted in `made`."""
    if folder.exists():
        return
    _make_folder(folder.parent, made)
    with suppress(FileExistsError):
        folder.mkdir()
        made.append(folder)


@contextmanager
def atomic_files(*paths: Path, belongs: Belongs | None = None) -> Iterator[tuple[BinaryIO, ...]]:
    """Write files of one folder aside; put them in place together when the body ends well. The folder is made.

    Gives empty files, open for writing and reading; they are closed at the end. Then all are flushed to the disk and
    get their names in the given order. Whatever stops the body, an error, Ctrl-C or SIGKILL, the files of these names
    are all the old ones or all the new ones, and of several writers those of the last; what a killed writer leaves
    half done is settled by the next one, or by `settled`.

    Parameters
    ----------
    belongs : which other files a killed writer may have written together with one of these, by name; only these
        themselves unless given.

    Raises
    ------
    FileError
        Before the body when a file cannot be made there; after it when it cannot be put in place.
    """
    with made_folder(paths[0]), _aside(paths, belongs) as files:
        yield files


@contextmanager
def _aside(paths: tuple[Path, ...], belongs: Belongs | None) -> Iterator[tuple[BinaryIO, ...]]:
    folder, token = paths[0].parent, secrets.token_hex(8)
    parts = [PartFile(path, token) for path in paths]
    files: list[BinaryIO] = []
    place = os.path.abspath(folder)
    belongs = belongs or {path.name for path in paths}.__contains__
    _tidy(place, paths, belongs)
    try:
        with ExitStack() as undone:
            undone.callback(_finish, parts)
            for part in parts:
                with naming(part.path):
                    _check_target(part.path)
                    files.append(make(part))
            began = _changed(folder)
            yield tuple(files)
            _flush(parts, files)
            # One name cannot be mixed with another's.
            with alone_in(folder) if len(parts) > 1 else nullcontext():
                undone.pop_all()
                alone = _changed(folder) == began
                _put_in_place(parts, files, None if alone or len(parts) == 1 else belongs)
    finally:
        for file in files:
            # Closing flushes what is left of a write that came to nothing: on a full disk that fails again.
            with suppress(OSError):
                file.close()
    # What this process itself did to the folder is no reason to look through it again.
    _known[place] = (_changed(folder) if alone else None, _known[place][1])


def settled(path: Path, belongs: Belongs) -> None:
    """Before reading: finish or undo what a killed writer left of `path` and the files that belong to it.

    Where that cannot be done, such as on a read-only file system, everything stays as it is.
    """
    with suppress(OSError):
        settle(path.parent, belongs, others=False)


def _flush(parts: Sequence[PartFile], files: Sequence[BinaryIO]) -> None:
    """Bring all files to the disk."""
    for part, file in zip(parts, files, strict=True):
        with naming(part.path):
            file.flush()
            os.fsync(file.fileno())


def _put_in_place(parts: Sequence[PartFile], files: Sequence[BinaryIO], others: Belongs | None) -> None:
    """Do the one rename that makes the files count, and give them their names.

    `others` : files of these names that another writer, who began later and died, may have left half done; these get
    their names before.
    """
    last = parts[-1]
    try:
        with naming(last.path):
            if others is not None:
                settle_alone(last.path.parent, others, others=False)
        for part, file in zip(parts, files, strict=True):
            with naming(part.path):
                _check_target(part.path)
                if not is_at(part.part, file.fileno()):
                    raise OSError(errno.ESTALE, TAKEN_AWAY)
                if sys.platform == "win32":
                    file.close()  # Windows renames no open file
        with naming(last.path):
            os.replace(last.part, last.ready if len(parts) > 1 else last.path)
        # After a power cut, too: should the names be lost that come after this, they are given again.
        sync_folder(last.path.parent)
    finally:
        _finish(parts)


def _finish(parts: Sequence[PartFile]) -> None:
    try:
        finish(parts)
    except OSError as error:
        if os.path.lexists(parts[0].part):
            # Not even the first has got its name, so all the old ones are still there.
            with suppress(OSError):
                os.replace(parts[-1].ready, parts[-1].part)
                finish(parts)
        refused = Path(error.filename2 or parts[-1].path)
        raise FileError(f"{refused}: {_complaint(refused, error)}") from None


def _check_target(path: Path) -> None:
    with suppress(FileNotFoundError):
        _check_mode(path.stat().st_mode)


def _check_mode(mode: int) -> None:
    if S_ISDIR(mode):
        raise IsADirectoryError(errno.EISDIR, "is a folder")
    if not S_ISREG(mode):
        raise OSError(errno.EINVAL, NOT_A_FILE)


# Folders by their absolute path as this process left them: when they last changed, and names whose writes wait there.
# What nobody else has changed need not be looked through again: thousands of files in one folder would make that slow.
_known: dict[str, tuple[int | None, frozenset[str]]] = {}


def _tidy(place: str, paths: Sequence[Path], belongs: Belongs) -> None:
    """Settle what dead processes left of these files, and delete what else they left in the folder."""
    folder = paths[0].parent
    if any(path.parent != folder for path in paths):
        raise ValueError(f"files written together lie in one folder, got {[str(path) for path in paths]}")
    changed, waiting = _known.get(place, (None, frozenset()))
    if changed is not None and changed == _changed(folder) and not any(map(belongs, waiting)):
        return
    with naming(paths[-1]):
        waiting = settle(folder, belongs, others=True)
    _known[place] = (_changed(folder), waiting)


def _changed(folder: Path) -> int | None:
    try:
        return folder.stat().st_mtime_ns
    except OSError:
        return None


def _complaint(path: Path, error: OSError) -> str:
    folder = path.parent
    reasons = {
        errno.ENOSPC: "the disk is full; free some space or write to another disk",
        errno.EDQUOT: "your disk quota is used up; free some space or write to another disk",
        errno.EFBIG: "the file grows past what may be written here; raise the limit (ulimit -f) or write elsewhere",
        errno.EACCES: f"no permission in folder {folder}; choose another folder or change its permissions",
        errno.EPERM: f"no permission in folder {folder}; choose another folder or change its permissions",
        errno.EROFS: f"folder {folder} is on a read-only file system; choose another folder",
        errno.ENOTDIR: f"{folder} is not a folder; choose another one",
        errno.ELOOP: "this is a symbolic link; remove it, or give another name",
        errno.EEXIST: "there is a file of this name; choose another",
        errno.ENAMETOOLONG: "File name too long; shorten it",
        errno.EISDIR: "this is a folder; give the name of a file",
    }
    if error.errno == errno.ENOENT:
        if folder.is_dir():
            return "no such file; check the name"
        return f"folder {folder} does not exist; create it or choose another"
    return reasons.get(error.errno or 0, error.strerror or str(error))
