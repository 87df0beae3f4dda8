"""Which file format a name's ending stands for, and what every format supplies."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from importlib import import_module
from pathlib import Path
from typing import BinaryIO, Protocol

import numpy as np
from numpy.typing import NDArray

from ..channels import Channel
from ..errors import FileError, WaveformError
from ..files.whole import check_plain
from .wav import Encoding, WavWriter
from .wav_reader import WavReader

__all__ = [
    "EXCHANGE_SUFFIXES",
    "SUFFIXES",
    "SampleReader",
    "SampleWriter",
    "check_suffix",
    "open_samples",
    "writer_for",
]

Floats = NDArray[np.float64]

SUFFIXES = {
    ".wav": "for amplifiers; float32 keeps 24 significant bits, PCM24 half a step of the full scale over 2^23",
    ".npz": "exact float64 volts, for numpy",
    ".csv": "volts with 9 significant digits and a time column, for people",
    ".raw": "float32 of full scale, little-endian, channels interleaved, no header",
}
"""Ending of the name -> what the format is for and what it loses."""

EXCHANGE_SUFFIXES = (".hjif", ".ahap", ".haptic")
"""Endings of haptic files, which carry no samples (`drivers.exchange`)."""

# Imported only for a file of theirs: a short text is written in less time than their imports take.
OTHERS = {".npz": (".npz", "Npz"), ".csv": (".csv", "Csv"), ".raw": (".raw", "Raw")}


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


def check_suffix(path: Path) -> str:
    """The ending of `path`, if it stands for a format.

    Raises
    ------
    FileError
        When it does not (the message lists those that do), or the name cannot stand in a manifest.
    """
    suffix = path.suffix.lower()
    try:
        path.name.encode()
    except UnicodeEncodeError:
        raise FileError(f"{path}: its name is not UTF-8 and cannot stand in a manifest; give another") from None
    if suffix not in SUFFIXES:
        raise FileError(f"{path}: expected a name that ends in {', '.join((*SUFFIXES, *EXCHANGE_SUFFIXES))}")
    return suffix


def writer_for(
    path: Path, file: BinaryIO, channels: Sequence[Channel], rate_hz: int, encoding: Encoding
) -> SampleWriter:
    """The writer for the ending of `path`, on an open and empty file.

    Raises
    ------
    FileError, WaveformError
        When there is none, or the encoding is not one of its own.
    """
    suffix = check_suffix(path)
    if suffix == ".wav":
        return WavWriter(file, channels, rate_hz, encoding)
    if encoding != "float32":
        raise WaveformError(f"{path}: {encoding} is an encoding of .wav; leave it out, or write a .wav")
    module, name = OTHERS[suffix]
    writer: SampleWriter = getattr(import_module(module, __package__), f"{name}Writer")(file, channels, rate_hz)
    return writer


def open_samples(path: Path, channels: Sequence[Channel], rate_hz: int) -> SampleReader:
    """The reader for the ending of `path`; `channels` and `rate_hz` are those of its manifest.

    Raises
    ------
    FileError, UnreadableWaveform
        When the file cannot be read or is not of that format.
    """
    suffix = check_suffix(path)
    check_plain(path)
    if suffix == ".wav":
        return WavReader.open(path, [channel.volts_per_unit for channel in channels])
    module, name = OTHERS[suffix]
    reader: SampleReader = getattr(import_module(module, __package__), f"{name}Reader").open(path, channels, rate_hz)
    return reader
