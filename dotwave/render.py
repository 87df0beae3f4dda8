"""Scenes and job files to waveforms: plan every frame, write what can be made, say what cannot."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from chainsim import Device, Outcome
from drivers import Encoding, WrittenWaveform, write_waveform
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
from planner import DEFAULT_CONTRAST_DB, FramePlan, Plan, plan_scene

from .asked import TOLERANCES
from .errors import AppError
from .job import Item, Job, PicturePart, TextPart, read_job
from .progress import progress
from .scene_report import SceneReport
from .study import Study
from .tally import PlanStopped, Tally, nearest_lines, peak_volts

__all__ = ["Rendering", "Shown", "joined", "picture_words", "render_job", "render_scene"]


@dataclass(frozen=True)
class Shown:
    """One part of a sequence: its scene, and a line that says what it is."""

    scene: Scene
    words: str


@dataclass(frozen=True)
class Rendering:
    """How a scene is carried out.

    Attributes
    ----------
    out : the .wav, None to plan only. study : what is asked beside, and what is seen of the plan; for one scene.
    """

    out: Path | None = None
    encoding: Encoding = "float32"
    contrast_db: float = DEFAULT_CONTRAST_DB
    study: Study = field(default_factory=Study)


def render_job(path: Path, out: Path | None = None, study: Study | None = None) -> SceneReport:
    """Carry out the job file `path`; `out` is written in place of the job's own output.

    `study` : what is asked beside, before what the job asks for.

    Raises
    ------
    AppError, ChainError, DriverError, EncodeError, PlanError
        When the job, or what it names, cannot be used.
    """
    began = time.perf_counter()
    job, folder = read_job(path), path.parent
    try:
        device = job.device.device(folder)
    except ValueError as error:
        raise AppError(f"{path}: device: {error}") from None
    shape = GridShape(device.rows, device.cols)
    parts = []
    for number, item in enumerate(job.sequence):
        try:
            parts.append(_shown(item, job, device, shape, folder))
        except EncodeError as error:
            raise AppError(f"{path}: sequence.{number}: {error}") from None
    if out is None and job.output is not None:
        out = Path(os.path.normpath(folder / job.output))
    study = study or Study()
    study.otherwise(job.tol, job.budget.planning_s if job.budget else None)
    how = Rendering(out, job.sample_format, job.contrast_db, study)
    report = render_scene(joined(parts, shape), device, how, [part.words for part in parts])
    return replace(report, seconds=time.perf_counter() - began)


def _shown(item: Item, job: Job, device: Device, shape: GridShape, folder: Path) -> Shown:
    if item.text is not None:
        return _text(item.text, job, shape, folder)
    if item.image is not None:
        return _picture(item.image, device, shape, folder)
    if item.icon is not None:
        chosen = item.icon if item.icon.style is not Style.AUTO else item.icon.model_copy(update={"style": Style.ICON})
        return _picture(chosen, device, shape, folder)
    if item.texture is not None:
        kind = next(name for name, value in item.texture if value is not None)
        return _still(item.texture.target(shape), item.texture.dwell_s, f"texture: {kind}")
    assert item.pause_s is not None
    blank = np.zeros((shape.rows, shape.cols), np.complex128)
    blank.flags.writeable = False
    return _still(TargetPattern(blank), item.pause_s, f"pause of {item.pause_s:g} s")


def _text(part: TextPart, job: Job, shape: GridShape, folder: Path) -> Shown:
    given = part.model_dump(exclude={"say", "file"})
    given["presentation"] = part.presentation or job.presentation
    source = TextSource.of_path(folder / part.file) if part.file is not None else TextSource.of_text(part.say or "")
    words = source.text if len(source.text) <= 40 else source.text[:37] + "..."
    return Shown(encode_text(source, shape, TextOptions(**given)), f"text: {words}")


def _picture(part: PicturePart, device: Device, shape: GridShape, folder: Path) -> Shown:
    scene = encode_picture(folder / part.file, shape, part.options(device.pitch_m))
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
    """One scene after another; a single one stays what it is, so that a text can be read back."""
    if len(parts) == 1:
        return parts[0].scene
    encoding: Mapping[str, Any] = {"kind": "sequence", "parts": [dict(part.scene.encoding) for part in parts]}
    return Scene(shape, _Frames(tuple(part.scene for part in parts)), encoding)


@dataclass(frozen=True)
class _Frames:
    """The frames of scenes one after another, pages counted on; encoded again on every reading."""

    scenes: tuple[Scene, ...]

    def __iter__(self) -> Iterator[Frame]:
        first = 0
        for scene in self.scenes:
            page = -1
            for frame in scene.frames:
                page = max(page, frame.page)
                yield replace(frame, page=first + frame.page)
            first += page + 1


def render_scene(scene: Scene, device: Device, how: Rendering, parts: Sequence[str]) -> SceneReport:
    """Plan a scene and, with an output, write it; nothing is written when a frame cannot be made as asked.

    Parameters
    ----------
    parts : lines on what is shown, for the report.

    Raises
    ------
    PlanError, DriverError
        When the scene does not fit the device, or the disk refuses.
    """
    began = time.perf_counter()
    how.study.limit = how.study.limit or TOLERANCES["normal"]
    watch = _Watch(plan_scene(scene, device, contrast_db=how.contrast_db), how)
    written: WrittenWaveform | None = None
    with progress("rendering") as update:
        try:
            if how.out is None:
                for frame in watch:
                    update(frame.end_s)
            else:
                plan = replace(watch.plan, frames=watch)
                written = write_waveform(plan, how.out, encoding=how.encoding, progress=update)
        except PlanStopped:
            pass
    return SceneReport(
        device=device.name,
        parts=tuple(parts),
        frames=sum(watch.outcomes.values()),
        duration_s=watch.tally.duration_s,
        files=(str(written.samples_path), str(written.manifest_path)) if written else (),
        peak_volts=peak_volts(written, watch.tally, device),
        limit_volts=device.amplifier.volts,
        ramp_s=watch.tally.ramp_s,
        error=watch.tally.error,
        slew=watch.tally.slew,
        multiplier=watch.tally.multiplier,
        spread=watch.tally.spread,
        tolerance=how.study.limit,
        outcomes=watch.outcomes,
        notes=(*watch.paces(), *watch.notes),
        seconds=time.perf_counter() - began,
    )


@dataclass
class _Watch:
    """The plan's frames passed through, and what is to be said of them."""

    plan: Plan
    how: Rendering
    outcomes: dict[str, int] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    walks: dict[str, int] = field(default_factory=dict)
    tally: Tally = field(default_factory=Tally)

    def __iter__(self) -> Iterator[FramePlan]:
        for number, frame in enumerate(self.how.study.watched(self.plan), 1):
            if frame.frame is not None or frame.outcome is not Outcome.OK:
                self.outcomes[frame.outcome] = self.outcomes.get(frame.outcome, 0) + 1
            self.tally.add(frame)
            if frame.outcome is not Outcome.OK:
                self._failed(number, frame)
            elif any(state.tones for state in frame.states):
                self.walks.setdefault(self._pace(frame), number)
            yield frame

    def paces(self) -> Iterator[str]:
        """A line for every pace, with the first frame that has it."""
        for pace, number in self.walks.items():
            yield f"Frame {number}: {pace} bars a second walk past an actuator."

    def _pace(self, frame: FramePlan) -> str:
        """The slowest and the quickest walk of a frame, bars a second."""
        from planner import walking_rate_hz

        rates = sorted(walking_rate_hz(self.plan.device, state) for state in frame.states if state.tones)
        ends = [f"{rates[0]:.3g}", f"{rates[-1]:.3g}"]
        return " to ".join(dict.fromkeys(ends))

    def _failed(self, number: int, frame: FramePlan) -> None:
        if not self.notes:
            self.notes.append(f"Frame {number}: {frame.note}")
            if frame.outcome is not Outcome.OUT_OF_BUDGET:
                self.notes += nearest_lines(frame, self.plan.device)
            if self.how.out is not None:
                self.notes.append("Nothing was written.")
        if self.how.out is not None or frame.outcome is Outcome.OUT_OF_BUDGET:
            raise PlanStopped
