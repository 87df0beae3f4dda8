"""Scenes and jobs to waveforms: plan every frame, write what can be made, say what cannot."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from chainsim import Device, Outcome
from drivers import Encoding, FileError, WrittenWaveform, write_waveform
from encoders import Scene
from planner import DEFAULT_CONTRAST_DB, FramePlan, Plan, plan_scene

from ..errors import AppError
from ..jobs.scene import read_job_scene
from ..progress import progress
from ..reports.scene import SceneReport
from ..reports.totals import PlanStopped, Tally, nearest_lines, peak_volts
from ..request import TOLERANCES
from ..studies.study import Study
from .extent import extent_of, go_on

__all__ = ["Rendering", "render_job", "render_scene"]


@dataclass(frozen=True)
class Rendering:
    """How a scene is carried out.

    Attributes
    ----------
    out : the .wav, None to plan only. study : what is asked beside, and what is seen of the plan; for one scene.
    yes : do not ask before a very large file.
    """

    out: Path | None = None
    encoding: Encoding = "float32"
    contrast_db: float = DEFAULT_CONTRAST_DB
    study: Study = field(default_factory=Study)
    yes: bool = False


def render_job(
    path: Path, out: Path | None = None, study: Study | None = None, *, root: Path | None = None, yes: bool = False
) -> SceneReport:
    """Carry out the job file `path`; `out` is written in place of the job's own output.

    Parameters
    ----------
    study : what is asked beside, before what the job asks for.
    root : the job, and what it names, lie below this folder, or are refused; None for anywhere.
    yes : do not ask before a very large file.

    Raises
    ------
    Declined
        When a person was asked, and said no.
    AppError, ChainError, DriverError, EncodeError, PlanError
        When the job, or what it names, cannot be used.
    """
    began = time.perf_counter()
    found = read_job_scene(path, root=root)
    job = found.job
    study = study or Study()
    study.otherwise(job.tol, job.budget.planning_s if job.budget else None)
    how = Rendering(out or found.out, job.sample_format, job.contrast_db, study, yes)
    try:
        with found.scene() as scene:
            report = render_scene(scene, found.device, how, [part.words for part in found.parts])
    except FileError as error:
        if out is not None:
            raise
        raise AppError(f"{found.located.at('output')}: {error}") from None
    return replace(report, seconds=time.perf_counter() - began)


def render_scene(scene: Scene, device: Device, how: Rendering, parts: Sequence[str]) -> SceneReport:
    """Plan a scene and, with an output, write it; nothing is written when a frame cannot be made as asked.

    Parameters
    ----------
    parts : lines on what is shown, for the report.

    Raises
    ------
    Declined
        When a person was asked whether to write very much, and said no.
    AppError, PlanError, DriverError
        When the scene does not fit the device, or the disk has no room or refuses.
    """
    began = time.perf_counter()
    if how.out is not None:
        go_on(extent_of(scene.frames, device, how.out, how.encoding), how.out, yes=how.yes)
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
