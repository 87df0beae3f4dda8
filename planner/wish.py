"""What a scene asked for in a frame, and on which of many devices it is felt."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from encoders import Frame

__all__ = ["CONTRAST_LIMIT_DB", "DOT_THRESHOLD", "FrameVerdict", "FrameWish", "contrast_between", "threshold_for"]

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]

DOT_THRESHOLD = 0.5
"""An actuator counts as a raised dot from this amplitude on, in units of full scale."""

CONTRAST_LIMIT_DB = 12.0
"""Least contrast of dots where nothing else is asked."""

# A level wished so near the threshold may be felt on either side of it.
NEAR = 0.02
# A wish between these is a level, neither a raised dot nor a flat one.
GRADED = (0.3, 0.9)
# A contrast that is missed by less than this is kept: reports say decibels to one place.
SLACK_DB = 0.05


@dataclass(frozen=True)
class FrameWish:
    """What a scene asked for in one frame, whatever a plan aims at.

    Attributes
    ----------
    level : float64, shape (rows, cols), amplitude in units of full scale; NaN where any will do.
    contrast_db : decibels asked between the weakest raised and the strongest flat dot; None where nothing was asked.
    braille : it is read as cells, so that every level is a raised dot or a flat one.
    """

    level: Floats
    contrast_db: float | None = None
    braille: bool = False

    @classmethod
    def of(cls, frame: Frame, contrast_db: float | None = None) -> FrameWish:
        """The wish of a frame of a scene."""
        pattern = frame.pattern
        level = np.abs(pattern.amplitude)
        if pattern.weight is not None:
            level = np.where(np.asarray(pattern.weight) > 0, level, np.nan)
        return cls(level, contrast_db, bool(frame.cells.strip()))

    @property
    def threshold(self) -> float:
        """From which amplitude on a dot is felt as raised."""
        return threshold_for(CONTRAST_LIMIT_DB if self.contrast_db is None else self.contrast_db)

    @property
    def raised(self) -> Mask:
        """Where a raised dot is wished; bool, shape (rows, cols)."""
        return np.asarray(self.level >= self.threshold)

    @property
    def flat(self) -> Mask:
        """Where a flat dot is wished; bool, shape (rows, cols)."""
        return np.asarray(self.level < self.threshold)

    @cached_property
    def dots(self) -> bool:
        """Whether nothing but raised and flat dots is wished; else levels are, which have no contrast."""
        graded = (self.level > GRADED[0]) & (self.level < GRADED[1])
        return self.braille or not graded.any()

    @property
    def least_db(self) -> float | None:
        """The contrast that is needed; None where the frame has none, or its own levels ask for less."""
        least = CONTRAST_LIMIT_DB if self.contrast_db is None else self.contrast_db
        wished = contrast_between(self.raised, self.flat, self.level) if self.dots else None
        if wished is None or (wished < least and not self.braille):
            return None
        return least

    def clear(self, contrast_db: float | Floats | None) -> Mask:
        """Whether a contrast, or each of many, is as much as is needed; None is that of a frame that has none."""
        least = self.least_db
        return np.asarray(least is None or contrast_db is None or np.asarray(contrast_db) >= least - SLACK_DB)

    def verdict(self, felt: Floats) -> FrameVerdict:
        """What devices make of the wish.

        Parameters
        ----------
        felt : float64, shape (..., rows, cols), amplitude in units of full scale, NaN where it is not known; a
            device each.
        """
        near = np.abs(self.level - self.threshold) <= NEAR
        wrong = np.where(self.raised, ~(felt >= self.threshold), ~(felt < self.threshold))
        wrong &= ~(np.isnan(self.level) | (near & ~np.isnan(felt)))
        contrast_db = contrast_between(self.raised, self.flat, felt) if self.dots else None
        return FrameVerdict(self, wrong, contrast_db)


@dataclass(frozen=True)
class FrameVerdict:
    """A wish on many devices, of any shape D.

    Attributes
    ----------
    wish : what was asked.
    wrong : bool, shape (*D, rows, cols), dots on the wrong side of the threshold, or not known.
    contrast_db : float64, shape D, weakest raised dot over strongest flat one in decibels, infinite over silence, NaN
        where it is not known; None when the frame lacks either, or has levels.
    """

    wish: FrameWish
    wrong: Mask
    contrast_db: Floats | None

    @property
    def wrong_dots(self) -> NDArray[np.intp]:
        """How many dots are wrong; shape D."""
        return np.asarray(np.count_nonzero(self.wrong, axis=(-2, -1)))

    @property
    def clear(self) -> Mask:
        """Where dots stand out as far as is needed; bool, shape D."""
        return np.broadcast_to(self.wish.clear(self.contrast_db), self.wrong.shape[:-2])

    @property
    def right(self) -> Mask:
        """Where no dot is wrong; bool, shape D."""
        return np.asarray(~self.wrong.any(axis=(-2, -1)))

    @property
    def ok(self) -> Mask:
        """Where the wish is felt; bool, shape D."""
        return np.asarray(self.right & self.clear)

    @property
    def share(self) -> float:
        """The share of devices on which the wish is felt."""
        return float(np.mean(self.ok))

    @property
    def worst_dot(self) -> tuple[int, int] | None:
        """Row and column of the dot that is wrong on most devices, from 0; None where none is."""
        often = self.wrong.reshape(-1, *self.wrong.shape[-2:]).sum(axis=0)
        row, col = np.unravel_index(int(np.argmax(often)), often.shape)
        return (int(row), int(col)) if often[row, col] else None


def threshold_for(contrast_db: float) -> float:
    """From which amplitude on a dot is felt as raised, in units of full scale.

    Half of it; where less than 12 dB are asked for, in the middle between a raised dot and a flat one.
    """
    return DOT_THRESHOLD if contrast_db >= CONTRAST_LIMIT_DB else 10 ** (-contrast_db / 40)


def contrast_between(raised: Mask, flat: Mask, level: Floats) -> Floats | None:
    """Weakest raised dot over strongest flat one in decibels, of levels of shape (..., rows, cols).

    Infinite over silence; None when there are no raised or no flat ones.
    """
    if not raised.any() or not flat.any():
        return None
    weakest, strongest = np.abs(level[..., raised]).min(axis=-1), np.abs(level[..., flat]).max(axis=-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(20 * np.log10(weakest / strongest))
