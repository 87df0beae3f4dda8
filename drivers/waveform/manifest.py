"""The manifest beside the samples: enough to rebuild the experiment. Its contents, and writing it."""

from __future__ import annotations

import hashlib
import json
import shutil
import tempfile
from collections.abc import Mapping
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import IO, Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from chainsim import Closure, Device, Outcome
from encoders import GoesOn, PageNumber
from planner import FramePlan, FrameWish

from ..channels import Channel, channels_of
from ..errors import UnreadableWaveform, WaveformError
from ..files.whole import naming
from .coupling import CouplingEvent, CouplingWriter, LamTrack
from .frame_entry import frame_entry

__all__ = [
    "MOST_BYTES", "SCHEMA", "FrameMark", "HeadingMark", "Manifest", "ManifestWriter", "digest_of", "digest_of_open",
]  # fmt: skip

Floats = NDArray[np.float64]

SCHEMA = "dotwave/waveform/1"
# About four hours of a grid with a lam on every link; reading takes ten times as much memory.
MOST_BYTES = 500_000_000
# Of it, what stands beside frames and coupling.
REST_BYTES = 10_000_000
ENCODER = json.JSONEncoder(ensure_ascii=False, allow_nan=False)


@dataclass(frozen=True)
class FrameMark:
    """One frame as the manifest has it.

    Attributes
    ----------
    start_s, settled_s, end_s : the pattern stands from settled_s to end_s.
    omega : float64, shape (rows,), read-only, each row's drive frequency over f0; 0 where nothing moves (files from
        before that was written: any).
    tones : further frequencies over f0 at which each row is to move as much; mostly none.
    phase : float64, shape (rows, cols), read-only, wanted phases in radians, NaN where any will do; those of rows
        with one omega may all be shifted alike.
    moving : for each row whether its target is an amplitude at omega; else what is felt is its mean.
    target : float64, shape (rows, cols), read-only, amplitude that is aimed at, in units of full scale.
    wish : what the scene asked for; of an old manifest the target.
    cells, text : what is shown, as Unicode Braille and as source text.
    outcome : how planning it went.
    page : frames of one page are superposed by the reader.
    span : (start, end) of `text` in the source.
    beats : for each row depth and period in seconds of a motion that never settles, None where it does; empty where all
        rows do. Their targets are the loudest that passes by.
    modulated : for each row whether its target is felt in how a carrier swells, as the device's `modulation` says.
    goes_on, number : which cells are not of the text: where words of the page go on, and the page's number.
    smoothness : where the pattern travels, order of the smooth step that levels go along over the whole of the frame,
        from those of the frame before to these (`encoders.crossing`); else 0.
    """

    start_s: float
    settled_s: float
    end_s: float
    omega: Floats
    target: Floats
    cells: str
    text: str
    outcome: Outcome
    page: int
    span: tuple[int, int]
    tones: tuple[tuple[float, ...], ...]
    phase: Floats
    moving: tuple[bool, ...]
    wish: FrameWish
    goes_on: tuple[GoesOn, ...] = ()
    number: PageNumber | None = None
    smoothness: int = 0
    beats: tuple[tuple[float, float] | None, ...] = ()
    modulated: tuple[bool, ...] = ()


@dataclass(frozen=True)
class HeadingMark:
    """A heading of a text as `encoders.Heading`, and where it is felt: number, page and start of the frame."""

    level: int
    text: str
    frame: int
    page: int
    start_s: float


@dataclass(frozen=True)
class Manifest:
    """What a written waveform says about itself; times in seconds from the first sample.

    Attributes
    ----------
    samples_file : name of the file of samples, in the same folder.
    samples : its length per channel.
    digest : "sha256:" and the hash of that file's bytes.
    coupling : events by time within each row.
    frames : in order of time.
    encoding : from the scene.
    headings : of documents, in order; empty where none are known.
    """

    samples_file: str
    rate_hz: int
    samples: int
    digest: str
    device: Device
    channels: tuple[Channel, ...]
    coupling: tuple[CouplingEvent, ...]
    frames: tuple[FrameMark, ...]
    encoding: Mapping[str, Any]
    headings: tuple[HeadingMark, ...] = ()

    @property
    def duration_s(self) -> float:
        """Length of the waveform in seconds."""
        return self.samples / self.rate_hz

    @cached_property
    def _lam(self) -> LamTrack:
        return LamTrack(self.coupling, self.device.rows, self.device.cols, down=self.device.grid)

    def lam_at(self, times_s: Floats) -> Floats:
        """Links at a block of times (float64, shape (S,), seconds); memory is that of the answer.

        Returns
        -------
        float64, shape (S, rows, cols); ``[:, r, m]`` couples actuator m-1 of row r into m. A chain's first is 0,
        or where chains are rings, whose closing link is set with the first, that of its second.
        """
        lam = self._lam.at(times_s)
        if self.device.coupling.closure is Closure.RING and self.device.chain_length > 1:
            lam[:, :, :: self.device.chain_length] = lam[:, :, 1 :: self.device.chain_length]
        return lam

    def lam_y_at(self, times_s: Floats) -> Floats | None:
        """Links downwards at a block of times, as `LamTrack.down_at`; None where the device has none."""
        return self._lam.down_at(times_s) if self.device.grid else None

    def check_digest(self, path: Path) -> None:
        """Compare the bytes of the samples file at `path` with `digest`.

        Raises
        ------
        FileError
            When the file cannot be read.
        UnreadableWaveform
            When it is not the file this manifest was written for.
        """
        found = digest_of(path)
        if found != self.digest:
            raise UnreadableWaveform(
                f"{path}: its digest is {found}, the manifest says {self.digest}; one of the two files was changed"
            )


def digest_of(path: Path) -> str:
    """The hash of a file's bytes as a manifest has it, "sha256:" in front.

    Raises
    ------
    FileError
        When the file cannot be read.
    """
    with naming(path), path.open("rb") as file:
        return digest_of_open(file)


def digest_of_open(file: BinaryIO) -> str:
    """The same of a file that is open for reading; it is left at its end.

    Raises
    ------
    OSError
        When it cannot be read.
    """
    file.seek(0)
    digest = hashlib.sha256()
    for piece in iter(lambda: file.read(1 << 20), b""):
        digest.update(piece)
    return f"sha256:{digest.hexdigest()}"


class ManifestWriter:
    """Takes the frames as they are sampled and writes the manifest at the end.

    Frames and coupling events wait in nameless files in the folder of `path`, so that memory does not grow
    with them. Use it in a `with` statement.

    Parameters
    ----------
    device : the hardware.
    path : where the manifest will be, for messages.
    """

    def __init__(self, device: Device, path: Path) -> None:
        self._device = device
        self._path = path
        self._coupling = CouplingWriter(device)
        self.frames = 0

    def __enter__(self) -> ManifestWriter:
        with naming(self._path), ExitStack() as stack:
            self._events = _Spool(stack.enter_context(tempfile.TemporaryFile(dir=self._path.parent)))
            self._marks = _Spool(stack.enter_context(tempfile.TemporaryFile(dir=self._path.parent)))
            self._headings = _Spool(stack.enter_context(tempfile.TemporaryFile(dir=self._path.parent)))
            self._stack = stack.pop_all()
        return self

    def __exit__(self, *_: object) -> None:
        # Closing flushes; a full disk has had its say by now, and what waits here is wanted no more.
        with suppress(OSError):
            self._stack.close()

    def add(self, frame: FramePlan) -> None:
        """Take the next frame (checked by `stretches`); the way out after the last frame makes no mark.

        Raises
        ------
        WaveformError
            When the driven chains of a row differ in omega, which a manifest cannot say, or it becomes too long.
        FileError
            When the disk is full.
        """
        with naming(self._path):
            for event in self._coupling.events(frame):
                self._events.add(event.as_dict())
            if frame.frame is not None:
                self._marks.add(frame_entry(self._device, frame, self.frames))
                for heading in frame.frame.headings:
                    place = {"frame": self.frames, "page": frame.frame.page, "start_s": frame.start_s}
                    self._headings.add({"level": heading.level, "text": heading.text} | place)
                self.frames += 1
        if self._events.size + self._marks.size + self._headings.size > MOST_BYTES - REST_BYTES:
            raise WaveformError(
                f"{self._path}: a manifest of more than {MOST_BYTES} bytes is not read again; give less at a time"
            )

    def write(self, out: BinaryIO, samples_file: str, samples: int, digest: str, encoding: Mapping[str, Any]) -> None:
        """Write the whole manifest to `out`.

        Raises
        ------
        WaveformError
            When `encoding` is not made of plain JSON values.
        OSError
            When the disk is full.
        """
        head = {
            "schema": SCHEMA,
            "samples_file": samples_file,
            "rate_hz": self._device.amplifier.rate_hz,
            "samples": samples,
            "digest": digest,
            "device": self._device.as_dict(),
            "channels": [channel.as_dict() for channel in channels_of(self._device)],
        }
        for key, value in head.items():
            out.write((b"{" if key == "schema" else b",") + b"\n" + _json(key) + b": " + _json(value))
        headings = (("headings", self._headings),) if self._headings.size else ()
        for key, spool in (("coupling", self._events), ("frames", self._marks), *headings):
            out.write(b",\n" + _json(key) + b": [")
            spool.copy_to(out)
            out.write(b"]")
        try:
            out.write(b",\n" + _json("encoding") + b": " + _json(dict(encoding)))
        except (TypeError, ValueError) as error:
            raise WaveformError(f"plan.encoding: {error}; only plain JSON values can be written") from None
        out.write(b"\n}\n")


class _Spool:
    """JSON items on lines, in a temporary file."""

    def __init__(self, file: IO[bytes]) -> None:
        self._file = file
        self.size = 0

    def add(self, item: dict[str, Any]) -> None:
        self.size += self._file.write((b",\n" if self.size else b"\n") + _json(item))

    def copy_to(self, out: BinaryIO) -> None:
        self._file.seek(0)
        shutil.copyfileobj(self._file, out)


def _json(value: object) -> bytes:
    # Half of a surrogate pair has no UTF-8; \udXXX is also how JSON writes it.
    return ENCODER.encode(value).encode("utf-8", "backslashreplace")
