"""Files that a browser sends: only their ending is used, never their name."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path, PurePath

from starlette.datastructures import FormData, UploadFile

from drivers import atomic_file

from ..errors import AppError

__all__ = ["ending_of", "file_of", "keep", "words_of_form"]

PIECE = 1 << 20


def words_of_form(form: FormData) -> dict[str, str]:
    """The fields of a form that are words."""
    return {name: value for name, value in form.items() if isinstance(value, str)}


def file_of(form: FormData, name: str) -> UploadFile | None:
    """The file of a field; None where none was chosen."""
    given = form.get(name)
    return given if isinstance(given, UploadFile) and given.filename else None


def ending_of(file: UploadFile, endings: Iterable[str], label: str) -> str:
    """Which of the known endings its name has.

    Raises
    ------
    AppError
        When it has none of them.
    """
    name = PurePath(file.filename or "").name
    longest_first = sorted(endings, key=len, reverse=True)
    ending = next((one for one in longest_first if name.lower().endswith(one)), None)
    if ending is None:
        raise AppError(f"{label}: {name[:100]!r} has another ending than {', '.join(sorted(longest_first))}")
    return ending


async def keep(file: UploadFile, path: Path) -> None:
    """Write it to `path`, whole or not at all."""
    with atomic_file(path) as copy:
        while piece := await file.read(PIECE):
            copy.write(piece)
