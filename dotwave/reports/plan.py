"""What all reports on a plan share: a verdict, and plain JSON types."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from ..plain import one_line

__all__ = ["PlanReport", "plain"]


class PlanReport(ABC):
    """What reports on a plan have in common: a verdict, and two forms."""

    outcomes: Mapping[str, int]

    @property
    def ok(self) -> bool:
        """Every frame can be made as asked."""
        return set(self.outcomes) <= {"ok"}

    def as_dict(self) -> dict[str, Any]:
        """The report in plain JSON types; a number that is not finite becomes null."""
        return {"ok": self.ok} | {name: plain(value) for name, value in vars(self).items()}

    def as_text(self) -> str:
        """The report as lines of plain text."""
        return "\n".join(map(one_line, self._lines()))

    @abstractmethod
    def _lines(self) -> Iterator[str]: ...


def plain(value: object) -> Any:
    """`value` in plain JSON types: arrays as rounded lists, numbers that are not finite as null."""
    if isinstance(value, np.ndarray):
        return [plain(item) for item in value]
    if isinstance(value, float | np.floating):
        return float(f"{value:.9g}") if math.isfinite(value) else None
    if isinstance(value, np.integer):
        return int(value)
    if hasattr(value, "as_dict"):
        return plain(value.as_dict())
    if isinstance(value, tuple | list):
        return [plain(item) for item in value]
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    return value
