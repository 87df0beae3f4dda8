"""Every step of the encoding of pictures, as pictures."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from chainsim import Device
from drivers import atomic_file, naming
from encoders import PictureOptions, explain_picture

from ..pictures import pitched
from ..scenes import shape_of

__all__ = ["write_steps"]

SHORTEST_SIDE = 240


def write_steps(files: Sequence[Path], device: Device, options: PictureOptions, folder: Path) -> tuple[str, ...]:
    """Write a PNG of every step of every picture's encoding into `folder`; gives their names.

    Raises
    ------
    EncodeError, FileError
        When a picture cannot be used, or the folder refuses.
    """
    from PIL import Image

    shape, options = shape_of(device), pitched(options, device)
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
