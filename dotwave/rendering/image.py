"""Pictures to a waveform, and every step of their encoding as a picture."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from chainsim import load_device
from drivers import atomic_file, naming
from encoders import GridShape, PictureOptions, encode_picture, explain_picture, picture_rules

from ..errors import AppError
from ..jobs.scene import Shown, joined, picture_words
from ..reports.scene import SceneReport
from .scene import Rendering, render_scene

__all__ = ["picture_options", "render_images"]

SHORTEST_SIDE = 240


def picture_options(**given: Any) -> PictureOptions:
    """`encoders.PictureOptions` with its own defaults wherever the command line says nothing (None).

    Raises
    ------
    AppError, encoders.PictureError
        When a word is not one of its choices, or a number is out of range.
    """
    chosen = {name: value for name, value in given.items() if value is not None}
    for name, value in chosen.items():
        words = picture_rules()[name].choices
        if words and value not in words:
            option = "as" if name == "output" else name
            raise AppError(f"--{option}: expected one of {', '.join(words)}, got {value!r}")
    return PictureOptions(**chosen)


def render_images(
    files: Sequence[Path], *, device: str, options: PictureOptions, how: Rendering, explain: Path | None = None
) -> SceneReport:
    """Encode pictures one after another, plan them and, with an output, write the waveform.

    Parameters
    ----------
    options : of the encoder; the pitch is the device's. explain : folder for a PNG of every step of every picture.

    Raises
    ------
    EncodeError, ChainError, PlanError, DriverError
        When a picture, the device or a folder cannot be used.
    """
    began = time.perf_counter()
    profile = load_device(device)
    shape = GridShape(profile.rows, profile.cols)
    options = replace(options, pitch_m=(profile.pitch_m, profile.pitch_m))
    parts = [Shown(scene, picture_words(scene.report)) for scene in (encode_picture(f, shape, options) for f in files)]
    steps = _explained(files, shape, options, explain) if explain is not None else ()
    report = render_scene(joined(parts, shape), profile, how, [part.words for part in parts])
    return replace(report, files=(*report.files, *steps), seconds=time.perf_counter() - began)


def _explained(files: Sequence[Path], shape: GridShape, options: PictureOptions, folder: Path) -> tuple[str, ...]:
    from PIL import Image

    written = []
    with naming(folder):
        folder.mkdir(parents=True, exist_ok=True)
    for place, file in enumerate(files, 1):
        for number, step in enumerate(explain_picture(file, shape, options), 1):
            name = "".join(letter if letter.isalnum() else "-" for letter in step.name).strip("-")
            start = f"{place}-" if len(files) > 1 else ""
            path = folder / f"{start}{file.stem}-{number:02d}-{name}.png"
            pixels = step.pixels()
            # Small steps are enlarged so that single points can be seen.
            times = max(1, SHORTEST_SIDE // max(pixels.shape[:2]))
            large = np.repeat(np.repeat(pixels, times, axis=0), times, axis=1)
            with atomic_file(path) as out, naming(path):
                Image.fromarray(large).save(out, "PNG")
            written.append(str(path))
    return tuple(written)
