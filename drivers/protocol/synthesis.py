"""What a controller makes by itself between two packets: linear glides and cross-faded tones."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .messages import WireTone

__all__ = ["Glide", "ToneMix"]

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Glide:
    """Numbers that go linearly from `before` at sample `start` to `after` at start + ramp; float64, shape (k,)."""

    start: int
    ramp: int
    before: Floats
    after: Floats

    @classmethod
    def still(cls, values: ArrayLike) -> Glide:
        """Numbers that stay."""
        array = np.asarray(values, dtype=np.float64)
        return cls(0, 0, array, array)

    @property
    def moves_or_is_set(self) -> bool:
        """Whether it is ever anything but zero."""
        return bool(self.before.any() or self.after.any())

    def at(self, index: NDArray[np.intp]) -> Floats:
        """The numbers at samples `index`, none before the start; float64, shape (S, k)."""
        done = np.ones(len(index)) if self.ramp == 0 else ((index - self.start) / self.ramp).clip(0.0, 1.0)
        mixed: Floats = (1 - done)[:, np.newaxis] * self.before + done[:, np.newaxis] * self.after
        return mixed

    def then(self, start: int, ramp: int, after: ArrayLike) -> Glide:
        """A glide from where this one is at sample `start`."""
        return Glide(start, ramp, self.at(np.array([start]))[0], np.asarray(after, dtype=np.float64))


@dataclass
class ToneMix:
    """Sets of tones, each with its weight: the newest rises to 1 while those before it fall to 0."""

    sets: list[tuple[tuple[WireTone, ...], Glide]] = field(default_factory=list)

    @property
    def any(self) -> bool:
        """Whether anything sounds."""
        return bool(self.sets)

    def change(self, start: int, ramp: int, tones: tuple[WireTone, ...]) -> None:
        """From sample `start` fade to `tones` over `ramp` samples."""
        here = np.array([start])
        fading = [(old, weight.then(start, ramp, [0.0])) for old, weight in self.sets if weight.at(here)[0, 0] > 0]
        new = [(tones, Glide(start, ramp, np.zeros(1), np.ones(1)))] if tones else []
        self.sets = [*fading, *new] if ramp else new

    def at(self, index: NDArray[np.intp], rate_hz: int) -> Floats:
        """Volts at samples `index`; float64, shape (S,)."""
        volts = np.zeros(len(index))
        time_s = index / rate_hz
        for tones, weight in self.sets:
            sound = sum((t.volts * np.cos(2 * np.pi * t.hz * time_s + t.phase) for t in tones), np.zeros(len(index)))
            volts += weight.at(index)[:, 0] * sound
        return volts
