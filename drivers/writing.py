"""A plan into a file of any format: samples with their manifest, a pack, or a haptic file."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from planner import Plan

from .formats.table import PACK_SUFFIX, format_of
from .formats.wav import Encoding
from .waveform.file import write_waveform

__all__ = ["WrittenPlan", "write_plan"]


@dataclass(frozen=True)
class WrittenPlan:
    """What was written.

    Attributes
    ----------
    files : the samples and their manifest, the pack, or the haptic file.
    peak_volts : largest voltage of any channel, None for a haptic file.
    left_out : one sentence on what of the plan is not in a pack, empty where all is.
    """

    files: tuple[Path, ...]
    peak_volts: float | None
    left_out: str = ""


def write_plan(
    plan: Plan,
    path: Path | str,
    *,
    encoding: Encoding = "float32",
    actuator: tuple[int, int] | None = None,
    progress: Callable[[float], None] | None = None,
) -> WrittenPlan:
    """Carry out `plan` into the file `path`, in the format that its ending stands for (`FORMATS`).

    The plan's frames are drawn once; a file appears whole, or not at all.

    Parameters
    ----------
    encoding : number format of samples.
    actuator : (row, col) that a haptic file of one actuator shows; None is the mean over the grid.
    progress : called with the seconds written so far, where there are samples.

    Raises
    ------
    WaveformError, LimitError
        When the plan contradicts itself or the device, or is more than the format or the amplifier can give.
    FileError
        When the ending of `path` stands for no format, or the file system refuses.
    """
    path = Path(path)
    if path.suffix.lower() == PACK_SUFFIX:
        from .packs.writer import write_pack

        packed = write_pack(plan, path, progress=progress)
        return WrittenPlan((path,), packed.peak_volts, packed.left_out)
    if not format_of(path).sample_bytes:
        # Imported here: most files are samples.
        from .exchange.file import write_exchange

        write_exchange(plan, path, actuator=actuator)
        return WrittenPlan((path,), None)
    written = write_waveform(plan, path, encoding=encoding, progress=progress)
    return WrittenPlan((written.samples_path, written.manifest_path), float(np.max(np.abs(written.peak_volts))))
