"""Numbers that people type into forms."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from ..errors import AppError

__all__ = ["NumberField"]


@dataclass(frozen=True)
class NumberField:
    """A number field, with a slider beside it.

    Attributes
    ----------
    name, label : of the field.
    usual : what it begins with.
    low, high : what is allowed.
    slide_low, slide_high, step : of the slider.
    hint : what it means, with its unit.
    whole : only whole numbers.
    """

    name: str
    label: str
    usual: float
    low: float
    high: float
    slide_low: float
    slide_high: float
    step: float
    hint: str = ""
    whole: bool = False

    def of(self, given: Mapping[str, str]) -> float:
        """The number that was typed; the usual one where the field is missing.

        Raises
        ------
        AppError
            When it is none, or out of range.
        """
        words = given.get(self.name, f"{self.usual:g}").strip()
        try:
            number = float(words.replace(",", "."))
        except ValueError:
            number = math.nan
        if not self.low <= number <= self.high or (self.whole and number != int(number)):
            kind = "a whole number" if self.whole else "a number"
            raise AppError(f"{self.label}: expected {kind} from {self.low:g} to {self.high:g}, got {words!r}")
        return number
