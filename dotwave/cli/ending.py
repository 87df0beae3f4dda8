"""How a run of the command line ends: its exit code, and the one line on what went wrong."""

from __future__ import annotations

import os
import re
import sys
import traceback
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

import typer

from ..errors import bad_input
from .command import printable

__all__ = ["ended"]

BAD_INPUT, FAULT, INTERRUPTED, NO_READER = 2, 70, 130, 141
# Of a word longer than a path can sensibly be only the ends are shown.
LONG_WORD = re.compile(r"(\S{120})\S{200,}(\S{40})")


class _End(NamedTuple):
    """An exit code, and a line to say with it; empty for none."""

    code: int
    line: str = ""


def ended(command: Callable[[], object]) -> int:
    """Run `command` and say in one line what went wrong; gives the exit code.

    With ``DOTWAVE_DEBUG=1`` the traceback comes before the line.
    """
    end = _ran(command)
    if end.line:
        line = LONG_WORD.sub(r"\1...\2", printable(" ".join(end.line.split())))
        with suppress(OSError):
            typer.echo(f"dotwave: {line}", err=True)
    _give_up_output()
    return end.code


def _give_up_output() -> None:
    """What could not be written is thrown away: when Python tries it once more at its end, it would say 120."""
    try:
        sys.stdout.flush()
    except OSError:
        with suppress(OSError, ValueError):
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _ran(command: Callable[[], object]) -> _End:
    try:
        command()
    except SystemExit as end:
        # Where nobody reads the output any more, the parser of the command line has ended with 1.
        gone = isinstance(end.__context__, BrokenPipeError)
        return _End(NO_READER if gone else end.code if isinstance(end.code, int) else 0)
    except KeyboardInterrupt:
        return _End(INTERRUPTED)
    except Exception as error:
        # The last net: whatever else comes up is said in a line, with the way to more.
        if os.environ.get("DOTWAVE_DEBUG") == "1":
            traceback.print_exc()
        return _told(error)
    return _End(0)


def _told(error: Exception) -> _End:
    if isinstance(error, bad_input()):
        return _End(BAD_INPUT, str(error))
    if isinstance(error, OSError):
        return _End(BAD_INPUT, _refused(error))
    if isinstance(error, MemoryError):
        why = f" ({error})" if str(error) else ""
        return _End(BAD_INPUT, f"not enough memory{why}; give it less at a time, or free some")
    if isinstance(error, RecursionError):
        return _End(BAD_INPUT, "the input is nested too deeply; give it flatter")
    where = traceback.extract_tb(error.__traceback__)[-1]
    return _End(
        FAULT,
        f"a fault in dotwave {_version()}, not in what you gave: {type(error).__name__}: {str(error)[:200]} "
        f"({Path(where.filename).name}:{where.lineno}); please report this line with your command, and what the same "
        "command prints with DOTWAVE_DEBUG=1",
    )


def _refused(error: OSError) -> str:
    """What the system refused, with the file's name and the cure where they are known."""
    if not isinstance(error.filename, str | bytes):
        return f"a file could not be read or written: {error.strerror or error or type(error).__name__}"
    from drivers import FileError, naming

    try:
        with naming(Path(os.fsdecode(error.filename))):
            raise error
    except FileError as named:
        return str(named)


def _version() -> str:
    # Imported here: only a fault needs it.
    from importlib import metadata

    try:
        return metadata.version("dotwave")
    except metadata.PackageNotFoundError:
        return "(not installed)"
