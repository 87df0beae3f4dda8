"""What a person asks of a run: how exact, how quick, in which numbers, and what is to be told beside."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from drivers import Encoding

from .errors import AppError

__all__ = [
    "TOLERANCES", "FrameRequest", "Request", "frame_request", "picture_name", "request_of", "seconds_of",
    "tolerance_of",
]  # fmt: skip

TOLERANCES = {"draft": 0.1, "normal": 0.02, "fine": 0.005}
"""Largest predicted deviation of an actuator from what is wanted, in units of full scale."""

UNITS = {"us": 1e-6, "ms": 1e-3, "s": 1.0, "": 1.0}


@dataclass(frozen=True)
class FrameRequest:
    """A frame, counted from 1, whose choices are listed and, with a picture, drawn."""

    number: int
    picture: Path | None = None


@dataclass(frozen=True)
class Request:
    """What is asked of a run; None and False: nothing.

    Attributes
    ----------
    tol : largest deviation of an actuator, in units of full scale.
    budget_s : seconds for planning.
    explain : list what the scene requires.
    pareto : list what a frame can be bought for.
    contrast_db : how far unraised dots stay below raised ones, planned and judged.
    yield_ : share of devices, drawn with the device's spread, that are to keep what is wished.
    encoding : number format of samples.
    actuator : (row, col) that a haptic file of one actuator shows; None is the mean over the grid.
    yes : do not ask before a very large file.
    """

    tol: float | None = None
    budget_s: float | None = None
    explain: bool = False
    pareto: FrameRequest | None = None
    contrast_db: float | None = None
    yield_: float | None = None
    encoding: Encoding = "float32"
    actuator: tuple[int, int] | None = None
    yes: bool = False


def request_of(
    *, tol: str | None = None, budget: str | None = None, pareto: str | None = None, **given: Any
) -> Request:
    """What options of the command line ask for; those that need no reading are given on as they are.

    Raises
    ------
    AppError
        When one cannot be read.
    """
    return Request(
        tol=None if tol is None else tolerance_of(tol),
        budget_s=None if budget is None else seconds_of(budget),
        pareto=None if pareto is None else frame_request(pareto),
        **given,
    )


def tolerance_of(words: str) -> float:
    """A tolerance by name, or a number above 0 such as 1e-3.

    Raises
    ------
    AppError
        When it is neither.
    """
    if words in TOLERANCES:
        return TOLERANCES[words]
    try:
        number = float(words)
    except ValueError:
        number = 0.0
    if not (math.isfinite(number) and number > 0):
        raise AppError(f"--tol: expected {', '.join(TOLERANCES)} or a number above 0 such as 1e-3, got {words!r}")
    return number


def seconds_of(words: str) -> float:
    """A time such as 50ms, 2 s or 0.5 in seconds.

    Raises
    ------
    AppError
        When it is not one.
    """
    found = re.fullmatch(r"\s*([0-9.eE+-]+)\s*(us|ms|s|)\s*", words)
    try:
        number = float(found[1]) if found else 0.0
    except ValueError:
        number = 0.0
    if not (found and 0 < number < 1e9):
        raise AppError(f"--budget: expected a time above 0 such as 50ms or 2s, got {words!r}")
    return number * UNITS[found[2]]


def frame_request(words: str) -> FrameRequest:
    """A frame's number, a picture's name for the first frame, or both with a colon between: ``2:ways.png``.

    Raises
    ------
    AppError
        When it is none of these.
    """
    number, _, name = words.partition(":") if words.partition(":")[0].isdecimal() else ("1", ":", words)
    if int(number) < 1 or not words or (":" in words and not name):
        raise AppError(f"--pareto: expected a frame from 1, a picture, or 2:ways.png, got {words!r}")
    return FrameRequest(int(number), picture_name(Path(name)) if name else None)


def picture_name(path: Path) -> Path:
    """`path`, when it names a picture that can be drawn.

    Raises
    ------
    AppError
        When it does not.
    """
    if path.suffix.lower() not in (".png", ".svg"):
        raise AppError(f"{path}: expected a picture name that ends with .png or .svg")
    return path
