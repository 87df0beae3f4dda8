"""The choices of `dotwave text`, spelled once for the command line."""

from __future__ import annotations

from dataclasses import replace
from enum import StrEnum
from typing import TYPE_CHECKING, Any

from ..errors import AppError

if TYPE_CHECKING:
    from encoders import TextOptions

__all__ = ["Dots", "Presentation", "SampleFormat", "Undefined", "place_of", "text_options"]


class Undefined(StrEnum):
    """What to do with a character the table cannot write (`encoders.Undefined`, light to import)."""

    NAME = "name"
    DROP = "drop"
    ERROR = "error"


class Presentation(StrEnum):
    """How the dots of a page are shown (`encoders.Presentation`, light to import)."""

    TOGETHER = "together"
    BY_ROW = "by-row"
    BY_DOT = "by-dot"


class Dots(StrEnum):
    """How many dots a cell has; auto takes what the table needs."""

    AUTO = "auto"
    SIX = "6"
    EIGHT = "8"


class SampleFormat(StrEnum):
    """Number format of the samples."""

    FLOAT32 = "float32"
    PCM24 = "pcm24"


def text_options(**given: Any) -> TextOptions:
    """`encoders.TextOptions` with its own defaults wherever the command line says nothing (None).

    Raises
    ------
    encoders.EncodeError
        When a value is out of range.
    """
    from encoders import Presentation as Shown, TextOptions, Undefined as Policy

    chosen = {name: value for name, value in given.items() if value is not None}
    if "undefined" in chosen:
        chosen["undefined"] = Policy(chosen["undefined"].value)
    if "presentation" in chosen:
        chosen["presentation"] = Shown(chosen["presentation"].value)
    if "dots" in chosen:
        chosen["dots"] = None if chosen["dots"] is Dots.AUTO else int(chosen["dots"].value)
    return replace(TextOptions(), **chosen)


def place_of(words: str | None) -> tuple[int, int] | None:
    """An actuator given as ``ROW,COL``, counted from 0.

    Raises
    ------
    AppError
        When it is not two whole numbers.
    """
    if words is None:
        return None
    parts = words.split(",")
    if len(parts) != 2 or not all(part.strip().isdecimal() for part in parts):
        raise AppError(f"actuator: expected ROW,COL such as 2,3, got {words!r}")
    return int(parts[0]), int(parts[1])
