"""What every format of samples supplies, and opening a file by the ending of its name."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import BinaryIO, Protocol

import numpy as np
from numpy.typing import NDArray

from ..channels import Channel
from ..errors import WaveformError
from ..files.whole import check_plain
from .table import FORMATS, SUFFIXES, format_of
from .wav import Encoding

__all__ = ["SampleReader", "SampleWriter", "open_samples", "writer_for"]

Floats = NDArray[np.float64]


class SampleWriter(Protocol):
    """Takes blocks of volts, float64, shape (S, channels), and puts them into an open file."""

    samples: int

    def write(self, block: Floats) -> None:
        """Append a block."""
        ...

    def finish(self) -> None:
        """Complete the file; it stays open."""
        ...


class SampleReader(Protocol):
    """Gives the samples of a file back as volts, a block at a time."""

    @property
    def path(self) -> Path:
        """The file."""
        ...

    @property
    def rate_hz(self) -> int:
        """Samples per second."""
        ...

    @property
    def samples(self) -> int:
        """Samples per channel."""
        ...

    def blocks(self, block: int) -> Iterator[Floats]:
        """The samples from the start, float64, shape (S, channels), volts."""
        ...


def writer_for(
    path: Path, file: BinaryIO, channels: Sequence[Channel], rate_hz: int, encoding: Encoding
) -> SampleWriter:
    """The writer for the ending of `path`, on an open and empty file.

    Raises
    ------
    FileError, WaveformError
        When there is none, or the encoding is not one of its own.
    """
    form = format_of(path, SUFFIXES)
    if encoding not in form.sample_bytes:
        others = " and ".join(suffix for suffix in SUFFIXES if encoding in FORMATS[suffix].sample_bytes)
        raise WaveformError(f"{path}: {encoding} is an encoding of {others}; leave it out, or write a {others}")
    writer: SampleWriter = form.writer_module().open_writer(file, channels, rate_hz, encoding)
    return writer


def open_samples(path: Path, channels: Sequence[Channel], rate_hz: int) -> SampleReader:
    """The reader for the ending of `path`; `channels` and `rate_hz` are those of its manifest.

    Raises
    ------
    FileError, UnreadableWaveform
        When the file cannot be read or is not of that format.
    """
    form = format_of(path, SUFFIXES)
    check_plain(path)
    reader: SampleReader = form.reader_module().open_reader(path, channels, rate_hz)
    return reader
