"""The choices of `dotwave text` and `dotwave image`, as the command line gives them."""

from __future__ import annotations

from dataclasses import replace
from enum import StrEnum
from typing import TYPE_CHECKING, Any

from encoders import Grade

from ..errors import AppError

if TYPE_CHECKING:
    from chainsim import Device
    from encoders import PictureOptions, TextOptions

__all__ = ["Dots", "SampleFormat", "picture_options", "place_of", "profile_of", "refuse", "text_options"]


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
    AppError, encoders.EncodeError
        When a value is out of range, or a language is given beside a table.
    """
    from encoders import TextOptions

    chosen = {name: value for name, value in given.items() if value is not None}
    language, grade = chosen.pop("language", None), chosen.pop("grade", None)
    if language is not None:
        if "table" in chosen:
            raise AppError(f"--language: --table {chosen['table']} names the table; give one of them")
        chosen["table"] = f"language:{language} grade:{grade or Grade.UNCONTRACTED}"
    elif grade is not None:
        raise AppError(f"--grade {grade}: it chooses between tables of a language; give --language too")
    if "dots" in chosen:
        chosen["dots"] = None if chosen["dots"] is Dots.AUTO else int(chosen["dots"].value)
    return replace(TextOptions(), **chosen)


def picture_options(**given: Any) -> PictureOptions:
    """`encoders.PictureOptions` with its own defaults wherever the command line says nothing (None).

    Raises
    ------
    AppError, encoders.PictureError
        When a word is not one of its choices, or a number is out of range.
    """
    from encoders import PictureOptions, picture_rules

    chosen = {name: value for name, value in given.items() if value is not None}
    for name, value in chosen.items():
        words = picture_rules()[name].choices
        if words and value not in words:
            option = "as" if name == "output" else name
            raise AppError(f"--{option}: expected one of {', '.join(words)}, got {value!r}")
    return PictureOptions(**chosen)


def refuse(what: str, **given: Any) -> None:
    """Refuse the options in `given` that say something (are not None).

    Raises
    ------
    AppError
        For the first of them; `what` is what they belong to.
    """
    for name, value in given.items():
        if value is not None:
            raise AppError(f"--{name} belongs to {what}; give that too, or leave it out")


def profile_of(device: str, modulation: str | None) -> Device:
    """The device of that name or file, its carriers modulated as ``HZ`` or ``HZ,DEPTH`` says.

    Raises
    ------
    AppError, chainsim.ChainError
        When there is no such device, or the modulation is none, or none for it.
    """
    from ..api.scenes import device as device_of

    if modulation is None:
        return device_of(device)
    hz, _, depth = modulation.partition(",")
    try:
        given = {"hz": float(hz)} | ({"depth": float(depth)} if depth else {})
    except ValueError:
        raise AppError(f"--modulation: expected HZ or HZ,DEPTH such as 200 or 200,0.8, got {modulation!r}") from None
    return device_of({"base": device, "modulation": given})


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
