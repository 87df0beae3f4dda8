"""What an argument of the command line means: standard input, a file, or the words themselves."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

from encoders import TextOptions, TextSource

from .errors import AppError

if TYPE_CHECKING:
    from chainsim import Simulation

__all__ = ["simulation_source", "standard_input", "text_source"]

PIPE = "echo ... | dotwave text -"
STANDARD_INPUT = "standard input"
MAX_CHAIN_BYTES = 4_000_000


def text_source(argument: str, options: TextOptions | None = None) -> TextSource:
    """`argument` as standard input (``-``), an existing file, or literal text.

    Parameters
    ----------
    argument : as it was given.
    options : their encoding and mathematics are for reading.

    Raises
    ------
    AppError
        When it is a folder, or looks like a file that does not exist.
    encoders.EncodeError
        When what it names is not text, is broken, or is empty.
    """
    options = options or TextOptions()
    if argument == "-":
        return TextSource.of_stream(standard_input(), STANDARD_INPUT, encoding=options.encoding, math=options.math)
    if os.path.isdir(argument):
        raise AppError(f"{argument}: is a folder; name a text file, or pipe the words: {PIPE}")
    if os.path.exists(argument):
        return TextSource.of_path(Path(argument), encoding=options.encoding, math=options.math)
    if _looks_like_path(argument):
        raise AppError(f"{argument}: no such file; correct the path, or pipe the words: {PIPE}")
    return TextSource.of_text(argument)


def standard_input() -> BinaryIO:
    """Standard input, for bytes.

    Raises
    ------
    AppError
        When the program was started without.
    """
    if sys.stdin is None:
        raise AppError(f"{STANDARD_INPUT}: is closed; pipe something into it, or name a file")
    return sys.stdin.buffer


def _looks_like_path(argument: str) -> bool:
    spaced = any(character.isspace() for character in argument)
    if spaced or "/" in argument or "." not in argument:
        return not spaced and "/" in argument
    # Imported here: words without a point in them do without.
    from encoders import text_suffixes

    return argument.lower().endswith(text_suffixes())


def simulation_source(argument: str) -> Path | Simulation:
    """A chain file, or standard input (``-``), for `chainsim.simulate`.

    Raises
    ------
    chainsim.ProfileError, AppError
        When standard input does not fit, or is longer than a chain file can be.
    """
    if argument != "-":
        return Path(argument)
    from chainsim import parse_simulation

    data = standard_input().read(MAX_CHAIN_BYTES + 1)
    if len(data) > MAX_CHAIN_BYTES:
        raise AppError(f"{STANDARD_INPUT}: more than {MAX_CHAIN_BYTES} bytes; such a file has at most so many")
    try:
        return parse_simulation(data.decode("utf-8-sig"), STANDARD_INPUT)
    except UnicodeDecodeError as error:
        raise AppError(f"{STANDARD_INPUT}: not UTF-8 at byte {error.start}; save it as UTF-8") from None
