"""A job as a scene: its device, and what its items show, one after another."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from chainsim import Device, Located, load_device
from encoders import (
    EncodeError,
    Frame,
    GridShape,
    Scene,
    Style,
    TargetPattern,
    TextOptions,
    TextSource,
    encode_picture,
    encode_text,
)
from planner import PlanError

from ..errors import AppError
from .job import Item, Job, PicturePart, TextPart, locate_job
from .paths import Reach

__all__ = ["JobScene", "Shown", "joined", "picture_words", "read_job_scene"]


@dataclass(frozen=True)
class Shown:
    """One part of a sequence: its scene, and a line that says what it is."""

    scene: Scene
    words: str


@dataclass(frozen=True)
class JobScene:
    """A job that was read and encoded.

    Attributes
    ----------
    located : the job, with its lines. device : to show it on. parts : what is shown. out : the file it names to write.
    """

    located: Located[Job]
    device: Device
    parts: tuple[Shown, ...]
    out: Path | None

    @property
    def job(self) -> Job:
        """As it stands in the file."""
        return self.located.model

    @property
    def shape(self) -> GridShape:
        """The device's grid."""
        return GridShape(self.device.rows, self.device.cols)

    @contextmanager
    def scene(self) -> Iterator[Scene]:
        """All parts as one scene; an item that cannot be planned is named with its line.

        Raises
        ------
        AppError
            When the planner refuses an item.
        """
        whole = joined(self.parts, self.shape)
        assert isinstance(whole.frames, _Frames)
        try:
            yield whole
        except PlanError as error:
            number = whole.frames.number
            if number < 0:
                raise
            kind = self.job.sequence[number].kind
            raise AppError(f"{self.located.at('sequence', number, kind)}: {error}") from None


def read_job_scene(path: Path, *, root: Path | None = None, device: Device | None = None) -> JobScene:
    """Read a job and encode its sequence.

    Parameters
    ----------
    root : nothing outside of this folder is read, or named as output; None for any. device : in place of the job's.

    Raises
    ------
    AppError, ChainError, EncodeError
        When the job, or what it names, cannot be used; ``job.yaml:14: sequence.3.image: ...``.
    """
    reach = Reach(path.parent, root)
    located = locate_job(reach.job(path))
    job = located.model
    if device is None:
        try:
            base = job.device.base
            found = str(reach.file(base, located.at("device", "base"))) if job.device.in_file else base
            device = job.device.on(load_device(found))
        except ValueError as error:
            raise AppError(f"{located.at('device')}: {error}") from None
    out = None if job.output is None else reach.output(job.output, located.at("output"))
    parts = []
    for number, item in enumerate(job.sequence):
        at = partial(located.at, "sequence", number, item.kind)
        try:
            parts.append(_Item(item, job, device, reach, at).shown())
        except EncodeError as error:
            raise AppError(f"{at()}: {error}") from None
    return JobScene(located, device, tuple(parts), out)


@dataclass(frozen=True)
class _Item:
    """One item of a job's sequence; `at` says where it, or a key of it, stands."""

    item: Item
    job: Job
    device: Device
    reach: Reach
    at: Callable[..., str]

    @property
    def shape(self) -> GridShape:
        return GridShape(self.device.rows, self.device.cols)

    def shown(self) -> Shown:
        item = self.item
        if item.text is not None:
            return self._text(item.text)
        if item.image is not None:
            return self._picture(item.image)
        if item.icon is not None:
            given = item.icon
            return self._picture(
                given if given.style is not Style.AUTO else given.model_copy(update={"style": Style.ICON})
            )
        if item.texture is not None:
            kind = next(name for name, value in item.texture if value is not None)
            return _still(item.texture.target(self.shape), item.texture.dwell_s, f"texture: {kind}")
        assert item.pause_s is not None
        blank = np.zeros((self.shape.rows, self.shape.cols), np.complex128)
        blank.flags.writeable = False
        return _still(TargetPattern(blank), item.pause_s, f"pause of {item.pause_s:g} s")

    def _text(self, part: TextPart) -> Shown:
        given = part.model_dump(exclude={"say", "file"})
        given["presentation"] = part.presentation or self.job.presentation
        self.reach.table(part.table, self.at("table"))
        if part.file is not None:
            source = TextSource.of_path(self.reach.file(part.file, self.at("file")))
        else:
            source = TextSource.of_text(part.say or "")
        words = source.text if len(source.text) <= 40 else source.text[:37] + "..."
        return Shown(encode_text(source, self.shape, TextOptions(**given)), f"text: {words}")

    def _picture(self, part: PicturePart) -> Shown:
        path = self.reach.file(part.file, self.at("file"))
        scene = encode_picture(path, self.shape, part.options(self.device.pitch_m))
        return Shown(scene, picture_words(scene.report))


def picture_words(report: Any) -> str:
    """One line on an encoded picture (`encoders.PictureReport`): file, style, similarity, what was left out."""
    frames = f", {len(report.frames)} frames" if len(report.frames) > 1 else ""
    notes = f" ({'; '.join(report.notes)})" if report.notes else ""
    return f"{report.style}: {Path(report.name).name}{frames}, similarity {report.similarity:.2f}{notes}"


def _still(pattern: TargetPattern, dwell_s: float, words: str) -> Shown:
    shape = GridShape(*pattern.amplitude.shape)
    return Shown(Scene(shape, (Frame(pattern, dwell_s),), {"kind": "texture"}), words)


def joined(parts: Sequence[Shown], shape: GridShape) -> Scene:
    """One scene after another; a single one keeps its encoding, so that a text can be read back."""
    scenes = tuple(part.scene for part in parts)
    encoding: Mapping[str, Any] = {"kind": "sequence", "parts": [dict(scene.encoding) for scene in scenes]}
    return Scene(shape, _Frames(scenes), scenes[0].encoding if len(scenes) == 1 else encoding)


class _Frames:
    """The frames of scenes one after another, pages counted on; encoded again on every reading.

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
