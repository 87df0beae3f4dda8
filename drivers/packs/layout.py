"""A pack byte by byte: what stands where, and a look at it that stays within the file (docs/pack.md)."""

from __future__ import annotations

import json
import struct
import zlib
from collections.abc import Mapping
from dataclasses import astuple, dataclass
from mmap import mmap
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from ..errors import UnreadableWaveform

__all__ = [
    "ANY", "ENTRY", "FRAME_HEAD", "LINKS", "MAGIC", "MOST_BYTES", "NO_PATTERN", "PART", "SUFFIX", "VERSION", "WAY_HEAD",
    "Header", "PackView", "about_of", "curve_type", "frame_type", "links_type", "packed_about",
]  # fmt: skip

MAGIC = b"dwpack\r\n"
VERSION = 1
SUFFIX = ".dwp"
MOST_BYTES = (1 << 32) - 1
MOST_ABOUT = 1 << 28  # bytes, unpacked

NO_PATTERN = 0xFFFFFFFF  # settled: nothing is to be felt
ANY = 255  # percent: any level will do
LINKS = 0xFFFF  # place of a part: the links of the row

ENTRY = struct.Struct("<IHHIIIIII")
FRAME_HEAD = struct.Struct("<II")
WAY_HEAD = struct.Struct("<BBHd")
PART = struct.Struct("<HI")


@dataclass(frozen=True)
class Header:
    """What stands first.

    Attributes
    ----------
    rows, cols, channels, rate_hz, full_volts, lam_max : of the device.
    entries, entries_at : how many, and where their table begins.
    places_at : where the channels of every row begin.
    about_at, about_length : the device as zlib-compressed JSON.
    length : of the file, bytes.
    rest_crc : CRC-32 of all that is behind the header.
    """

    rows: int
    cols: int
    channels: int
    rate_hz: int
    full_volts: float
    lam_max: float
    entries: int
    entries_at: int
    places_at: int
    about_at: int
    about_length: int
    length: int
    rest_crc: int

    _struct: ClassVar = struct.Struct("<8sHHHHIffIIIIIII")
    _seal: ClassVar = struct.Struct("<I")
    size: ClassVar = _struct.size + _seal.size

    def packed(self) -> bytes:
        """As bytes, with a CRC-32 behind."""
        head = self._struct.pack(MAGIC, VERSION, *astuple(self))
        return head + self._seal.pack(zlib.crc32(head))

    @classmethod
    def of(cls, view: PackView) -> Self:
        """From the file.

        Raises
        ------
        UnreadableWaveform
            When this is no pack, one of another version, or a damaged one.
        """
        if len(view.data) < cls.size or view.bytes(0, len(MAGIC)) != MAGIC:
            raise UnreadableWaveform(f"{view.path}: this is no pack of dotwave")
        _, version, *rest = cls._struct.unpack_from(view.data)
        if version != VERSION:
            raise UnreadableWaveform(f"{view.path}: a pack of version {version}, this dotwave reads {VERSION}")
        header = cls(*rest)
        (seal,) = cls._seal.unpack_from(view.data, cls._struct.size)
        grid = header.rows and header.cols and header.channels and header.channels % header.rows == 0
        grid = grid and header.rate_hz and 0 < header.full_volts < np.inf
        if seal != zlib.crc32(view.bytes(0, cls._struct.size)) or header.length != len(view.data) or not grid:
            raise UnreadableWaveform(f"{view.path}: the pack is damaged or not whole; copy or write it again")
        return header


@dataclass(frozen=True)
class PackView:
    """A file in memory; what would reach beyond its end is refused."""

    path: Path
    data: mmap

    def bytes(self, at: int, length: int) -> bytes:
        """So many bytes.

        Raises
        ------
        UnreadableWaveform
            When they are not all there.
        """
        if at + length > len(self.data):
            self.damaged(at)
        return self.data[at : at + length]

    def unpack(self, form: struct.Struct, at: int) -> tuple[Any, ...]:
        """One struct; raises as `bytes`."""
        if at + form.size > len(self.data):
            self.damaged(at)
        return form.unpack_from(self.data, at)

    def array(self, kind: np.dtype[Any] | str, count: int, at: int) -> NDArray[Any]:
        """A copy of an array; raises as `bytes`."""
        kind = np.dtype(kind)
        return np.frombuffer(self.bytes(at, count * kind.itemsize), kind)

    def damaged(self, at: int) -> None:
        """Refuse what stands at byte `at`."""
        raise UnreadableWaveform(f"{self.path}: damaged near byte {at}; copy or write it again")


def frame_type(rows: int) -> np.dtype[Any]:
    """A frame: when its pattern stands and how long it is, samples; then its ways."""
    return np.dtype([("settled", "<u4"), ("samples", "<u4"), ("ways", "<u4", (rows,))])


def curve_type(turns: int) -> np.dtype[Any]:
    """A piece of a curve on a carrier; of one that stands still only real parts."""
    return np.dtype([("at", "<u4"), ("ramp", "<u4"), ("points", "<f4", (4, 2) if turns else (4, 1))])


def links_type(links: int) -> np.dtype[Any]:
    """A piece of what the links of a row do."""
    return np.dtype([("at", "<u4"), ("ramp", "<u4"), ("lam", "<f4", (links,))])


def packed_about(about: Mapping[str, Any]) -> bytes:
    """What only a host reads."""
    return zlib.compress(json.dumps(about, allow_nan=False, separators=(",", ":")).encode("ascii"), 9)


def about_of(view: PackView, at: int, length: int) -> dict[str, Any]:
    """The object that `packed_about` made; raises as `PackView.bytes`."""
    if not length:
        return {}
    unpacking = zlib.decompressobj()
    try:
        about = json.loads(unpacking.decompress(view.bytes(at, length), MOST_ABOUT))
    except (zlib.error, ValueError, RecursionError):
        about = None
    if not isinstance(about, dict) or not unpacking.eof:
        view.damaged(at)
    assert isinstance(about, dict)
    return about
