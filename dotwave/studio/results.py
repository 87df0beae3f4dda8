"""What was made stays in the chosen folder, one folder a result; nothing else is ever written or read.

Names come from the browser, so they are looked up in what is there and never joined to a path.
"""

from __future__ import annotations

import json
import re
import secrets
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

from drivers import atomic_file, naming

from ..errors import AppError

__all__ = ["Result", "Results"]

NAME = re.compile(r"[a-z]+-\d{8}-\d{6}-[0-9a-f]{6}")
ASKED, ANSWER = "asked.json", "answer.json"
OURS = (ASKED, ANSWER)


@dataclass(frozen=True)
class Result:
    """One result.

    Attributes
    ----------
    folder : its own, below the chosen one.
    page : which page asked for it.
    title : a few words for a list.
    asked : what was asked, plain JSON types.
    """

    folder: Path
    page: str
    title: str
    asked: Mapping[str, Any]

    @property
    def name(self) -> str:
        """Of the folder, and in addresses."""
        return self.folder.name

    def answer(self) -> dict[str, Any] | None:
        """What came of it, as the worker wrote it; None before it is done."""
        return _read(self.folder / ANSWER)

    def files(self) -> dict[str, Path]:
        """Files to download, by name."""
        plain = (one for one in sorted(self.folder.iterdir()) if one.is_file() and not one.is_symlink())
        return {one.name: one for one in plain if one.name not in OURS and not one.name.startswith(".")}


@dataclass(frozen=True)
class Results:
    """All results of a folder.

    Attributes
    ----------
    folder : chosen when the studio was started; made when something is written.
    """

    folder: Path

    def begin(self, page: str, title: str, asked: Mapping[str, Any]) -> Result:
        """A folder for a new result.

        Raises
        ------
        drivers.FileError
            When it cannot be made.
        """
        folder = self.folder / f"{page}-{datetime.now():%Y%m%d-%H%M%S}-{secrets.token_hex(3)}"
        with naming(folder):
            folder.mkdir(parents=True)
        told = {"page": page, "title": title, "asked": dict(asked)}
        with atomic_file(folder / ASKED) as file:
            file.write(json.dumps(told, ensure_ascii=False).encode())
        return Result(folder, page, title, dict(asked))

    def remove(self, result: Result) -> None:
        """Take away one that could not be begun, with what was put into it."""
        for path in result.folder.iterdir():
            path.unlink()
        result.folder.rmdir()

    def find(self, name: str) -> Result:
        """The result of that name.

        Raises
        ------
        AppError
            When there is none.
        """
        folder = self.folder / name if NAME.fullmatch(name) else None
        told = None if folder is None or folder.is_symlink() else _read(folder / ASKED)
        if folder is None or told is None:
            raise AppError("there is no such result; the start page lists those there are")
        return Result(folder, str(told["page"]), str(told["title"]), dict(told["asked"]))

    def latest(self, most: int) -> list[Result]:
        """The newest results, newest first."""
        if not self.folder.is_dir():
            return []
        there = [one.name for one in self.folder.iterdir() if NAME.fullmatch(one.name) and (one / ASKED).is_file()]
        newest = sorted(there, key=lambda name: name.split("-", 1)[1], reverse=True)
        return [self.find(name) for name in newest[:most]]


def _read(path: Path) -> dict[str, Any] | None:
    if not path.is_file():
        return None
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except ValueError:
        return None
    return found if isinstance(found, dict) else None
