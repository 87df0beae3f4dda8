"""On which of many devices a waveform is felt as it should be."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drivers import FrameMark

from .motion import FeltLevels

__all__ = ["Verdict", "joined", "verdict_of"]

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]
Counts = NDArray[np.int64]


@dataclass(frozen=True)
class Verdict:
    """What D devices make of all frames.

    Attributes
    ----------
    ok : bool, shape (D,), whether every dot of every frame is right and stands out as far as it should.
    wrong : int64, shape (rows, cols), on how many devices each dot is wrong in any frame.
    wrong_dots : int64, shape (D,), wrong dots of all frames together.
    contrast_db : float64, shape (D,), weakest contrast of any frame, infinite over silence; NaN where one is not known
        or no frame has one.
    error : float64, shape (D,), worst deviation of a level from the target, in units of full scale.
    escaped : bool, shape (D,), whether an actuator left its softening well.
    """

    ok: Mask
    wrong: Counts
    wrong_dots: Counts
    contrast_db: Floats
    error: Floats
    escaped: Mask


def verdict_of(frames: Iterable[FrameMark], felt: FeltLevels) -> Verdict:
    """Judge levels of shape (D, frames, rows, cols) by the wishes of the frames; errors by what is aimed at."""
    devices, _, rows, cols = felt.level.shape
    ok, contrasts = np.ones(devices, dtype=np.bool_), [np.full(devices, np.nan)]
    wrong, error = np.zeros((devices, rows, cols), dtype=np.bool_), np.zeros(devices)
    wrong_dots = np.zeros(devices, dtype=np.int64)
    for number, mark in enumerate(frames):
        level = felt.level[:, number]
        found = mark.wish.verdict(level)
        if found.contrast_db is not None:
            contrasts.append(found.contrast_db)
        ok &= found.ok
        wrong |= found.wrong
        wrong_dots += found.wrong_dots
        error = np.maximum(error, np.abs(level - mark.target).max(axis=(1, 2)))
    contrast_db = np.min(contrasts[1:] or contrasts, axis=0)
    return Verdict(ok, np.count_nonzero(wrong, axis=0), wrong_dots, contrast_db, error, felt.escaped)


def joined(parts: Iterable[Verdict]) -> Verdict:
    """The verdict on all devices of several verdicts, in their order."""
    every = list(parts)

    def beside(name: str) -> NDArray[np.generic]:
        return np.concatenate([getattr(part, name) for part in every])

    wrong = np.sum([part.wrong for part in every], axis=0)
    names = ("ok", "wrong_dots", "contrast_db", "error", "escaped")
    return Verdict(wrong=wrong, **{name: beside(name) for name in names})  # type: ignore[arg-type]
