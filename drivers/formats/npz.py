"""Samples for numpy: exact float64 volts and the rate, in an uncompressed NPZ."""

from __future__ import annotations

import shutil
import tempfile
import zipfile
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO, BinaryIO

import numpy as np
from numpy.typing import NDArray

from chainsim import NpyHeader, opened_npz, read_npy_header

from ..channels import Channel
from ..errors import UnreadableWaveform
from ..files.whole import naming
from .raw import check_finite

__all__ = ["NpzReader", "NpzWriter", "open_reader", "open_writer"]

Floats = NDArray[np.float64]

VOLTS, RATE = "volts.npy", "rate_hz.npy"
LONGEST_RATE = 16
# What zipfile raises on what is not a ZIP, or not a whole one.
DAMAGED = (
    zipfile.BadZipFile, zlib.error, EOFError, ValueError, LookupError, OverflowError, NotImplementedError, RuntimeError,
)  # fmt: skip


class NpzWriter:
    """Writes `volts`, float64, shape (samples, channels), and `rate_hz`.

    The length stands before the data in an NPZ, so the samples wait in a temporary file until it is known.
    """

    def __init__(self, file: BinaryIO, channels: Sequence[Channel], rate_hz: int) -> None:
        self._file = file
        self._count = len(channels)
        self._rate_hz = rate_hz
        self._waiting = tempfile.TemporaryFile()  # noqa: SIM115 - closed by finish, or with the writer
        self.samples = 0

    def __del__(self) -> None:
        # A writer that was given up has not finished.
        self._waiting.close()

    def write(self, block: Floats) -> None:
        """Append samples; float64, shape (S, channels), volts."""
        self._waiting.write(block.astype("<f8", order="C").data)
        self.samples += len(block)

    def finish(self) -> None:
        """Assemble the file; it stays open."""
        with zipfile.ZipFile(self._file, "w", zipfile.ZIP_STORED) as archive:
            with self._member(archive, VOLTS) as member:
                shape = {"descr": "<f8", "fortran_order": False, "shape": (self.samples, self._count)}
                np.lib.format.write_array_header_2_0(member, shape)
                self._waiting.seek(0)
                shutil.copyfileobj(self._waiting, member, 1 << 20)
            with self._member(archive, RATE) as member:
                np.lib.format.write_array(member, np.array(self._rate_hz))
        self._waiting.close()
        self._file.flush()

    @staticmethod
    def _member(archive: zipfile.ZipFile, name: str) -> IO[bytes]:
        # A fixed date: the same input gives the same bytes.
        return archive.open(zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0)), "w", force_zip64=True)


@dataclass(frozen=True)
class NpzReader:
    """The samples of an NPZ file as `NpzWriter` or ``numpy.savez(path, volts=..., rate_hz=...)`` writes it."""

    path: Path
    rate_hz: int
    samples: int
    channels: int

    @classmethod
    def open(cls, path: Path, channels: Sequence[Channel], _rate_hz: int) -> NpzReader:
        """Read the headers of `path`; the rate stands in the file.

        Raises
        ------
        FileError, UnreadableWaveform
            When it cannot be read, or does not hold float64 volts of so many channels and a rate.
        """
        try:
            with naming(path), opened_npz(path) as archive:
                with archive.open(VOLTS) as member:
                    volts = _header(member)
                with archive.open(RATE) as member:
                    header = read_npy_header(member)
                    raw = member.read(LONGEST_RATE)
        except DAMAGED as error:
            raise UnreadableWaveform(f"{path}: not an NPZ with volts and rate_hz: {error}") from None
        whole = header.shape == () and header.dtype.kind in "iu" and len(raw) == header.dtype.itemsize
        rate = int(np.frombuffer(raw, header.dtype)[0]) if whole else 0
        if len(volts.shape) != 2 or volts.shape[1] != len(channels) or rate < 1:
            raise UnreadableWaveform(f"{path}: expected volts of {len(channels)} channels and a whole rate_hz >= 1")
        return cls(path, rate, volts.shape[0], len(channels))

    def blocks(self, block: int) -> Iterator[Floats]:
        """The samples from the start, float64, shape (S, channels), volts.

        Raises
        ------
        FileError, UnreadableWaveform
            When the file cannot be read, is damaged, or holds a value that is not finite.
        """
        try:
            with naming(self.path), opened_npz(self.path) as archive, archive.open(VOLTS) as member:
                _header(member)
                for first in range(0, self.samples, block):
                    yield self._block(member, first, min(block, self.samples - first))
        except UnreadableWaveform:
            raise
        except DAMAGED as error:
            raise UnreadableWaveform(f"{self.path}: damaged: {error}") from None

    def _block(self, member: IO[bytes], first: int, samples: int) -> Floats:
        raw = member.read(8 * self.channels * samples)
        if len(raw) < 8 * self.channels * samples:
            raise UnreadableWaveform(f"{self.path}: it ends early")
        values = np.frombuffer(raw, dtype="<f8").astype(np.float64).reshape(-1, self.channels)
        check_finite(self.path, values, first, self.rate_hz)
        return values


def _header(member: IO[bytes]) -> NpyHeader:
    header = read_npy_header(member)
    if header.fortran or header.dtype != np.dtype("<f8"):
        raise ValueError(f"volts are {header.dtype}, expected little-endian float64 in C order")
    return header


def open_writer(file: BinaryIO, channels: Sequence[Channel], rate_hz: int, _encoding: str) -> NpzWriter:
    """A writer on an open and empty file."""
    return NpzWriter(file, channels, rate_hz)


open_reader = NpzReader.open
