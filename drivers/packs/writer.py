"""Plans into a pack: what occurs more than once, a row's change or a curve, stands in it once."""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from chainsim import Device
from planner import FramePlan, Plan

from ..channels import channels_of
from ..errors import WaveformError
from ..files.whole import atomic_file, naming
from ..waveform.frame_entry import frame_entry
from ..waveform.timeline import stretches
from .courses import CurveShelf, PackCourse, RowPart
from .layout import (
    ANY,
    ENTRY,
    FRAME_HEAD,
    MOST_BYTES,
    NO_PATTERN,
    PART,
    WAY_HEAD,
    Header,
    packed_about,
)

__all__ = ["PackWriter", "PackedEntry", "write_pack"]

MOVING, PHASES = 1, 2
# What a way says for each row, and what the places of frames say.
IN_WAYS = ("start_s", "settled_s", "end_s", "moving", "omega", "target", "wish", "tones", "phase")
LEFT_OUT = "The steps of the converter are not in the pack: a controller rounds to its own."
DEFAULTS: Mapping[str, Any] = {"cells": "", "text": "", "outcome": "ok", "page": 0, "span": [0, 0]}


@dataclass(frozen=True)
class PackedEntry:
    """What was put into a pack.

    Attributes
    ----------
    frames : that show something.
    peak_volts : largest of any channel.
    left_out : one sentence on what is not in it, empty where all is.
    """

    frames: int
    samples: int
    peak_volts: float
    left_out: str = ""


class PackWriter:
    """Takes sessions for one device, and writes them all.

    Attributes
    ----------
    entries : how many were taken.
    pieces : of curves that were fitted.

    Raises
    ------
    WaveformError
        When the device is coupled in two dimensions: the events of a pack set links along rows only.
    """

    def __init__(self, device: Device) -> None:
        if device.grid:
            raise WaveformError(f"{device.name}: a pack sets links along rows only, not downwards; write a .wav")
        self._device = device
        self._body = bytearray()
        self._kept: dict[bytes, int] = {}
        self._shelf = CurveShelf(device, self._keep)
        self._entries: dict[bytes, tuple[int, ...]] = {}

    @property
    def entries(self) -> int:
        """How many were taken."""
        return len(self._entries)

    @property
    def pieces(self) -> int:
        """Of curves, each counted once."""
        return self._shelf.pieces

    def add(
        self, plan: Plan, name: str, *, spoken: str = "", code_point: int = 0,
        progress: Callable[[float], None] | None = None,
    ) -> PackedEntry:  # fmt: skip
        """Take a plan under a name; its frames are drawn once.

        Parameters
        ----------
        spoken : what a screen reader says for it.
        code_point : of its character; 0 for none.
        progress : called with the seconds taken so far.

        Raises
        ------
        WaveformError
            When the name is taken or too long, or the plan contradicts itself or the device.
        LimitError
            When more is wanted than the amplifier can give.
        """
        title = name.encode("utf-8", "surrogateescape")
        if title in self._entries:
            raise WaveformError(f"{name}: there are two of this name; give each its own")
        course, frames, abouts = PackCourse(self._shelf), bytearray(), list[dict[str, Any]]()
        headings, samples, pattern = list[dict[str, Any]](), 0, bytes([ANY]) * (self._device.rows * self._device.cols)
        for placed in stretches(self._device, plan.frames):
            frame, length = placed.plan, placed.stop - placed.first
            entry = self._entry(frame, len(abouts))
            ways = self._ways(entry, course.parts(placed))
            if entry is not None:
                if not abouts:
                    pattern = _percent(entry["wish"])
                place = {"frame": len(abouts), "page": entry["page"], "start_s": frame.start_s}
                headings += ({"level": one.level, "text": one.text} | place for one in _headings(frame))
                abouts.append({key: value for key, value in entry.items() if _tells(key, value)})
            settled = NO_PATTERN if entry is None else self._settled(frame, placed.first, length)
            frames += FRAME_HEAD.pack(settled, length) + b"".join(at.to_bytes(4, "little") for at in ways)
            samples += length
            if progress is not None:
                progress(frame.end_s)
        about = packed_about({"encoding": dict(plan.encoding), "frames": abouts, "headings": headings})
        count = len(frames) // (FRAME_HEAD.size + 4 * self._device.rows)
        self._enter(title, spoken.encode("utf-8", "replace"), code_point, (bytes(frames), count), pattern, about)
        steps = LEFT_OUT if self._device.amplifier.volt_step else ""
        return PackedEntry(len(abouts), samples, course.peak_volts, steps)

    def write(self, file: BinaryIO, path: Path) -> None:
        """Write all that was taken to an open and empty file.

        Raises
        ------
        WaveformError
            When there is nothing in it, or it becomes too large.
        OSError
            When the disk refuses.
        """
        if not self._entries:
            raise WaveformError(f"{path}: nothing can be put into the pack")
        device, channels = self._device, channels_of(self._device)
        per_row = len(channels) // device.rows
        rows = [[channel.index for channel in channels if channel.row == row] for row in range(device.rows)]
        places_at = self._keep(np.array(rows, "<u2").tobytes())
        about = packed_about({"device": device.as_dict()})
        about_at = self._keep(about)
        table = b"".join(ENTRY.pack(*self._entries[name]) for name in sorted(self._entries))
        entries_at = Header.size + len(self._body)
        self._body += table
        length = Header.size + len(self._body)
        assert per_row * device.rows == len(channels)
        if length > MOST_BYTES:
            raise WaveformError(f"{path}: {length} bytes, a pack has at most {MOST_BYTES}; make several")
        header = Header(
            device.rows, device.cols, len(channels), device.amplifier.rate_hz, device.amplifier.volts,
            device.coupling.lam.max, len(self._entries), entries_at, places_at, about_at, len(about), length,
            zlib.crc32(self._body),
        )  # fmt: skip
        file.write(header.packed())
        file.write(self._body)

    def _keep(self, blob: bytes) -> int:
        """Where the bytes stand in the file."""
        if blob not in self._kept:
            self._kept[blob] = Header.size + len(self._body)
            self._body += blob
        return self._kept[blob]

    def _entry(self, frame: FramePlan, number: int) -> dict[str, Any] | None:
        return None if frame.frame is None else frame_entry(self._device, frame, number)

    def _settled(self, frame: FramePlan, first: int, length: int) -> int:
        return min(length, math.ceil(frame.settled_s * self._device.amplifier.rate_hz - 1e-6) - first)

    def _ways(self, entry: dict[str, Any] | None, parts: list[list[RowPart]]) -> list[int]:
        return [self._keep(self._way(entry, row, of_row)) for row, of_row in enumerate(parts)]

    def _way(self, entry: dict[str, Any] | None, row: int, parts: list[RowPart]) -> bytes:
        nothing = [0.0] * self._device.cols
        about = entry or {"moving": {row: False}, "omega": {row: 0.0}, "target": {row: nothing}, "wish": {row: nothing}}
        tones, phase = about["tones"][row] if "tones" in about else [], about.get("phase")
        levels = [about["target"][row], _numbers(about["wish"][row]), *([_numbers(phase[row])] if phase else [])]
        flags = (MOVING if about["moving"][row] else 0) | (PHASES if phase else 0)
        head = WAY_HEAD.pack(flags, len(tones), len(parts), about["omega"][row])
        numbers = np.array(levels, "<f4").tobytes() + np.array(tones, "<f8").tobytes()
        return head + numbers + b"".join(PART.pack(*part) for part in parts)

    def _enter(
        self, name: bytes, spoken: bytes, code_point: int, frames: tuple[bytes, int], pattern: bytes, about: bytes
    ) -> None:
        packed, count = frames
        fields = (
            self._keep(name + spoken), len(name), len(spoken), code_point, self._keep(packed), count,
            self._keep(pattern), self._keep(about), len(about),
        )  # fmt: skip
        try:
            ENTRY.pack(*fields)
        except struct.error:
            shown = name.decode("utf-8", "replace")[:40]
            raise WaveformError(f"{shown}: the name, the words or the pack are too long; make several packs") from None
        self._entries[name] = fields


def write_pack(plan: Plan, path: Path, *, progress: Callable[[float], None] | None = None) -> PackedEntry:
    """Write one plan as a pack, under the name of the file without its ending.

    Raises
    ------
    WaveformError, LimitError, FileError
        As `PackWriter.add`, and when the file system refuses; nothing is written then.
    """
    writer = PackWriter(plan.device)
    with atomic_file(path) as file:
        entry = writer.add(plan, path.stem, progress=progress)
        with naming(path):
            writer.write(file, path)
    return entry


def _headings(frame: FramePlan) -> Any:
    return () if frame.frame is None else frame.frame.headings


def _tells(key: str, value: Any) -> bool:
    """Whether a key of a frame's entry has to be written beside its ways."""
    return key not in IN_WAYS and not (key in DEFAULTS and value == DEFAULTS[key])


def _numbers(row: list[float | None]) -> list[float]:
    return [math.nan if value is None else value for value in row]


def _percent(wish: list[list[float | None]]) -> bytes:
    return bytes(ANY if value is None else min(100, round(100 * value)) for row in wish for value in row)
