"""The one way from a scene to what is written and said: plan every frame, write what can be made, say what cannot."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from chainsim import Device, Outcome
from drivers import FORMATS, WrittenPlan, check_suffix, write_plan
from encoders import Scene, TextScene
from planner import FramePlan, Plan, plan_scene

from ..progress import progress
from ..reports.report import Report
from ..reports.text import TextReport
from ..reports.totals import Totals, nearest_lines
from ..request import Request
from ..scenes import placed
from ..studies.judge import Judge
from .extent import extent_of, go_on
from .text_findings import text_findings

__all__ = ["render"]


class _Stopped(Exception):
    """A frame cannot be made as asked and there is nothing to write, or no time is left."""


def render(scene: Scene, device: Device, out: Path | None = None, request: Request | None = None) -> Report:
    """Plan `scene` on `device` and, with `out`, write it.

    Nothing is written when a frame cannot be made as asked: the report then says what is lacking and what the nearest
    pattern is.

    Parameters
    ----------
    out : samples or a haptic file, as its ending says (`drivers.FORMATS`); None to plan only.

    Raises
    ------
    Declined
        When a person was asked whether to write very much, and said no.
    AppError, DriverError, EncodeError, PlanError
        When the scene does not fit the device, or the disk has no room or refuses.
    """
    began = time.perf_counter()
    request = request or Request()
    shown: tuple[str, ...] = ()
    if request.yield_ is not None:
        from .presenting import presented

        scene, shown = presented(scene, device, request)
    plan = plan_scene(scene, device, contrast_db=request.contrast_db, yield_=request.yield_)
    if out is not None and FORMATS[check_suffix(out)].sample_bytes:
        go_on(extent_of(scene.frames, device, out, request.encoding), out, yes=request.yes)
    passage = _Passage(plan, Judge(request), writes=out is not None)
    with placed(scene):
        written = _carried_out(passage, out, request)
    report = _report(scene, passage, written, request, shown)
    found = passage.judge.findings()
    seconds = time.perf_counter() - began
    return replace(report, reached=found.reached, met=found.met, beside=found.beside, seconds=seconds)


def _carried_out(passage: _Passage, out: Path | None, request: Request) -> WrittenPlan | None:
    """Draw all frames; what was written, None where nothing was to be or a frame cannot be made."""
    with progress("rendering") as update:
        try:
            if out is not None:
                plan = replace(passage.plan, frames=passage)
                return write_plan(plan, out, encoding=request.encoding, actuator=request.actuator, progress=update)
            for frame in passage:
                update(frame.end_s)
        except _Stopped:
            pass
    return None


@dataclass
class _Passage:
    """The plan's frames passed through, judged, and what is to be said of them."""

    plan: Plan
    judge: Judge
    writes: bool
    totals: Totals = field(default_factory=Totals)
    moves: dict[str, int] = field(default_factory=dict)
    modulated: bool = False
    failure: str = ""
    lacking: tuple[str, ...] = ()

    def __iter__(self) -> Iterator[FramePlan]:
        for number, frame in enumerate(self.judge.judged(self.plan), 1):
            self.totals.add(frame)
            if frame.outcome is not Outcome.OK:
                self._failed(number, frame)
            elif any(state.walks for state in frame.states):
                self.moves.setdefault(f"{self._pace(frame)} bars a second walk past an actuator", number)
            else:
                beats = dict.fromkeys(state.beats for state in frame.states if state.beats is not None)
                for depth, period_s in beats:
                    self.moves.setdefault(
                        f"it never settles, and beats {depth:.2g} deep every {period_s:.3g} s", number
                    )
            self.modulated |= any(state.modulated for state in frame.states)
            yield frame

    def notes(self) -> Iterator[str]:
        """A line for every way to move on, with its first frame; then what is lacking for the first that failed."""
        for move, number in self.moves.items():
            yield f"Frame {number}: {move}."
        if self.modulated:
            from ..reports.modulated import modulation_words

            yield f"Felt as carriers swell: {modulation_words(self.plan.device)}."
        yield from filter(None, (self.failure, *self.lacking))

    def _pace(self, frame: FramePlan) -> str:
        """The slowest and the quickest walk of a frame, bars a second."""
        from planner import walking_rate_hz

        rates = sorted(walking_rate_hz(self.plan.device, state) for state in frame.states if state.walks)
        ends = [f"{rates[0]:.3g}", f"{rates[-1]:.3g}"]
        return " to ".join(dict.fromkeys(ends))

    def _failed(self, number: int, frame: FramePlan) -> None:
        late = frame.outcome is Outcome.OUT_OF_BUDGET
        if not self.failure:
            nearest = () if late else nearest_lines(frame, self.plan.device)
            end = ("Nothing was written.",) if self.writes else ()
            self.failure, self.lacking = f"Frame {number}: {frame.note}", (*nearest, *end)
        if self.writes or late:
            raise _Stopped


def _report(
    scene: Scene, passage: _Passage, written: WrittenPlan | None, request: Request, shown: tuple[str, ...]
) -> Report:
    device, totals = passage.plan.device, passage.totals
    peak = totals.volts * device.amplifier.volts
    left_out = (written.left_out,) if written is not None and written.left_out else ()
    said: dict[str, Any] = totals.of_report() | {
        "device": device.name,
        "files": () if written is None else tuple(map(str, written.files)),
        "peak_volts": peak if written is None or written.peak_volts is None else written.peak_volts,
        "limit_volts": device.amplifier.volts,
        "failure": passage.failure,
    }
    if isinstance(scene, TextScene):
        found = text_findings(scene)
        notes = (*found.notes, *shown, *passage.notes(), *left_out)
        return TextReport(
            tables=tuple(scene.encoding["tables"]), text=scene.text_frames.source.text[:200], pages=totals.pages,
            undefined=found.undefined, split=found.split, differences=found.differences, notes=notes, **said,
        )  # fmt: skip
    # Imported here: a text does without.
    from ..reports.scene import SceneReport

    return SceneReport(parts=scene.parts, tolerance=request.tol, notes=(*passage.notes(), *left_out), **said)
