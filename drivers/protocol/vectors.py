"""What a firmware put out, vector by vector, written as a waveform that `verify` reads like any other.

``python -m drivers.protocol.vectors RECORD WAVEFORM OUT.wav`` does so for the record of a port: the frames are those of
the waveform that was played, samples and links are what truly went out.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from ..errors import DriverError, FileError
from ..files.whole import naming
from ..waveform.file import read_waveform
from ..waveform.manifest import Manifest
from .messages import LinkCoupling, Mark, StartMessage
from .record import ArrivalRecorder, frame_note, scene_note

__all__ = ["write_vectors"]

BLOCK = 4096


def write_vectors(record: Path, manifest: Manifest, out: Path) -> int:
    """Write a waveform of what a record holds; returns its samples.

    Parameters
    ----------
    record : for each sample {u64 its number, u16 the links of all rows, i16 the code of each channel}, little-endian.
    manifest : of the waveform that was played.
    out : the .wav; its manifest stands beside it.

    Raises
    ------
    FileError
        When the record is none for this grid or not whole, or the file system refuses.
    """
    device = manifest.device
    links = device.cols - 1
    vector = np.dtype([("at", "<u8"), ("links", "<u2", (device.rows, links)), ("codes", "<i2", len(manifest.channels))])
    with naming(record):
        raw = record.read_bytes()
    vectors = np.frombuffer(raw, dtype=vector, count=len(raw) // vector.itemsize)
    if not len(vectors) or len(raw) % vector.itemsize or not np.array_equal(vectors["at"], np.arange(len(vectors))):
        raise FileError(f"{record}: this is no whole session of {device.name}, sample by sample; play it again")
    recorder = ArrivalRecorder(device, out)
    recorder.start(StartMessage(1, True, manifest.rate_hz, len(vectors), scene_note(manifest)))
    for number, mark in enumerate(manifest.frames):
        recorder.event(Mark(round(mark.start_s * manifest.rate_hz), number, frame_note(mark)))
    before = np.zeros((device.rows, links), dtype=np.uint16)
    changed = np.any(np.diff(vectors["links"], axis=0, prepend=before[None]) != 0, axis=2)
    for at, row in np.argwhere(changed).tolist():
        recorder.event(LinkCoupling(at, row, 0, tuple(vectors["links"][at, row].tolist())))
    for first in range(0, len(vectors), BLOCK):
        recorder.samples(vectors["codes"][first : first + BLOCK])
    recorder.end()
    return len(vectors)


def _main() -> None:
    parser = argparse.ArgumentParser(prog="python -m drivers.protocol.vectors", description=__doc__)
    for name in ("record", "waveform", "out"):
        parser.add_argument(name, type=Path)
    given = parser.parse_args()
    try:
        manifest, _ = read_waveform(given.waveform)
        write_vectors(given.record, manifest, given.out)
    except DriverError as error:
        parser.error(str(error))


if __name__ == "__main__":
    _main()
