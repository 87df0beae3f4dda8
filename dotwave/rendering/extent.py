"""How much a waveform is going to be: held against the free space, said, and asked about, before it is written."""

from __future__ import annotations

import os
import shutil
import sys
from collections import Counter
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import typer

from chainsim import Device
from drivers import FORMATS, Encoding, channels_of
from encoders import Frame

from ..errors import AppError, Declined

__all__ = ["Extent", "extent_of", "go_on"]

# From what size on it is worth a line, and a question where there is somebody to answer it.
SAID_BYTES, ASKED_BYTES = 100_000_000, 1_000_000_000
# A plan ends with a way out of its last frame, mostly of about this length.
WAY_OUT_S = 0.3


@dataclass(frozen=True)
class Extent:
    """What will be written, about: `seconds` on so many `channels`, `rate_hz` samples a second.

    A sample takes from `least_bytes` to `most_bytes`.
    """

    seconds: float
    channels: int
    rate_hz: int
    least_bytes: int
    most_bytes: int

    @property
    def samples(self) -> float:
        """Of all channels."""
        return self.seconds * self.rate_hz * self.channels

    @property
    def least(self) -> float:
        """Bytes that it takes at least."""
        return self.samples * self.least_bytes

    @property
    def most(self) -> float:
        """Bytes that it takes at most."""
        return self.samples * self.most_bytes

    def as_text(self) -> str:
        """``about 6.4 GB, 1 h 14 min of 42 channels at 8000 samples a second``."""
        about = "about" if self.least == self.most else "at most"
        what = f"{_time(self.seconds)} of {self.channels} channels at {self.rate_hz} samples a second"
        return f"{about} {_bytes(self.most)}, {what}"


def extent_of(frames: Iterable[Frame], device: Device, out: Path, encoding: Encoding, times: int = 1) -> Extent:
    """What `frames` will take in the file `out`, `times` over; they are drawn once, and none is kept."""
    sizes = FORMATS[out.suffix.lower()].sample_bytes
    # A number format that is not one of the file's own is refused by its writer.
    least, most = sizes.get(encoding, next(iter(sizes.values()), (0, 0)))
    seconds = times * (sum(frame.dwell_s for frame in frames) + WAY_OUT_S)
    return Extent(seconds, len(channels_of(device)), device.amplifier.rate_hz, least, most)


def go_on(extent: Extent, out: Path, *, yes: bool) -> None:
    """Say how much will be written where that is a lot, and ask where it is very much and a person is there.

    Parameters
    ----------
    out : a file or folder to be.
    yes : do not ask.

    Raises
    ------
    AppError
        When the disk has not so much space.
    Declined
        When the answer is no.
    """
    _check_space(extent, out)
    if extent.most < SAID_BYTES:
        return
    typer.echo(f"dotwave: writing {extent.as_text()}, to {out}", err=True)
    if yes or extent.most < ASKED_BYTES or not (sys.stdin and sys.stdin.isatty() and sys.stderr.isatty()):
        return
    typer.echo("Go on? [y/N] ", nl=False, err=True)
    if sys.stdin.readline().strip().lower() not in {"y", "yes"}:
        typer.echo("Nothing was written.", err=True)
        raise Declined


def _check_space(extent: Extent, out: Path) -> None:
    places = [next(folder for folder in (out.absolute(), *out.absolute().parents) if os.path.isdir(folder))]
    if out.suffix.lower() == ".npz":
        # Its samples wait there until their number is known; imported here, for no other file asks for it.
        import tempfile

        places.append(Path(tempfile.gettempdir()))
    with suppress(OSError):
        wanted = Counter(os.stat(place).st_dev for place in places)
        for place in places:
            needed, free = wanted[os.stat(place).st_dev] * extent.least, shutil.disk_usage(place).free
            if needed > free:
                raise AppError(
                    f"{out}: {extent.as_text()}, needs {_bytes(needed)} in {place}, where {_bytes(free)} are free; "
                    "free some space, write elsewhere, or give less at a time"
                )


def _bytes(size: float) -> str:
    for unit, scale in (("TB", 1e12), ("GB", 1e9), ("MB", 1e6)):
        if size >= scale:
            return f"{size / scale:.3g} {unit}"
    return f"{size / 1e3:.3g} kB"


def _time(seconds: float) -> str:
    if seconds < 120:
        return f"{seconds:.3g} s"
    hours, minutes = divmod(round(seconds / 60), 60)
    return f"{hours} h {minutes} min" if hours else f"{minutes} min"
