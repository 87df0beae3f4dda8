"""Which of many cases the everyday tests take."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import pytest

__all__ = ["one_in"]


def one_in(every: int, cases: Iterable[Any]) -> list[Any]:
    """All cases: the first of every so many each day, the others with the slow tests.

    Parameters
    ----------
    every : how many stand for one.
    cases : values of a parameter.
    """
    return [
        case if place % every == 0 else pytest.param(case, marks=pytest.mark.slow) for place, case in enumerate(cases)
    ]
