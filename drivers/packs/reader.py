"""A pack where it lies: opened by its first bytes, an entry found by its name, the rest read as it is asked for."""

from __future__ import annotations

import mmap
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from difflib import get_close_matches
from functools import cached_property, lru_cache
from pathlib import Path, PurePosixPath
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from encoders import TargetPattern

from ..errors import DriverError, UnreadableWaveform
from ..files.whole import check_plain, naming
from .curves import Curve, LinkCurve
from .layout import ANY, ENTRY, LINKS, PART, WAY_HEAD, Header, PackView, about_of, frame_type
from .writer import MOVING, PHASES

__all__ = ["NotInPack", "Pack", "PackEntry", "RowWay"]

Floats = NDArray[np.float64]

ALIKE = 3  # names that are offered in place of one that is not there


class NotInPack(DriverError, LookupError):
    """A pack has no entry of this name, or several and none was named.

    Examples: ``--icon hart`` where there is a ``heart``; a pack of icons verified without ``--icon``.
    """


@dataclass(frozen=True)
class RowWay:
    """What a row does in a frame, and what it is to be felt as.

    Attributes
    ----------
    omega, moving, target, wish, phase, tones : as in a manifest, of this row; phases None where none matters.
    channels : (place in the row, where its curve stands).
    links : where the curve of the links stands, None where they stay.
    """

    omega: float
    moving: bool
    target: tuple[float, ...]
    wish: tuple[float | None, ...]
    phase: tuple[float | None, ...] | None
    tones: tuple[float, ...]
    channels: tuple[tuple[int, int], ...]
    links: int | None


@dataclass(frozen=True)
class PackEntry:
    """One session of a pack.

    Attributes
    ----------
    name : by which it is found.
    spoken : what a screen reader says for it.
    code_point : of its character, such as 0xf417; 0 for none.
    """

    name: str
    spoken: str
    code_point: int
    frames_at: int
    frames: int
    pattern_at: int
    about_at: int
    about_length: int


class Pack:
    """A pack that is mapped into memory.

    Parameters
    ----------
    path : of the file.

    Raises
    ------
    FileError, UnreadableWaveform
        When it cannot be read, or is no whole pack.
    """

    _record: ClassVar = struct.Struct("<IHH")

    def __init__(self, path: Path | str) -> None:
        self.path = Path(path)
        check_plain(self.path)
        with naming(self.path), self.path.open("rb") as file:
            if not file.read(1):
                raise UnreadableWaveform(f"{path}: this is no pack of dotwave")
            self._view = PackView(self.path, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ))
        self.header = Header.of(self._view)
        if self.header.entries_at + ENTRY.size * self.header.entries > self.header.length:
            self._view.damaged(self.header.entries_at)
        self.way = lru_cache(4096)(self._way)
        self.curve = lru_cache(1024)(self._curve)
        self.link_curve = lru_cache(1024)(self._link_curve)

    def __len__(self) -> int:
        return self.header.entries

    def check_whole(self) -> None:
        """Hold every byte against the CRC-32.

        Raises
        ------
        UnreadableWaveform
            When one is not as it was written.
        """
        if zlib.crc32(memoryview(self._view.data)[Header.size :]) != self.header.rest_crc:
            raise UnreadableWaveform(f"{self.path}: the pack is damaged; copy or write it again")

    @cached_property
    def device(self) -> dict[str, Any]:
        """The whole device profile, as in a manifest."""
        device = about_of(self._view, self.header.about_at, self.header.about_length).get("device")
        if not isinstance(device, dict):
            self._view.damaged(self.header.about_at)
            raise AssertionError
        return device

    @cached_property
    def places(self) -> NDArray[np.uint16]:
        """The channels of every row, by place; uint16, shape (rows, places)."""
        channels = self._view.array("<u2", self.header.channels, self.header.places_at)
        if sorted(channels.tolist()) != list(range(self.header.channels)):
            self._view.damaged(self.header.places_at)
        return channels.reshape(self.header.rows, -1)

    def names(self) -> Iterator[str]:
        """All of them, in the order of their bytes."""
        return (self._name(index).decode("utf-8", "surrogateescape") for index in range(len(self)))

    def find(self, name: str) -> PackEntry:
        """The entry of a name; of some forty bytes for each doubling of the pack nothing else is read.

        Raises
        ------
        NotInPack
            When there is none; the message offers names that are like it.
        """
        wanted = name.encode("utf-8", "surrogateescape")
        low, high = 0, len(self)
        while low < high:
            middle = (low + high) // 2
            if self._name(middle) < wanted:
                low = middle + 1
            else:
                high = middle
        if low == len(self) or self._name(low) != wanted:
            raise NotInPack(f"{self.path}: it has no {name!r}{self._offered(name)}")
        return self.entry(low)

    def only(self) -> PackEntry:
        """The one entry there is; raises NotInPack when there are several."""
        if len(self) != 1:
            first = "; ".join(name for name, _ in zip(self.names(), range(ALIKE), strict=False))
            raise NotInPack(f"{self.path}: it has {len(self)} icons; name one with --icon, such as {first}")
        return self.entry(0)

    def entry(self, index: int) -> PackEntry:
        """Entry number `index`, from 0."""
        name_at, name, spoken, *rest = self._view.unpack(ENTRY, self.header.entries_at + ENTRY.size * index)
        words = self._view.bytes(name_at, name + spoken)
        code_point, frames_at, frames, pattern_at, about_at, about_length = rest
        return PackEntry(
            words[:name].decode("utf-8", "surrogateescape"), words[name:].decode("utf-8", "replace"), code_point,
            frames_at, frames, pattern_at, about_at, about_length,
        )  # fmt: skip

    def pattern(self, entry: PackEntry) -> Floats:
        """What is to be felt of its first frame; float64, shape (rows, cols), of full scale, NaN where any will do."""
        shape = self.header.rows, self.header.cols
        percent = self._view.array("u1", shape[0] * shape[1], entry.pattern_at).reshape(shape)
        return np.where(percent == ANY, np.nan, percent / 100)

    def target(self, name: str) -> TargetPattern:
        """The pattern of an entry as what a scene, or `dotwave.Live`, shows; raises as `find`."""
        level = self.pattern(self.find(name))
        known = ~np.isnan(level)
        weight = None if known.all() else known.astype(np.float64)
        return TargetPattern(np.nan_to_num(level).astype(np.complex128), weight=weight)

    def frames(self, entry: PackEntry) -> NDArray[Any]:
        """Its frames: a record each of settled, samples and ways."""
        return self._view.array(frame_type(self.header.rows), entry.frames, entry.frames_at)

    def about(self, entry: PackEntry) -> dict[str, Any]:
        """What stands beside the frames: the scene's encoding, and what else is known of each."""
        return about_of(self._view, entry.about_at, entry.about_length)

    def _name(self, index: int) -> bytes:
        at, length, _ = self._record.unpack_from(self._view.data, self.header.entries_at + ENTRY.size * index)
        return self._view.bytes(at, length)

    def _offered(self, name: str) -> str:
        names = list(self.names())
        leaf = PurePosixPath(name).stem
        like = [one for one in names if PurePosixPath(one).stem == leaf] or get_close_matches(name, names, ALIKE)
        return f"; like it: {', '.join(like[:ALIKE])}" if like else "; `dotwave verify PACK` says what it has"

    def _way(self, at: int) -> RowWay:
        flags, tones, parts, omega = self._view.unpack(WAY_HEAD, at)
        cols, phases = self.header.cols, bool(flags & PHASES)
        at += WAY_HEAD.size
        levels = self._view.array("<f4", cols * (2 + phases), at).reshape(-1, cols)
        numbers = [tuple(map(_number, row)) for row in levels]
        at += levels.nbytes
        more = tuple(self._view.array("<f8", tones, at).tolist())
        at += 8 * tones
        told = [self._view.unpack(PART, at + PART.size * k) for k in range(parts)]
        links = [curve for place, curve in told if place == LINKS]
        channels = tuple((place, curve) for place, curve in told if place != LINKS)
        if len(links) > 1 or any(place >= self.places.shape[1] for place, _ in channels):
            self._view.damaged(at)
        target = tuple(0.0 if one is None else one for one in numbers[0])
        return RowWay(
            omega, bool(flags & MOVING), target, numbers[1], numbers[2] if phases else None, more, channels,
            links[0] if links else None,
        )  # fmt: skip

    def _curve(self, at: int) -> Curve:
        return Curve.read(self._view, at, self.header.full_volts)

    def _link_curve(self, at: int) -> LinkCurve:
        return LinkCurve.read(self._view, at, self.header.cols - 1, self.header.lam_max)


def _number(value: np.float32) -> float | None:
    """The shortest decimal that is this number in 32 bits; None for NaN."""
    return None if np.isnan(value) else float(str(value))
