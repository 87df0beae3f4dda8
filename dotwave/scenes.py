"""Texts and patterns as scenes, each with a line that says what it is; and scenes one after another."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import Any

from chainsim import Device
from encoders import Frame, GridShape, Scene, TargetPattern, TextOptions, TextScene, TextSource, encode_text
from planner import PlanError

from .request import Request

__all__ = ["DeviceScene", "SceneFrames", "joined", "placed", "shape_of", "still_scene", "text_scene"]

LONGEST_WORDS = 40


@dataclass(frozen=True, repr=False)
class DeviceScene(Scene):
    """A scene that brings the device to show it on, and says how it is to be planned."""

    device: Device = field(kw_only=True)

    @abstractmethod
    def request(self, given: Request) -> Request:
        """What is asked of its run: what is given, and what the scene says where nothing is."""

    @abstractmethod
    def placed(self, error: PlanError) -> Exception:
        """What the planner refused, with the place in the scene that it was about."""


@contextmanager
def placed(scene: Scene) -> Iterator[None]:
    """What the planner refuses of `scene` gets its place, where the scene knows one."""
    try:
        yield
    except PlanError as error:
        if not isinstance(scene, DeviceScene):
            raise
        raise scene.placed(error) from None


def shape_of(device: Device) -> GridShape:
    """The grid that scenes for a device are laid out for."""
    return GridShape(device.rows, device.cols)


def text_scene(source: TextSource, shape: GridShape, options: TextOptions) -> TextScene:
    """A text; raises as `encoders.encode_text` does."""
    scene = encode_text(source, shape, options)
    said = scene.text_frames.source.text.replace("\n", " ")
    words = said if len(said) <= LONGEST_WORDS else said[: LONGEST_WORDS - 3] + "..."
    return replace(scene, parts=(f"text: {words}",))


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
