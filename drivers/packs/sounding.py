"""The samples that the curves of a pack stand for, drawn frame by frame."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..protocol.measured import WHOLE_TURN
from .curves import Curve
from .reader import Pack, PackEntry

__all__ = ["PackSamples"]

Floats = NDArray[np.float64]
Whole = NDArray[np.int64]

CHUNK_VALUES = 1 << 17  # samples of all channels drawn at once


@dataclass(frozen=True)
class PackSamples:
    """An entry of a pack, read as a file of samples is.

    Attributes
    ----------
    path : of the pack.
    samples : per channel.
    """

    pack: Pack
    entry: PackEntry
    samples: int

    @property
    def path(self) -> Path:
        """The file."""
        return self.pack.path

    @property
    def rate_hz(self) -> int:
        """Samples per second."""
        return self.pack.header.rate_hz

    def blocks(self, block: int) -> Iterator[Floats]:
        """The samples from the start, float64, shape (S, channels), volts.

        Raises
        ------
        UnreadableWaveform
            When the pack is damaged.
        """
        pending = np.empty((0, self.pack.header.channels))
        for chunk in self._chunks():
            pending = np.concatenate([pending, chunk])
            for first in range(0, len(pending) - block + 1, block):
                yield pending[first : first + block]
            pending = pending[len(pending) // block * block :]
        if len(pending):
            yield pending

    def _chunks(self) -> Iterator[Floats]:
        pack, first, drawing = self.pack, 0, _Drawing()
        size = max(256, CHUNK_VALUES // pack.header.channels)
        for _, samples, ways in pack.frames(self.entry).tolist():
            for row, at in enumerate(ways):
                for place, curve_at in pack.way(at).channels:
                    drawing.begin(int(pack.places[row, place]), pack.curve(curve_at).cut(samples), first)
            for start in range(first, first + samples, size):
                index = np.arange(start, min(start + size, first + samples))
                yield drawing.draw(index, pack.header.channels)
            first += samples


@dataclass
class _Drawing:
    """What every channel does at each carrier: a curve, and the sample that it began with."""

    curves: dict[tuple[int, int], tuple[Curve, int]] = field(default_factory=dict)

    def begin(self, channel: int, curve: Curve, first: int) -> None:
        """From sample `first` on a channel follows another curve."""
        self.curves[channel, curve.turns] = curve, first

    def draw(self, index: Whole, channels: int) -> Floats:
        """All channels at samples `index`; float64, shape (S, channels), volts."""
        out = np.zeros((channels, len(index)))
        drawn: dict[tuple[int, int], Floats] = {}
        waves: dict[int, NDArray[np.complex128]] = {}
        for (channel, turns), (curve, first) in list(self.curves.items()):
            if index[0] >= first + curve.length and not curve.last:
                del self.curves[channel, turns]
                continue
            key = id(curve), first
            if key not in drawn:
                values = curve.values(index - first)
                if turns and turns not in waves:
                    waves[turns] = _wave(index, turns)
                drawn[key] = (values * waves[turns]).real if turns else values.real
            out[channel] += drawn[key]
        return out.T


def _wave(index: Whole, turns: int) -> NDArray[np.complex128]:
    phase = (index.astype(np.uint64) * np.uint64(turns)).astype(np.float64) * (2 * np.pi / WHOLE_TURN)
    return np.asarray(np.exp(1j * phase))
