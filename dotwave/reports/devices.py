"""On how many devices a scene is felt as it was wished, and how well they must be known for more."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from planner import spread_words

__all__ = ["YieldReport"]


@dataclass(frozen=True)
class YieldReport:
    """The share of devices, drawn with the spread, on which every frame is felt as it was wished.

    Attributes
    ----------
    share : of devices.
    wanted : the share that was asked for, or the usual one.
    asked : whether it was asked for.
    needed : what the spread must be multiplied by for it; 1 where it is good enough, 0 where no part that was tried is.
    spread : relative standard deviations of frequency, damping, beta and lam.
    draws : how many devices were drawn.
    """

    share: float
    wanted: float
    asked: bool
    needed: float
    spread: tuple[float, float, float, float]
    draws: int

    @property
    def met(self) -> bool:
        """Whether the share is reached, or none was asked for."""
        return self.share >= self.wanted or not self.asked

    def as_dict(self) -> dict[str, Any]:
        """Plain JSON types."""
        return {name: value for name, value in vars(self).items() if name != "spread"} | {"met": self.met}

    def as_text(self) -> str:
        """One sentence."""
        if self.share >= self.wanted:
            accuracy = f"a calibration to {spread_words(self.spread, 1.0)} is enough"
        elif self.needed > 0:
            accuracy = f"that takes a calibration to {spread_words(self.spread, self.needed)}"
        else:
            accuracy = "no accuracy of calibration that was tried is enough"
        # Rounded down, so that what is not reached does not look so.
        share = math.floor(100 * self.share + 1e-9)
        wanted = f"{100 * self.wanted:g} {'wanted' if self.asked else 'would be usual'}"
        return f"Ok on {share} of 100 devices; {wanted}: {accuracy}."
