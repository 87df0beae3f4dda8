"""What arrived at a controller, written as a waveform that `verify` reads like any other."""

from __future__ import annotations

import json
import zlib
from collections.abc import Mapping
from contextlib import ExitStack, suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chainsim import Device

from ..channels import channels_of
from ..errors import FileError
from ..files.whole import atomic_files, naming
from ..formats.wav import WavWriter
from ..waveform.manifest import SCHEMA, FrameMark, Manifest, digest_of_open
from .messages import FULL_CODE, Codes, LinkCoupling, Links, Mark, StartMessage
from .playout import ControllerSpec, Event

__all__ = ["ArrivalRecorder", "CutShort", "device_note", "frame_note", "live_note", "plan_note", "scene_note"]

MOST_NOTE_BYTES = 1 << 20
# What a manifest has of a frame, and a note has no room for.
NOT_NOTED = ("tones", "phase", "spread")


def scene_note(manifest: Manifest) -> bytes:
    """What START tells a recorder: how to read the frames as text."""
    return device_note(manifest.device, manifest.encoding)


def plan_note(entry: Mapping[str, Any]) -> bytes:
    """The same as `frame_note`, of what stands in a manifest of a frame (`frame_entry`)."""
    return _packed({key: value for key, value in entry.items() if key not in NOT_NOTED})


def frame_note(mark: FrameMark) -> bytes:
    """What MARK tells a recorder: the frame as a manifest has it."""
    return _packed(
        {
            "start_s": mark.start_s, "settled_s": mark.settled_s, "end_s": mark.end_s,
            "moving": list(mark.moving), "omega": mark.omega.tolist(), "target": mark.target.tolist(),
            "wish": [[None if np.isnan(v) else v for v in row] for row in mark.wish.level.tolist()],
            "cells": mark.cells, "text": mark.text, "outcome": mark.outcome.value, "page": mark.page,
            "span": list(mark.span),
            **({} if mark.wish.contrast_db is None else {"contrast_db": mark.wish.contrast_db}),
            **({"goes_on": [asdict(one) for one in mark.goes_on]} if mark.goes_on else {}),
            **({} if mark.number is None else {"number": asdict(mark.number)}),
        }
    )  # fmt: skip


def live_note(entry: Mapping[str, Any] | None, start_s: float) -> bytes:
    """What MARK tells a recorder of a pattern that stands until the next mark: the frame as a manifest has it.

    `entry` is None for the way to rest, which ends the frame before it and is none itself.
    """
    return _packed({**(entry or {}), "start_s": start_s, "end_s": None})


def device_note(device: Device, encoding: Mapping[str, Any]) -> bytes:
    """What START tells a recorder, where nobody knows yet what is going to be shown."""
    return _packed({"device": device.name, "encoding": dict(encoding)})


def _packed(value: Mapping[str, Any]) -> bytes:
    return zlib.compress(json.dumps(value, allow_nan=False).encode("ascii"), 9)


def _unpacked(note: bytes) -> dict[str, Any]:
    """The note's object; empty when it is none."""
    try:
        value = json.loads(zlib.decompressobj().decompress(note, MOST_NOTE_BYTES))
        json.dumps(value, allow_nan=False)
    except (zlib.error, ValueError, RecursionError):
        return {}
    return value if isinstance(value, dict) else {}


@dataclass(frozen=True)
class CutShort:
    """A session that did not come to its end: seconds of its samples that arrived, and those announced."""

    arrived_s: float
    total_s: float


class ArrivalRecorder:
    """Writes what arrives in one session to a .wav (float32) and the manifest beside it.

    A sample is code / 32767 of the channel's volts per unit; float32 gives every code back exactly. Events
    stand at their samples. Of a session without samples it keeps those that the controller drew. Frames come from the
    notes of the marks; a mark without a note has no frame in the record, and a frame without an end ends at the next
    mark with a note, or with the session. The files appear when the session's END arrives and, without samples, all has
    gone out, or when it is cut short: then they hold the samples that arrived and the frames that stood in them, and
    the manifest says ``"complete": false``. A new session writes them anew; one of which no sample arrived leaves them
    as they are.

    Attributes
    ----------
    finished : sessions written that were complete.
    cut_short : the last session, when it was cut short.

    Parameters
    ----------
    device : the hardware the controller stands for.
    path : the .wav.

    Raises
    ------
    FileError
        When `path` does not end in .wav, or the file system refuses.
    """

    def __init__(self, device: Device, path: Path) -> None:
        if path.suffix.lower() != ".wav":
            raise FileError(f"{path}: expected a name that ends in .wav")
        self._device = device
        self._path = path
        self._manifest_path = path.with_suffix(".json")
        self._lam_step = ControllerSpec.of(device, buffer_s=1.0).lam_step
        self._stack = ExitStack()
        self._under_way = False
        self.finished = 0
        self.cut_short: CutShort | None = None

    def start(self, start: StartMessage) -> None:
        """A session begins; one that was not finished is cut short."""
        self.cut()
        self._total = start.total
        self._note = _unpacked(start.note)
        self._coupling: list[dict[str, Any]] = []
        self._frames: list[dict[str, Any]] = []
        with ExitStack() as stack:
            self._file, self._manifest_file = stack.enter_context(atomic_files(self._path, self._manifest_path))
            with naming(self._path):
                self._writer = WavWriter(
                    self._file, channels_of(self._device), self._device.amplifier.rate_hz, "float32"
                )
            self._stack = stack.pop_all()
        self._under_way = True

    def samples(self, codes: Codes) -> None:
        """Samples, int16, shape (S, channels)."""
        with naming(self._path):
            self._writer.write(codes.astype(np.float64) * (self._device.amplifier.volts / FULL_CODE))

    def drawn(self, volts: NDArray[np.float64]) -> None:
        """Samples that a controller drew of a session without any, float64, shape (S, channels), volts."""
        with naming(self._path):
            self._writer.write(volts)

    def event(self, event: Event) -> None:
        """Something to do at a sample."""
        rate = self._device.amplifier.rate_hz
        if isinstance(event, LinkCoupling | Links):
            if isinstance(event, LinkCoupling):
                lam = [code * self._lam_step for code in event.codes]
            else:
                lam = list(event.lam)
            times = {"t_s": event.at / rate, "ramp_s": event.ramp / rate}
            self._coupling.append({"row": event.row, "lam": lam, **times})
        elif isinstance(event, Mark) and (frame := _unpacked(event.note)):
            self._close_frame(event.at / rate)
            self._frames.append(frame)

    def end(self) -> None:
        """The session is complete: put the files in place."""
        self._under_way, self.cut_short = False, None
        self._close_frame(self._writer.samples / self._device.amplifier.rate_hz)
        self._write(self._frames, {})
        self.finished += 1

    def cut(self) -> None:
        """The session goes no further: put in place what arrived of it. Without a session, nothing happens."""
        if not self._under_way:
            return
        rate = self._device.amplifier.rate_hz
        self._under_way = False
        self.cut_short = CutShort(self._writer.samples / rate, self._total / rate)
        if self._writer.samples:
            self._close_frame(self.cut_short.arrived_s)
            stood = (_stood(frame, self.cut_short.arrived_s, self._device) for frame in self._frames)
            self._write([frame for frame in stood if frame is not None], {"complete": False})
        else:
            self._drop()

    def _close_frame(self, end_s: float) -> None:
        """The frame whose end was left open ends here; one that never stood was none."""
        if not self._frames or self._frames[-1].get("end_s", 0.0) is not None:
            return
        frame = _stood(self._frames.pop() | {"end_s": end_s}, end_s, self._device)
        if frame is not None:
            self._frames.append(frame)

    def _write(self, frames: list[dict[str, Any]], more: Mapping[str, Any]) -> None:
        with self._stack:
            with naming(self._path):
                self._writer.finish()
                digest = digest_of_open(self._file)
            manifest = {
                "schema": SCHEMA,
                "samples_file": self._path.name,
                "rate_hz": self._device.amplifier.rate_hz,
                "samples": self._writer.samples,
                "digest": digest,
                "device": self._device.as_dict(),
                "channels": [channel.as_dict() for channel in channels_of(self._device)],
                "coupling": self._coupling,
                "frames": frames,
                "encoding": self._note.get("encoding", {}),
                **more,
            }
            with naming(self._manifest_path):
                self._manifest_file.write(json.dumps(manifest, allow_nan=False).encode())

    def _drop(self) -> None:
        with suppress(_Dropped), self._stack:
            raise _Dropped


class _Dropped(Exception):
    """Leaves the unfinished files by the way that removes them."""


def _stood(frame: dict[str, Any], arrived_s: float, device: Device) -> dict[str, Any] | None:
    """The frame as far as it arrived; None when its pattern did not stand for a period of the resonance."""
    settled_s, end_s = frame.get("settled_s"), frame.get("end_s")
    if not isinstance(settled_s, int | float) or not isinstance(end_s, int | float):
        return None
    stood_s = min(end_s, arrived_s) - settled_s
    return frame | {"end_s": min(end_s, arrived_s)} if stood_s >= 1 / device.f0_hz else None
