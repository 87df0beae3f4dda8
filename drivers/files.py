"""Files that appear whole or not at all, and one clear line when the file system refuses."""

from __future__ import annotations

import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

from .errors import FileError

__all__ = ["atomic_path", "atomic_paths", "naming", "opened"]


@contextmanager
def naming(path: Path) -> Iterator[None]:
    """Turn an OSError of the body into a FileError that names `path` and the cure."""
    try:
        yield
    except FileError:
        raise
    except OSError as error:
        raise FileError(f"{path}: {_complaint(path, error)}") from None


@contextmanager
def atomic_path(path: Path) -> Iterator[Path]:
    """One file of `atomic_paths`; gives the path to write to."""
    with atomic_paths(path) as (aside,):
        yield aside


@contextmanager
def atomic_paths(*paths: Path) -> Iterator[tuple[Path, ...]]:
    """Write files aside, in the folders where they belong; put them in place together when the body ends well.

    Gives empty files to write to; folders that are missing are made. At the end all are flushed to the disk, then
    renamed in the given order, so that the last one's presence says that all are whole. Whatever stops the body (an
    error, Ctrl-C), nothing new is left, no folder either.

    Raises
    ------
    FileError
        Before the body when a file cannot be made there; after it when it cannot be put in place.
    """
    with _made_folders(*paths), _put_aside(*paths) as asides:
        yield asides


@contextmanager
def _put_aside(*paths: Path) -> Iterator[tuple[Path, ...]]:
    asides = tuple(path.with_name(f".{path.name}.{os.getpid()}.part") for path in paths)
    made: list[Path] = []
    try:
        for path, aside in zip(paths, asides, strict=True):
            with naming(path):
                if path.is_dir():
                    raise IsADirectoryError(errno.EISDIR, "is a folder")
                made.append(aside)
                aside.open("wb").close()
        yield asides
        for path, aside in zip(paths, asides, strict=True):
            with naming(path):
                _flush(aside)
        for path, aside in zip(paths, asides, strict=True):
            with naming(path):
                aside.replace(path)
                made[made.index(aside)] = path
        made.clear()
    finally:
        for leftover in made:
            with suppress(OSError):
                leftover.unlink()


@contextmanager
def _made_folders(*paths: Path) -> Iterator[None]:
    """Make the folders of `paths`; when the body fails, those that were made and are empty go again."""
    made: list[Path] = []
    try:
        for path in paths:
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
def opened(aside: Path, path: Path) -> Iterator[BinaryIO]:
    """The file `aside` open for writing; opening and closing it complain about `path`, which it will become."""
    with naming(path):
        file = aside.open("wb")
    try:
        yield file
    except BaseException:
        # Closing flushes what is left: on a full disk that fails again and would hide the first error.
        with suppress(OSError):
            file.close()
        raise
    with naming(path):
        file.close()


def _flush(path: Path) -> None:
    with path.open("rb") as file:
        os.fsync(file.fileno())


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
        errno.EISDIR: "this is a folder; give the name of a file",
    }
    if error.errno == errno.ENOENT:
        if folder.is_dir():
            return "no such file; check the name"
        return f"folder {folder} does not exist; create it or choose another"
    return reasons.get(error.errno or 0, error.strerror or str(error))
