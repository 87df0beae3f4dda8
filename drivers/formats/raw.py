"""Samples without a header: float32 of full scale, little-endian, channels interleaved."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from ..channels import Channel
from ..errors import UnreadableWaveform
from ..files.whole import naming

__all__ = ["RawReader", "RawWriter", "check_finite", "open_reader", "open_writer"]

Floats = NDArray[np.float64]


class RawWriter:
    """Writes volts / volts_per_unit of each channel as float32."""

    def __init__(self, file: BinaryIO, channels: Sequence[Channel], rate_hz: int) -> None:
        self._file = file
        self._unit = np.array([channel.volts_per_unit for channel in channels])
        self.samples = 0

    def write(self, block: Floats) -> None:
        """Append samples; float64, shape (S, channels), volts."""
        self._file.write((block / self._unit).astype("<f4", order="C").data)
        self.samples += len(block)

    def finish(self) -> None:
        """Nothing is missing; the file stays open."""
        self._file.flush()


@dataclass(frozen=True)
class RawReader:
    """The samples of a raw file. `unit` : float64, shape (channels,), volts for a stored 1."""

    path: Path
    rate_hz: int
    samples: int
    unit: Floats

    @classmethod
    def open(cls, path: Path, channels: Sequence[Channel], rate_hz: int) -> RawReader:
        """Check the size of `path`; channels and rate come from its manifest.

        Raises
        ------
        FileError, UnreadableWaveform
            When it cannot be read, or ends within a sample.
        """
        unit = np.array([channel.volts_per_unit for channel in channels])
        with naming(path):
            size = path.stat().st_size
        if size % (4 * len(unit)):
            raise UnreadableWaveform(f"{path}: {size} bytes are not whole samples of {len(unit)} float32 channels")
        return cls(path, rate_hz, size // (4 * len(unit)), unit)

    def blocks(self, block: int) -> Iterator[Floats]:
        """The samples from the start, float64, shape (S, channels), volts.

        Raises
        ------
        FileError, UnreadableWaveform
            When the file cannot be read, has become shorter, or holds a value that is not finite.
        """
        with naming(self.path):
            file = self.path.open("rb")
        with file:
            for first in range(0, self.samples, block):
                wanted = min(block, self.samples - first) * len(self.unit)
                with naming(self.path):
                    raw = file.read(4 * wanted)
                if len(raw) < 4 * wanted:
                    raise UnreadableWaveform(f"{self.path}: it ends early")
                with np.errstate(invalid="ignore", over="ignore"):
                    values = np.frombuffer(raw, dtype="<f4").astype(np.float64).reshape(-1, len(self.unit)) * self.unit
                check_finite(self.path, values, first, self.rate_hz)
                yield values


def check_finite(path: Path, values: Floats, first: int, rate_hz: int) -> None:
    """Refuse values that are not finite; `first` is the sample that `values` begin with.

    Raises
    ------
    UnreadableWaveform
        With the first such value's place.
    """
    if not np.isfinite(values).all():
        sample, channel = np.argwhere(~np.isfinite(values))[0]
        time_s = (first + int(sample)) / rate_hz
        raise UnreadableWaveform(
            f"{path}: channel {channel} at {time_s:.6g} s is {values[sample, channel]}, not a number"
        )


def open_writer(file: BinaryIO, channels: Sequence[Channel], rate_hz: int, _encoding: str) -> RawWriter:
    """A writer on an open and empty file."""
    return RawWriter(file, channels, rate_hz)


open_reader = RawReader.open
