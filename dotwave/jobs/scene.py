"""A job as a scene: its device, and what its items show, one after another."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

import numpy as np

from chainsim import Device, Located, load_device
from encoders import EncodeError, GridShape, ImageChoice, Scene, Style, TargetPattern, TextOptions, TextSource
from planner import PlanError

from ..documents import illustrated_scene
from ..errors import AppError
from ..pictures import picture_scene
from ..request import Request
from ..scenes import DeviceScene, SceneFrames, joined, shape_of, still_scene, text_scene
from .job import Item, Job, PicturePart, TextPart, locate_job
from .paths import Reach

__all__ = ["JobScene", "read_job_scene"]


@dataclass(frozen=True, repr=False)
class JobScene(DeviceScene):
    """A job that was read and encoded: all its parts as one scene.

    Attributes
    ----------
    located : the job, with its lines.
    out : the file it names to write.
    """

    located: Located[Job] = field(kw_only=True)
    out: Path | None = None

    @property
    def job(self) -> Job:
        """As it stands in the file."""
        return self.located.model

    def request(self, given: Request) -> Request:
        """What is asked of its run: what is given, and what the job says where nothing is."""
        job = self.job
        return replace(
            given,
            tol=given.tol or job.tol,
            budget_s=given.budget_s or (job.budget.planning_s if job.budget else None),
            contrast_db=given.contrast_db or job.contrast_db,
            yield_=given.yield_ or job.yield_,
            encoding=job.sample_format,
        )

    def placed(self, error: PlanError) -> Exception:
        """What the planner refused, with the line of the item that it was about."""
        assert isinstance(self.frames, SceneFrames)
        number = self.frames.number
        if number < 0:
            return error
        return AppError(f"{self.located.at('sequence', number, self.job.sequence[number].kind)}: {error}")


def read_job_scene(path: Path, *, root: Path | None = None, device: Device | None = None) -> JobScene:
    """Read a job and encode its sequence.

    Parameters
    ----------
    root : nothing outside of this folder is read, or named as output; None for any.
    device : in place of the job's.

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
    scenes = []
    for number, item in enumerate(job.sequence):
        at = partial(located.at, "sequence", number, item.kind)
        try:
            scenes.append(_Item(item, job, device, reach, at).scene())
        except EncodeError as error:
            raise AppError(f"{at()}: {error}") from None
    whole = joined(scenes, shape_of(device))
    return JobScene(whole.shape, whole.frames, whole.encoding, whole.parts, located=located, device=device, out=out)


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
        return shape_of(self.device)

    def scene(self) -> Scene:
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
            if item.texture.scroll is not None:
                self.reach.table(item.texture.scroll.table, self.at("scroll", "table"))
            return item.texture.scene(self.shape)
        assert item.pause_s is not None
        blank = np.zeros((self.shape.rows, self.shape.cols), np.complex128)
        blank.flags.writeable = False
        return still_scene(TargetPattern(blank), item.pause_s, f"pause of {item.pause_s:g} s")

    def _text(self, part: TextPart) -> Scene:
        given = part.model_dump(exclude={"say", "file"})
        given["presentation"] = part.presentation or self.job.presentation
        self.reach.table(part.table, self.at("table"))
        if part.file is not None:
            path = self.reach.file(part.file, self.at("file"))
            source = TextSource.of_path(path, encoding=part.encoding, math=part.math)
        else:
            source = TextSource.of_text(part.say or "")
        options = TextOptions(**given)
        if options.images is ImageChoice.PICTURE:
            return illustrated_scene(source, self.device, options)
        return text_scene(source, self.shape, options)

    def _picture(self, part: PicturePart) -> Scene:
        path = self.reach.file(part.file, self.at("file"))
        return picture_scene(path, self.shape, part.options(self.device.pitch_m))
