"""Reading WAV strictly: every byte is accounted for, or the file is refused with one line."""

from __future__ import annotations

import os
import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..channels import Channel
from ..errors import UnreadableWaveform
from ..files.whole import naming
from .wav import EXTENSIBLE, FLOAT, PCM, SUBFORMAT_TAIL

__all__ = ["WavReader", "open_reader"]

Floats = NDArray[np.float64]

ENCODINGS = {
    (PCM, 16): "pcm16",
    (PCM, 24): "pcm24",
    (PCM, 32): "pcm32",
    (FLOAT, 32): "float32",
    (FLOAT, 64): "float64",
}
MAX_CHUNKS = 1000
UNKNOWN_SIZE = 0xFFFFFFFF


@dataclass(frozen=True)
class WavReader:
    """The samples of a WAV or RF64 file (16, 24, 32-bit PCM; 32, 64-bit float), read a block at a time.

    Make one with `WavReader.open`, which reads the header only.

    Attributes
    ----------
    path : the file.
    rate_hz : samples per second.
    channels : how many.
    samples : per channel.
    encoding : pcm16, pcm24, pcm32, float32 or float64.
    volts_per_unit : float64, shape (channels,), read-only, volts for a stored full scale of 1.
    """

    path: Path
    rate_hz: int
    channels: int
    samples: int
    encoding: str
    volts_per_unit: Floats
    _data_at: int = field(repr=False)

    @classmethod
    def open(cls, path: Path, volts_per_unit: ArrayLike = 1.0) -> WavReader:
        """Read and check the header of `path`.

        `volts_per_unit` is a number or one number per channel.

        Raises
        ------
        FileError
            When the file cannot be read.
        UnreadableWaveform
            When it is not a whole WAV of a known encoding, or has another number of channels.
        """
        with naming(path), path.open("rb") as file:
            chunks = _read_chunks(path, file)
            form = _read_format(path, file, chunks)
        if chunks.data_bytes % form.align:
            raise _bad(path, f"{chunks.data_bytes} bytes of samples are no whole number of {form.align}-byte frames")
        unit = np.asarray(volts_per_unit, dtype=np.float64)
        if unit.ndim and unit.shape != (form.channels,):
            raise _bad(path, f"it has {form.channels} channels where {unit.size} are wanted")
        unit = np.array(np.broadcast_to(unit, (form.channels,)))
        unit.flags.writeable = False
        samples = chunks.data_bytes // form.align
        return cls(path, form.rate_hz, form.channels, samples, form.encoding, unit, chunks.data_at)

    def blocks(self, block: int) -> Iterator[Floats]:
        """The samples from the start, `block` at a time; the last block may be shorter.

        Yields
        ------
        float64, shape (S, channels), volts.

        Raises
        ------
        ValueError
            When block < 1.
        FileError, UnreadableWaveform
            When the file cannot be read, has become shorter, or holds a value that is not finite.
        """
        if block < 1:
            raise ValueError(f"block: expected a whole number >= 1, got {block}")
        return self._blocks(block)

    def _blocks(self, block: int) -> Iterator[Floats]:
        align = self.channels * int(self.encoding[-2:]) // 8
        with naming(self.path):
            file = self.path.open("rb")
        with file:
            file.seek(self._data_at)
            for first in range(0, self.samples, block):
                wanted = min(block, self.samples - first) * align
                with naming(self.path):
                    raw = file.read(wanted)
                if len(raw) < wanted:
                    raise _bad(self.path, f"it ends early, at sample {first + len(raw) // align} of {self.samples}")
                with np.errstate(over="ignore"):
                    values = _decode(raw, self.encoding).reshape(-1, self.channels) * self.volts_per_unit
                self._check_finite(values, first)
                yield values

    def _check_finite(self, values: Floats, first: int) -> None:
        if not np.isfinite(values).all():
            sample, channel = np.argwhere(~np.isfinite(values))[0]
            time_s = (first + int(sample)) / self.rate_hz
            raise _bad(self.path, f"channel {channel} at {time_s:.6g} s is {values[sample, channel]}, not a number")


def _decode(raw: bytes, encoding: str) -> Floats:
    """Stored samples as float64 with full scale 1."""
    if encoding == "pcm24":
        wide = np.zeros((len(raw) // 3, 4), dtype=np.uint8)
        wide[:, 1:] = np.frombuffer(raw, dtype=np.uint8).reshape(-1, 3)
        return wide.view("<i4").ravel() / 2.0**31
    if encoding == "pcm16":
        return np.frombuffer(raw, dtype="<i2") / 2.0**15
    if encoding == "pcm32":
        return np.frombuffer(raw, dtype="<i4") / 2.0**31
    with np.errstate(invalid="ignore"):  # a signalling NaN is reported by the caller
        return np.frombuffer(raw, dtype="<f4" if encoding == "float32" else "<f8").astype(np.float64)


@dataclass(frozen=True)
class _Chunks:
    """Where things stand in the file, in bytes."""

    format_at: int
    format_bytes: int
    data_at: int
    data_bytes: int


@dataclass(frozen=True)
class _Form:
    """What the fmt chunk says."""

    encoding: str
    channels: int
    rate_hz: int
    align: int


def _read_chunks(path: Path, file: BinaryIO) -> _Chunks:
    total = os.fstat(file.fileno()).st_size
    head = file.read(12)
    if len(head) < 12 or head[:4] not in (b"RIFF", b"RF64") or head[8:] != b"WAVE":
        raise _bad(path, "it does not begin with RIFF or RF64 and WAVE")
    end, data_size = 8 + _u32(head[4:8]), UNKNOWN_SIZE
    found: dict[bytes, tuple[int, int]] = {}
    at = 12
    if head[:4] == b"RF64":
        ds64 = file.read(8 + 28)
        if len(ds64) < 36 or ds64[:4] != b"ds64" or _u32(ds64[4:8]) < 28:
            raise _bad(path, "an RF64 must go on with a ds64 chunk of 28 bytes")
        riff_size, data_size = struct.unpack("<QQ", ds64[8:24])
        end, at = 8 + riff_size, 20 + _padded(_u32(ds64[4:8]))
    if end != total:
        raise _bad(path, f"its header says {end} bytes and it has {total}; it was cut short or added to")
    while at + 8 <= end and len(found) < MAX_CHUNKS:
        file.seek(at)
        name, size = struct.unpack("<4sI", file.read(8))
        if name == b"data" and size == UNKNOWN_SIZE and head[:4] == b"RF64":
            size = data_size
        if at + 8 + size > end:
            raise _bad(path, f"its {name.decode('latin-1')!r} chunk of {size} bytes goes past the end of the file")
        if name in found:
            raise _bad(path, f"it has two {name.decode('latin-1')!r} chunks")
        found[name if name in (b"fmt ", b"data") else struct.pack("<Q", at)] = (at + 8, size)
        at += 8 + _padded(size)
    # Some writers leave out the pad byte after the last chunk.
    if at not in (end, end + 1):
        raise _bad(path, f"it does not end with a whole chunk, or has more than {MAX_CHUNKS}")
    if b"fmt " not in found or b"data" not in found:
        raise _bad(path, "it lacks a 'fmt ' or a 'data' chunk")
    return _Chunks(*found[b"fmt "], *found[b"data"])


def _read_format(path: Path, file: BinaryIO, chunks: _Chunks) -> _Form:
    file.seek(chunks.format_at)
    raw = file.read(min(chunks.format_bytes, 40))
    if len(raw) < 16:
        raise _bad(path, f"its 'fmt ' chunk has {len(raw)} bytes where 16 are the least")
    tag, channels, rate_hz, _, align, bits = struct.unpack("<HHIIHH", raw[:16])
    if tag == EXTENSIBLE:
        if len(raw) < 40 or raw[26:] != SUBFORMAT_TAIL:
            raise _bad(path, "its extensible format names no known sample encoding")
        tag = int.from_bytes(raw[24:26], "little")
    if (tag, bits) not in ENCODINGS:
        raise _bad(path, f"format {tag} with {bits} bits is not PCM of 16, 24, 32 or float of 32, 64 bits; convert it")
    if channels < 1 or rate_hz < 1 or align != channels * bits // 8:
        raise _bad(path, f"its format contradicts itself: {channels} channels, {rate_hz} Hz, {align} bytes a frame")
    return _Form(ENCODINGS[tag, bits], channels, rate_hz, align)


def _padded(size: int) -> int:
    return size + size % 2


def _u32(raw: bytes) -> int:
    return int.from_bytes(raw, "little")


def _bad(path: Path, why: str) -> UnreadableWaveform:
    return UnreadableWaveform(f"{path}: not a readable WAV: {why}")


def open_reader(path: Path, channels: Sequence[Channel], _rate_hz: int) -> WavReader:
    """A reader that gives volts; raises as `WavReader.open` does."""
    return WavReader.open(path, [channel.volts_per_unit for channel in channels])
