"""Texts, pictures and patterns as scenes, each with a line that says what it is; and scenes one after another."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from chainsim import Device
from encoders import (
    Frame,
    GridShape,
    PictureOptions,
    PictureReport,
    PictureScene,
    Scene,
    TargetPattern,
    TextOptions,
    TextScene,
    TextSource,
    encode_picture,
    encode_text,
)

__all__ = ["SceneFrames", "joined", "picture_scene", "pitched", "still_scene", "text_scene"]

LONGEST_WORDS = 40


def pitched(options: PictureOptions, device: Device) -> PictureOptions:
    """The options for pictures on the grid of a device."""
    return replace(options, pitch_m=(device.pitch_m, device.pitch_m))


def text_scene(source: TextSource, shape: GridShape, options: TextOptions) -> TextScene:
    """A text; raises as `encoders.encode_text` does."""
    words = source.text if len(source.text) <= LONGEST_WORDS else source.text[: LONGEST_WORDS - 3] + "..."
    return replace(encode_text(source, shape, options), parts=(f"text: {words}",))


def picture_scene(source: Path | bytes, shape: GridShape, options: PictureOptions) -> PictureScene:
    """A picture; raises as `encoders.encode_picture` does."""
    scene = encode_picture(source, shape, options)
    return replace(scene, parts=(_picture_words(scene.report),))


def still_scene(pattern: TargetPattern, dwell_s: float, words: str) -> Scene:
    """One pattern, for so many seconds."""
    return Scene(GridShape(*pattern.amplitude.shape), (Frame(pattern, dwell_s),), {"kind": "texture"}, (words,))


def joined(scenes: Sequence[Scene], shape: GridShape) -> Scene:
    """One scene after another; a single one keeps its encoding, so that a text can be read back."""
    encoding: Mapping[str, Any] = {"kind": "sequence", "parts": [dict(scene.encoding) for scene in scenes]}
    parts = tuple(words for scene in scenes for words in scene.parts)
    return Scene(shape, SceneFrames(tuple(scenes)), scenes[0].encoding if len(scenes) == 1 else encoding, parts)


class SceneFrames:
    """The frames of scenes one after another, pages counted on.

    `number` is of the scene whose frame was given last, -1 before the first.
    """

    def __init__(self, scenes: tuple[Scene, ...]) -> None:
        self._scenes = scenes
        self.number = -1

    def __iter__(self) -> Iterator[Frame]:
        first = 0
        for number, scene in enumerate(self._scenes):
            self.number, page = number, -1
            for frame in scene.frames:
                page = max(page, frame.page)
                yield replace(frame, page=first + frame.page)
            first += page + 1


def _picture_words(report: PictureReport) -> str:
    """File, style, similarity, and what was left out."""
    frames = f", {len(report.frames)} frames" if len(report.frames) > 1 else ""
    notes = f" ({'; '.join(report.notes)})" if report.notes else ""
    return f"{report.style}: {Path(report.name).name}{frames}, similarity {report.similarity:.2f}{notes}"
