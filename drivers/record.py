"""What arrived at a controller, written as a waveform that `verify` reads like any other."""

from __future__ import annotations

import json
import zlib
from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np

from chainsim import Device

from .channels import channels_of
from .errors import FileError
from .files import atomic_paths, naming, opened
from .manifest import SCHEMA, FrameMark, Manifest, digest_of
from .messages import FULL_CODE, Codes, LinkCoupling, Mark, Start
from .playout import ControllerSpec, Event
from .wav import WavWriter

__all__ = ["ArrivalRecorder", "frame_note", "scene_note"]

MOST_NOTE_BYTES = 1 << 20


def scene_note(manifest: Manifest) -> bytes:
    """What START tells a recorder: how to read the frames as text."""
    return _packed({"device": manifest.device.name, "encoding": dict(manifest.encoding)})


def frame_note(mark: FrameMark) -> bytes:
    """What MARK tells a recorder: the frame as a manifest has it."""
    return _packed(
        {
            "start_s": mark.start_s, "settled_s": mark.settled_s, "end_s": mark.end_s,
            "omega": mark.omega.tolist(), "target": mark.target.tolist(), "cells": mark.cells, "text": mark.text,
            "outcome": mark.outcome.value, "page": mark.page, "span": list(mark.span),
        }
    )  # fmt: skip


def _packed(value: Mapping[str, Any]) -> bytes:
    return zlib.compress(json.dumps(value, allow_nan=False).encode("ascii"), 9)


def _unpacked(note: bytes) -> dict[str, Any]:
    """The note's object; empty when it is none."""
    try:
        value = json.loads(zlib.decompressobj().decompress(note, MOST_NOTE_BYTES))
    except (zlib.error, ValueError, RecursionError):
        return {}
    return value if isinstance(value, dict) else {}


class ArrivalRecorder:
    """Writes what arrives in one session to a .wav (float32) and the manifest beside it.

    A sample is code / 32767 of the channel's volts per unit; float32 gives every code back exactly. Events
    stand at their samples. Frames come from the notes of the marks; a mark without a note has no frame in the
    record. The files appear when the session's END arrives; a new session writes them anew.

    Parameters
    ----------
    device : the hardware the controller stands for. path : the .wav.

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
        self._lam_step = ControllerSpec.of(device, buffer_s=1.0).lam_step
        self._stack = ExitStack()
        self.finished = 0

    def start(self, start: Start) -> None:
        """A session begins; what was unfinished is dropped."""
        self.close()
        self._note = _unpacked(start.note)
        self._coupling: list[dict[str, Any]] = []
        self._frames: list[dict[str, Any]] = []
        manifest_path = self._path.with_suffix(".json")
        self._context = atomic_paths(self._path, manifest_path)
        with ExitStack() as stack:
            self._aside, self._manifest_aside = stack.enter_context(self._context)
            self._file = stack.enter_context(opened(self._aside, self._path))
            with naming(self._path):
                self._writer = WavWriter(
                    self._file, channels_of(self._device), self._device.amplifier.rate_hz, "float32"
                )
            self._stack = stack.pop_all()

    def samples(self, codes: Codes) -> None:
        """Samples, int16, shape (S, channels)."""
        with naming(self._path):
            self._writer.write(codes.astype(np.float64) * (self._device.amplifier.volts / FULL_CODE))

    def event(self, event: Event) -> None:
        """Something to do at a sample."""
        rate = self._device.amplifier.rate_hz
        if isinstance(event, LinkCoupling):
            lam = [code * self._lam_step for code in event.codes]
            times = {"t_s": event.at / rate, "ramp_s": event.ramp / rate}
            self._coupling.append({"row": event.row, "lam": lam, **times})
        elif isinstance(event, Mark) and (frame := _unpacked(event.note)):
            self._frames.append(frame)

    def end(self) -> None:
        """The session is complete: put the files in place."""
        with self._stack, naming(self._path):
            self._writer.finish()
            manifest = {
                "schema": SCHEMA,
                "samples_file": self._path.name,
                "rate_hz": self._device.amplifier.rate_hz,
                "samples": self._writer.samples,
                "digest": digest_of(self._aside),
                "device": self._device.as_dict(),
                "channels": [channel.as_dict() for channel in channels_of(self._device)],
                "coupling": self._coupling,
                "frames": self._frames,
                "encoding": self._note.get("encoding", {}),
            }
            self._manifest_aside.write_text(json.dumps(manifest, allow_nan=False), encoding="utf-8")
        self.finished += 1

    def close(self) -> None:
        """Drop what is unfinished."""
        stack, self._stack = self._stack.pop_all(), ExitStack()
        try:
            with stack:
                raise _Dropped
        except _Dropped:
            pass


class _Dropped(Exception):
    """Leaves the unfinished files by the way that removes them."""
