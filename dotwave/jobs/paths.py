"""The paths of a job: what can be one, where each leads, and how far it may lead in a job of somebody else."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from pydantic import AfterValidator

from ..errors import AppError

__all__ = ["FilePath", "Reach"]

MOST_PATH_BYTES, MOST_NAME_BYTES = 4095, 255


def _path(value: str) -> str:
    try:
        data = value.encode()
    except UnicodeEncodeError as error:
        raise ValueError(f"character {error.start} is half a surrogate pair; give a valid path") from None
    if b"\0" in data:
        raise ValueError(f"a NUL character at character {value.index(chr(0))}; no path has one")
    longest = max(len(name) for name in data.split(b"/"))
    if not data or len(data) > MOST_PATH_BYTES or longest > MOST_NAME_BYTES:
        raise ValueError(
            f"expected a path of 1 to {MOST_PATH_BYTES} bytes with names of up to {MOST_NAME_BYTES}, "
            f"got {len(data)} bytes, the longest name {longest}"
        )
    return value


FilePath = Annotated[str, AfterValidator(_path)]


@dataclass(frozen=True)
class Reach:
    """Where the paths of a job lead: from its own folder and, with a root, nowhere but below that.

    Symbolic links are followed before a path is judged. What is below is given as the path without links.
    """

    folder: Path
    root: Path | None = None

    def job(self, path: Path) -> Path:
        """The job file itself."""
        return path if self.root is None else self._regular(self._below(path, str(path), str(path)))

    def file(self, name: str, place: str) -> Path:
        """The file to read that a job calls `name`; `place` is where it says so.

        Raises
        ------
        AppError
            When it is outside the root, or below it but something else than a file.
        """
        path = self._below(self.folder / name, name, place)
        return path if self.root is None else self._regular(path)

    def output(self, name: str, place: str) -> Path:
        """The file to write that a job calls `name`; raises as `file` does."""
        path = Path(os.path.normpath(self.folder / name))
        return self._below(path, name, place)

    def table(self, spec: str, place: str) -> None:
        """Refuse tables other than those of liblouis: one of a job could include any file.

        Raises
        ------
        AppError, encoders.EncodeError
            With a root, when a table is not one of liblouis's own.
        """
        if self.root is None:
            return
        from encoders import foreign_tables

        for name in foreign_tables(spec):
            raise AppError(
                f"{place}: {name} is not one of liblouis's own tables, and --root {self.root} takes no others; "
                "'dotwave tables' lists them"
            )

    def _below(self, path: Path, name: str, place: str) -> Path:
        if self.root is None:
            return path
        real = Path(os.path.realpath(path))
        if not real.is_relative_to(os.path.realpath(self.root)):
            raise AppError(f"{place}: {name} is outside --root {self.root}; give a path below it")
        return real

    def _regular(self, path: Path) -> Path:
        if os.path.lexists(path) and not os.path.isfile(path):
            raise AppError(f"{path}: is not a file; --root reads nothing else")
        return path
