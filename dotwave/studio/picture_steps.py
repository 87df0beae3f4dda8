"""A picture on its way to a pattern, step by step, with the options of a form."""

from __future__ import annotations

import base64
import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chainsim import Device
from encoders import PictureOptions, encode_picture, explain_picture, picture_rules

from ..errors import AppError
from ..icon_sets.words import in_braille, in_words
from ..pictures import pitched
from ..scenes import shape_of

__all__ = ["OFFERED", "choices_of", "options_of", "steps_of"]

OFFERED = ("style", "fit", "threshold", "invert", "background", "thicken", "edges", "contrast", "crop")
TYPED = ("background", "thicken")
YES_NO = {"yes": True, "no": False}
SHORTEST_SIDE = 120


def choices_of() -> dict[str, tuple[str, ...]]:
    """The words that each option offered may be; empty where it is typed."""
    rules = picture_rules()
    return {name: () if name in TYPED else rules[name].choices or tuple(YES_NO) for name in OFFERED}


def options_of(given: Mapping[str, str]) -> PictureOptions:
    """The options that were chosen; an empty one is the default.

    Raises
    ------
    AppError, encoders.PictureError
        When one is out of range.
    """
    chosen: dict[str, Any] = {}
    for name in OFFERED:
        words, rule = given.get(name, "").strip(), picture_rules()[name]
        if not words:
            continue
        if rule.choices or name == "background":
            chosen[name] = words
        elif words in YES_NO:
            chosen[name] = YES_NO[words]
        else:
            try:
                chosen[name] = float(words)
            except ValueError:
                raise AppError(f"{name}: expected a number, got {words!r}") from None
    return PictureOptions(**chosen)


def steps_of(path: Path, device: Device, options: PictureOptions) -> dict[str, Any]:
    """The steps as pictures, and what is felt in the end.

    Raises
    ------
    encoders.EncodeError
        When the picture cannot be used.
    """
    shape, options = shape_of(device), pitched(options, device)
    steps = explain_picture(path, shape, options)
    scene = encode_picture(path, shape, options)
    felt = np.abs(next(iter(scene.frames)).pattern.amplitude)
    first, raised = scene.report.frames[0], felt >= 0.5
    return {
        "steps": [{"name": step.name, "source": _embedded(step.pixels())} for step in steps],
        "levels": felt.tolist(), "raised": raised.tolist(), "words": in_words(raised.astype(np.float64)),
        "braille": in_braille(raised.astype(np.float64)), "similarity": scene.report.similarity, "doubt": first.doubt,
        "notes": list(scene.report.notes), "style": str(scene.report.style), "frames": len(scene.report.frames),
    }  # fmt: skip


def _embedded(pixels: NDArray[np.uint8]) -> str:
    from PIL import Image

    times = max(1, SHORTEST_SIDE // max(pixels.shape[:2]))
    file = io.BytesIO()
    Image.fromarray(np.repeat(np.repeat(pixels, times, axis=0), times, axis=1)).save(file, "PNG")
    return "data:image/png;base64," + base64.b64encode(file.getvalue()).decode()
