"""Samples for numpy: exact float64 volts and the rate, in an uncompressed NPZ."""

from __future__ import annotations

import io
import shutil
import tempfile
import zipfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO, BinaryIO

import numpy as np
from numpy.typing import NDArray

from .channels import Channel
from .errors import UnreadableWaveform
from .files import naming
from .raw import check_finite

__all__ = ["NpzReader", "NpzWriter"]

Floats = NDArray[np.float64]

VOLTS, RATE = "volts.npy", "rate_hz.npy"


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
        with naming(path):
            file = path.open("rb")
        try:
            with file, zipfile.ZipFile(file) as archive:
                with archive.open(VOLTS) as member:
                    shape = _header(member)
                with archive.open(RATE) as member:
                    rate = np.lib.format.read_array(io.BytesIO(member.read(4096)), allow_pickle=False)
        except (zipfile.BadZipFile, KeyError, ValueError, EOFError, NotImplementedError, RuntimeError) as error:
            raise UnreadableWaveform(f"{path}: not an NPZ with volts and rate_hz: {error}") from None
        if len(shape) != 2 or shape[1] != len(channels) or rate.shape != () or rate.dtype.kind not in "iu":
            raise UnreadableWaveform(f"{path}: expected volts of {len(channels)} channels and a whole rate_hz")
        return cls(path, int(rate), shape[0], len(channels))

    def blocks(self, block: int) -> Iterator[Floats]:
        """The samples from the start, float64, shape (S, channels), volts.

        Raises
        ------
        FileError, UnreadableWaveform
            When the file cannot be read, is damaged, or holds a value that is not finite.
        """
        with naming(self.path):
            file = self.path.open("rb")
        with file, zipfile.ZipFile(file) as archive, archive.open(VOLTS) as member:
            _header(member)
            for first in range(0, self.samples, block):
                wanted = 8 * self.channels * min(block, self.samples - first)
                try:
                    raw = member.read(wanted)
                except zipfile.BadZipFile as error:
                    raise UnreadableWaveform(f"{self.path}: damaged: {error}") from None
                if len(raw) < wanted:
                    raise UnreadableWaveform(f"{self.path}: it ends early")
                values = np.frombuffer(raw, dtype="<f8").astype(np.float64).reshape(-1, self.channels)
                check_finite(self.path, values, first, self.rate_hz)
                yield values


def _header(member: IO[bytes]) -> tuple[int, ...]:
    version = np.lib.format.read_magic(member)
    read = np.lib.format.read_array_header_2_0 if version[0] >= 2 else np.lib.format.read_array_header_1_0
    shape, fortran, dtype = read(member)
    if fortran or dtype != np.dtype("<f8"):
        raise ValueError(f"volts are {dtype}, expected little-endian float64 in C order")
    return tuple(int(length) for length in shape)
