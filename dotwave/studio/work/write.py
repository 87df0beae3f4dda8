"""A text or document on a device: written, verified through the file, and drawn."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from drivers import DriverError
from encoders import TextSource

from ...api.felt import Felt, verify
from ...api.scenes import device as device_of, text as text_scene
from ...figures.preview import write_preview
from ...icon_sets.words import in_words
from ...rendering.render import render
from ...reports.spoken import spoken
from ...reports.text import FrameCheck, TextReport
from ...request import Request
from .tell import Tell

__all__ = ["do"]

WAVEFORM, OTHER = "text.wav", "text.hjif"


def do(folder: Path, asked: Mapping[str, Any], tell: Tell) -> dict[str, Any]:
    """Render what is asked into `folder` and say what is felt, plain JSON types.

    Parameters
    ----------
    asked : `device`, `source` (a file of the folder) or `text`, and `options` of `encoders.TextOptions`.
    """
    device, options = device_of(asked["device"]), asked["options"]
    source = TextSource.of_path(folder / asked["source"]) if asked["source"] else TextSource.of_text(asked["text"])

    def written(name: str) -> TextReport:
        found = render(text_scene(source, device, **options), device, folder / name, Request(yes=True))
        if not isinstance(found, TextReport):
            raise TypeError("a text gave another report")
        return found

    report = written(WAVEFORM)
    answer: dict[str, Any] = {
        "made": report.ok, "lines": report.as_text().splitlines(), "undefined": list(report.undefined),
        "split": list(report.split), "differences": list(report.differences), "device": device.name, "frames": [],
    }  # fmt: skip
    if not report.files:
        return answer
    try:
        written(OTHER)
    except DriverError as error:
        # Patterns that stand still are no vibration; all else of the text is there.
        answer["lines"].append(f"No haptic file: {error}.")
    felt = verify(folder / WAVEFORM)
    write_preview(felt, folder / "text")
    return answer | _felt(felt)


def _felt(felt: Felt) -> dict[str, Any]:
    return {
        "ok": felt.ok, "felt_text": felt.text, "same": felt.text_equal, "verdict": felt.as_text().splitlines(),
        "words": list(spoken(felt)), "frames": [_frame(number, one) for number, one in enumerate(felt.frames, 1)],
    }  # fmt: skip


def _frame(number: int, frame: FrameCheck) -> dict[str, Any]:
    return {
        "number": number, "page": frame.page + 1, "text": frame.text, "cells": frame.wanted_cells,
        "felt_cells": frame.felt_cells, "start_s": frame.start_s, "settled_s": frame.settled_s, "end_s": frame.end_s,
        "wanted": frame.wanted_dots.tolist(), "felt": frame.felt.round(4).tolist(),
        "dots": frame.felt_dots.tolist(), "words": in_words(frame.felt_dots.astype(float)),
        "contrast_db": frame.contrast_db, "error": frame.amplitude_error, "wrong": frame.wrong_dots, "ok": frame.ok,
    }  # fmt: skip
