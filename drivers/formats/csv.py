"""Samples for people: a CSV with a time column and a column of volts for every channel."""

from __future__ import annotations

import io
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from ..channels import Channel
from ..errors import UnreadableWaveform
from ..files.whole import naming
from .raw import check_finite

__all__ = ["CsvReader", "CsvWriter", "open_reader", "open_writer"]

Floats = NDArray[np.float64]

DIGITS = 9  # keeps any float32 apart from its neighbours
LONGEST_NAMES = 1 << 20
LONGEST_NUMBER = 40


class CsvWriter:
    """Writes a line of column names, then one line a sample: seconds, and volts with 9 significant digits."""

    def __init__(self, file: BinaryIO, channels: Sequence[Channel], rate_hz: int) -> None:
        self._file = file
        self._rate_hz = rate_hz
        self._format = "%.9f" + f",%.{DIGITS}g" * len(channels) + "\n"
        self.samples = 0
        file.write((",".join(_names(channels)) + "\n").encode())

    def write(self, block: Floats) -> None:
        """Append samples; float64, shape (S, channels), volts."""
        time_s = np.arange(self.samples, self.samples + len(block)) / self._rate_hz
        rows = np.column_stack([time_s, block]).tolist()
        self._file.write("".join(self._format % tuple(row) for row in rows).encode())
        self.samples += len(block)

    def finish(self) -> None:
        """Nothing is missing; the file stays open."""
        self._file.flush()


def _names(channels: Sequence[Channel]) -> list[str]:
    places = (f"{c.role} r{c.row}" + ("" if c.col is None else f" c{c.col}") for c in channels)
    return ["time_s", *(f"{place} (V)" for place in places)]


@dataclass(frozen=True)
class CsvReader:
    """The samples of a CSV as `CsvWriter` writes it."""

    path: Path
    rate_hz: int
    samples: int
    columns: int

    @classmethod
    def open(cls, path: Path, channels: Sequence[Channel], rate_hz: int) -> CsvReader:
        """Check the first line of `path` and count the others; the rate comes from its manifest.

        Raises
        ------
        FileError, UnreadableWaveform
            When it cannot be read, or its columns are not those of the channels.
        """
        names = _names(channels)
        with naming(path), path.open("rb") as file:
            first = file.readline(LONGEST_NAMES).decode("utf-8", "replace").rstrip("\r\n")
            if first != ",".join(names):
                raise UnreadableWaveform(f"{path}:1: expected the columns {names[0]}, {names[1]}, ... of its manifest")
            samples = sum(piece.count(b"\n") for piece in iter(lambda: file.read(1 << 20), b""))
        return cls(path, rate_hz, samples, len(names))

    def blocks(self, block: int) -> Iterator[Floats]:
        """The samples from the start, float64, shape (S, channels), volts.

        Raises
        ------
        FileError, UnreadableWaveform
            When the file cannot be read, or a line does not hold the time and a number for every channel.
        """
        with naming(self.path):
            file = self.path.open("rb")
        longest = LONGEST_NUMBER * self.columns
        with file:
            file.readline(LONGEST_NAMES)
            for first in range(0, self.samples, block):
                with naming(self.path):
                    lines = [file.readline(longest) for _ in range(min(block, self.samples - first))]
                values = self._values(lines, first)
                check_finite(self.path, values[:, 1:], first, self.rate_hz)
                yield values[:, 1:]

    def _values(self, lines: list[bytes], first: int) -> Floats:
        for number, line in enumerate(lines, first):
            if line.count(b",") != self.columns - 1:
                raise UnreadableWaveform(f"{self.path}:{number + 2}: expected {self.columns} columns")
        try:
            values = np.loadtxt(io.BytesIO(b"".join(lines)), delimiter=",", ndmin=2, comments=None)
        except ValueError as error:
            where = str(error).split(";")[0]
            raise UnreadableWaveform(f"{self.path}: from line {first + 2} on: {where}") from None
        late = np.abs(values[:, 0] - np.arange(first, first + len(values)) / self.rate_hz) > 0.5 / self.rate_hz
        if late.any():
            raise UnreadableWaveform(f"{self.path}:{first + 2 + int(np.argmax(late))}: not the time of this sample")
        return np.asarray(values, dtype=np.float64)


def open_writer(file: BinaryIO, channels: Sequence[Channel], rate_hz: int, _encoding: str) -> CsvWriter:
    """A writer on an open and empty file."""
    return CsvWriter(file, channels, rate_hz)


open_reader = CsvReader.open
