"""A waveform on disk: samples and manifest, written together and read together."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from planner import FramePlan, Plan

from ..channels import channels_of
from ..errors import FileError, UnreadableWaveform
from ..files.parts import Belongs
from ..files.whole import atomic_files, check_plain, naming, settled
from ..formats.samples import SampleReader, open_samples, writer_for
from ..formats.table import FORMATS, PACK_SUFFIX, SUFFIXES, check_suffix
from ..formats.wav import Encoding
from .limits import LimitCheck
from .manifest import Manifest, ManifestWriter, digest_of_open
from .sampling import Waveform

__all__ = ["WAVEFORMS_VERSION", "WrittenWaveform", "read_waveform", "write_waveform"]

WAVEFORMS_VERSION = 2
"""One more whenever a plan gives other samples or another manifest: waveforms of icons are then written anew."""

BLOCK = 4096


@dataclass(frozen=True)
class WrittenWaveform:
    """What was written.

    Attributes
    ----------
    samples_path, manifest_path : the two files.
    frames : how many frames the manifest has.
    samples : per channel.
    duration_s : seconds.
    digest : "sha256:" and the hash of the samples file.
    peak_volts : float64, shape (channels,), read-only, volts.
    peak_slew_v_per_s : of any channel.
    """

    samples_path: Path
    manifest_path: Path
    frames: int
    samples: int
    duration_s: float
    digest: str
    peak_volts: NDArray[np.float64]
    peak_slew_v_per_s: float


def write_waveform(
    plan: Plan,
    path: Path | str,
    *,
    encoding: Encoding = "float32",
    progress: Callable[[float], None] | None = None,
) -> WrittenWaveform:
    """Carry out `plan` into `path` (.wav, .npz, .csv or .raw) and the manifest beside it (.json).

    Both files appear whole, or neither, even when the process is killed (`atomic_files`). The plan's frames are drawn
    once, and memory does not grow with their number. `progress` is called with the seconds written so far.

    Raises
    ------
    WaveformError
        When the plan contradicts itself or the device.
    LimitError
        When a sample is over the amplifier's volts or slew, or does not fit PCM24.
    FileError
        When the ending of `path` stands for no format, or the file system refuses.
    """
    path = Path(path)
    check_suffix(path, SUFFIXES)
    manifest_path = path.with_suffix(".json")
    with (
        atomic_files(path, manifest_path, belongs=_belongs(path)) as (file, manifest_file),
        ManifestWriter(plan.device, manifest_path) as marks,
    ):
        waveform = Waveform(plan.device, channels_of(plan.device), _marked(plan.frames, marks))
        check = LimitCheck(plan.device.amplifier, waveform.channels)
        with naming(path):
            writer = writer_for(path, file, waveform.channels, waveform.rate_hz, encoding)
        for block in waveform.blocks(BLOCK):
            check.check(block)
            with naming(path):
                writer.write(block)
            if progress is not None:
                progress(writer.samples / waveform.rate_hz)
        with naming(path):
            writer.finish()
            digest = digest_of_open(file)
        with naming(manifest_path):
            marks.write(manifest_file, path.name, writer.samples, digest, plan.encoding)
    peak_volts = check.peak_volts.copy()
    peak_volts.flags.writeable = False
    return WrittenWaveform(
        path, manifest_path, marks.frames, writer.samples, writer.samples / waveform.rate_hz, digest,
        peak_volts, check.peak_slew_v_per_s,
    )  # fmt: skip


def _belongs(path: Path) -> Belongs:
    """Names of samples, in any format, and manifest of one waveform."""
    return lambda name: Path(name).stem == path.stem and Path(name).suffix.lower() in (*SUFFIXES, ".json")


def _marked(frames: Iterable[FramePlan], marks: ManifestWriter) -> Iterator[FramePlan]:
    # A frame is noted once its samples are out: by then it has been checked.
    for frame in frames:
        yield frame
        marks.add(frame)


def read_waveform(path: Path | str, icon: str | None = None) -> tuple[Manifest, SampleReader]:
    """The manifest and the samples of a written waveform, by the path of either file; or of an entry of a pack.

    The samples are in volts. The digest is checked only when asked for, by `Manifest.check_digest`.

    Parameters
    ----------
    icon : name of the entry; None for the only one.

    Raises
    ------
    FileError
        When one of the files cannot be read.
    UnreadableWaveform
        When one of them is not what it should be, or they do not belong together.
    """
    path = Path(path)
    if path.suffix.lower() == PACK_SUFFIX:
        packed: tuple[Manifest, SampleReader] = FORMATS[PACK_SUFFIX].reader_module().read_packed(path, icon)
        return packed
    if icon is not None:
        raise FileError(f"{path}: only a pack ({PACK_SUFFIX}) has icons; leave out {icon!r}")
    # Imported here: whoever only writes has no manifest to check.
    from .manifest_reader import read_manifest

    manifest_path = path if path.suffix.lower() == ".json" else path.with_suffix(".json")
    settled(manifest_path, _belongs(path))
    # What was asked for is missed before what belongs to it.
    check_plain(path)
    manifest = read_manifest(manifest_path)
    samples_path = manifest_path.with_name(manifest.samples_file)
    if path != manifest_path and path.name != samples_path.name:
        raise UnreadableWaveform(
            f"{manifest_path}: samples_file: it belongs to {manifest.samples_file}, not {path.name}"
        )
    reader = open_samples(samples_path, manifest.channels, manifest.rate_hz)
    for name, said, found in (
        ("rate_hz", manifest.rate_hz, reader.rate_hz),
        ("samples", manifest.samples, reader.samples),
    ):
        if said != found:
            raise UnreadableWaveform(f"{manifest_path}: {name}: {said}, but {samples_path.name} has {found}")
    return manifest, reader
