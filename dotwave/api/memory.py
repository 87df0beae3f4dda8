"""Waveforms in memory, given to what reads files."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from os import PathLike
from pathlib import Path
from tempfile import TemporaryDirectory

from .plans import PlanWaveform, ScenePlan

__all__ = ["MEMORY", "Playable", "on_disk"]

Playable = str | PathLike[str] | ScenePlan | PlanWaveform

MEMORY = "a waveform in memory"
"""What reports call it in place of a path."""


@contextmanager
def on_disk(what: Playable) -> Iterator[Path]:
    """The path of a waveform; one in memory is written as float64 to a temporary folder.

    Raises
    ------
    NotMade
        When a frame of a plan cannot be made as asked.
    """
    if isinstance(what, str | PathLike):
        yield Path(what)
        return
    wave = what.waveform() if isinstance(what, ScenePlan) else what
    with TemporaryDirectory() as folder:
        path = Path(folder) / "memory.npz"
        wave.write(path)
        yield path
