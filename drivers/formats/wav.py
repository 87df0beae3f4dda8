"""Writing WAV: fixed bytes (no timestamp), any number of channels, any length, a block at a time."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from typing import BinaryIO, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from ..channels import Channel
from ..errors import LimitError, WaveformError

__all__ = ["EXTENSIBLE", "FLOAT", "PCM", "RIFF_LIMIT", "SUBFORMAT_TAIL", "Encoding", "WavWriter", "open_writer"]

Floats = NDArray[np.float64]
Encoding = Literal["float32", "pcm24"]

PCM, FLOAT, EXTENSIBLE = 1, 3, 0xFFFE
# KSDATAFORMAT_SUBTYPE_PCM and _IEEE_FLOAT are the format tag followed by these bytes (mmreg.h).
SUBFORMAT_TAIL = bytes.fromhex("000000001000800000aa00389b71")
RIFF_LIMIT = 0xFFFFFFFF  # largest size a RIFF header can say; beyond it RF64 (EBU Tech 3306)
FULL_SCALE_24 = 1 << 23


@dataclass(frozen=True)
class _Format:
    tag: int
    sample_bytes: int


NUMBERS = {"float32": _Format(FLOAT, 4), "pcm24": _Format(PCM, 3)}


class WavWriter:
    """Writes blocks of volts to an open binary file as WAVE_FORMAT_EXTENSIBLE with channel mask 0.

    A stored sample is volts / volts_per_unit of its channel: float32 (rounded to 24 significant bits), or
    PCM24 (rounded to the nearest step of volts_per_unit / 2^23, so off by half a step at most). The header
    reserves room (JUNK) to become RF64 when the file outgrows RIFF. Memory is that of one block.

    Parameters
    ----------
    file : seekable, at its start.
    channels : what each column is.
    rate_hz : samples per second.
    riff_limit : bytes above which the header is RF64.

    Raises
    ------
    WaveformError
        When the encoding is unknown, or a WAV header cannot say so many channels at that rate.
    """

    def __init__(
        self,
        file: BinaryIO,
        channels: Sequence[Channel],
        rate_hz: int,
        encoding: Encoding,
        *,
        riff_limit: int = RIFF_LIMIT,
    ) -> None:
        if encoding not in NUMBERS:
            raise WaveformError(f"encoding: expected {' or '.join(get_args(Encoding))}, got {encoding!r}")
        self._format = NUMBERS[encoding]
        align = len(channels) * self._format.sample_bytes
        if align > 0xFFFF or align * rate_hz > 0xFFFFFFFF:
            raise WaveformError(
                f"{len(channels)} channels at {rate_hz} Hz are more than a WAV header can say; split the grid by rows"
            )
        self._file = file
        self._channels = channels
        self._rate_hz = rate_hz
        self._unit: Floats = np.array([channel.volts_per_unit for channel in channels])
        self._riff_limit = riff_limit
        self.samples = 0
        self._data_at = file.write(self._header())

    def write(self, block: Floats) -> None:
        """Append samples; float64, shape (S, channels), volts.

        Raises
        ------
        LimitError
            When a value is beyond what the encoding can hold; nothing is clipped.
        """
        units = block / self._unit
        stored = self._pcm24(units) if self._format.tag == PCM else units.astype("<f4", order="C")
        self._file.write(stored.data)
        self.samples += len(block)

    def finish(self) -> None:
        """Pad the data and write the sizes into the header. The file stays open."""
        # A write that was interrupted may have left a part of its block.
        self._file.seek(self._data_at + self._data_bytes)
        self._file.truncate()
        if self._data_bytes % 2:
            self._file.write(b"\0")
        self._file.seek(0)
        self._file.write(self._header())
        self._file.flush()

    def _pcm24(self, units: Floats) -> NDArray[np.uint8]:
        steps = np.rint(units * FULL_SCALE_24)
        held = (steps >= -FULL_SCALE_24) & (steps < FULL_SCALE_24)
        if not held.all():
            self._refuse(units, held)
        bytes_ = steps.astype("<i4", order="C").view(np.uint8).reshape(*steps.shape, 4)
        return np.ascontiguousarray(bytes_[:, :, :3])

    def _refuse(self, units: Floats, held: NDArray[np.bool_]) -> None:
        sample, index = np.argwhere(~held)[0]
        channel = self._channels[index]
        time_s = (self.samples + int(sample)) / self._rate_hz
        value = float(units[sample, index] * channel.volts_per_unit)
        limit = channel.volts_per_unit * (1 - 1 / FULL_SCALE_24)
        raise LimitError(
            f"{channel}: {value:.9g} V at {time_s:.6g} s is beyond the {limit:.9g} V that PCM24 can hold; "
            "write float32 or lower full_scale",
            channel=channel, time_s=time_s, value=value, limit=limit,
        )  # fmt: skip

    @property
    def _data_bytes(self) -> int:
        return self.samples * len(self._channels) * self._format.sample_bytes

    def _header(self) -> bytes:
        count, size = len(self._channels), self._format.sample_bytes
        align, bits = count * size, 8 * size
        fmt = struct.pack(
            "<HHIIHHHHIH", EXTENSIBLE, count, self._rate_hz, self._rate_hz * align, align, bits, 22, bits, 0,
            self._format.tag,
        )  # fmt: skip
        data = self._data_bytes
        body = 4 + (8 + 28) + (8 + 40) + (8 + 4) + 8 + data + data % 2
        large = body > self._riff_limit
        # In an RF64 the 32-bit sizes are all ones and the true ones stand in ds64.
        small = [0xFFFFFFFF if large else value for value in (body, self.samples, data)]
        sizes = struct.pack("<QQQI", body, data, self.samples, 0) if large else bytes(28)
        return b"".join([
            b"RF64" if large else b"RIFF", struct.pack("<I", small[0]), b"WAVE",
            b"ds64" if large else b"JUNK", struct.pack("<I", 28), sizes,
            b"fmt ", struct.pack("<I", 40), fmt, SUBFORMAT_TAIL,
            b"fact", struct.pack("<II", 4, small[1]),
            b"data", struct.pack("<I", small[2]),
        ])  # fmt: skip


open_writer = WavWriter
