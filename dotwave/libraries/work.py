"""What is done with one file of a library, in whatever process."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from chainsim import Device
from drivers import WAVEFORMS_VERSION
from encoders import TextOptions, TextSource, liblouis_version
from planner import PLANS_VERSION

from ..api.scenes import text
from ..errors import AppError, bad_input
from ..icon_sets.work import Record, Task
from ..rendering.render import render
from ..request import Request

__all__ = ["LibraryRecipe", "render_files"]


@dataclass(frozen=True)
class LibraryRecipe:
    """How the files of a library are rendered.

    Attributes
    ----------
    folder, out : where they are read and written, absolute; whoever works has both under these names.
    device : the hardware.
    options : of the encoder.
    request : what is asked of every file.
    waveforms : whether a .wav is written for each.
    """

    folder: Path
    out: Path
    device: Device
    options: TextOptions
    request: Request
    waveforms: bool

    @cached_property
    def scope(self) -> str:
        """Digest of all that a file becomes by, beside its own bytes; places do not count."""
        versions = [PLANS_VERSION, WAVEFORMS_VERSION, liblouis_version()]
        given = [self.device.as_dict(), asdict(self.options), asdict(self.request), self.waveforms, versions]
        return hashlib.sha256(json.dumps(given, sort_keys=True, default=str).encode()).hexdigest()

    def wave(self, name: str) -> Path:
        """Where the waveform of a file is written."""
        return self.out / f"{name}.wav"


def render_files(recipe: LibraryRecipe, tasks: Sequence[Task]) -> Iterator[Record]:
    """Render the files that tasks name, and write waveforms where they are asked for.

    Yields
    ------
    Records with ``name`` and either ``bad`` or ``ok``, ``frames``, ``pages``, ``duration_s`` (seconds), ``note`` and
    ``waveform`` (its name below the output folder, empty when there is none).
    """
    for task in tasks:
        record = {"key": task.key, "name": task.name}
        try:
            yield record | _rendered(recipe, task.name)
        except bad_input() as error:
            yield record | {"bad": " ".join(str(error).split())}


def _rendered(recipe: LibraryRecipe, name: str) -> dict[str, Any]:
    options = recipe.options
    if not recipe.out.is_dir():
        raise AppError(f"{recipe.out}: this worker does not have the folder; give one that all of them share")
    source = TextSource.of_path(recipe.folder / name, encoding=options.encoding, math=options.math)
    path = recipe.wave(name) if recipe.waveforms else None
    report = render(text(source, recipe.device, options), recipe.device, path, recipe.request)
    return {
        "ok": report.ok,
        "frames": report.frames,
        "pages": getattr(report, "pages", report.frames),
        "duration_s": round(report.duration_s, 3),
        "note": report.failure,
        "waveform": f"{name}.wav" if report.files else "",
    }
