"""What an argument of the command line means: standard input, a file, or the words themselves."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from encoders import TextSource

from .errors import AppError

if TYPE_CHECKING:
    from chainsim import Simulation

__all__ = ["simulation_source", "text_source"]

PIPE = "echo ... | dotwave text -"


def text_source(argument: str) -> TextSource:
    """`argument` as standard input (``-``), an existing file, or literal text.

    Raises
    ------
    AppError
        When it is a folder, or looks like a file that does not exist.
    encoders.EncodeError
        When what it names is not text, is broken, or is empty.
    """
    if argument == "-":
        return TextSource.of_stream(sys.stdin.buffer)
    if os.path.isdir(argument):
        raise AppError(f"{argument}: is a folder; name a text file, or pipe the words: {PIPE}")
    if os.path.exists(argument):
        return TextSource.of_path(Path(argument))
    if _looks_like_path(argument):
        raise AppError(f"{argument}: no such file; correct the path, or pipe the words: {PIPE}")
    return TextSource.of_text(argument)


def _looks_like_path(argument: str) -> bool:
    spaced = any(character.isspace() for character in argument)
    return not spaced and ("/" in argument or argument.lower().endswith((".txt", ".brf")))


def simulation_source(argument: str) -> Path | Simulation:
    """A chain file, or standard input (``-``), for `chainsim.simulate`.

    Raises
    ------
    chainsim.ProfileError
        When standard input does not fit.
    """
    if argument != "-":
        return Path(argument)
    from chainsim import parse_simulation

    return parse_simulation(sys.stdin.read(), "standard input")
