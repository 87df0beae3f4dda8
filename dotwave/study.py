"""What is watched while a scene is planned, for what was asked beside the plan: what was reached, and at what price."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from chainsim import Device, Outcome, load_rung
from encoders import TargetPattern
from planner import FramePlan, Plan

from .asked import Asked
from .command import Report
from .errors import AppError

if TYPE_CHECKING:
    from planner import Question, Requirement

__all__ = ["Study", "Told"]

# What the terms that a scene requires are listed to, when nobody says.
USUAL_TOL = 1e-2
# Frames that bring no chain not met before are not looked at again, and no more than so many chains are.
MOST_CHAINS = 64


class Study:
    """Watches the frames of one plan go by, holds them to a tolerance and a budget, and tells what was reached.

    Attributes
    ----------
    asked : what a person asked for. limit : largest error of a frame that is ok, full scale; None for any.
    planning_s : seconds that planning has taken, by the clock.
    """

    def __init__(self, asked: Asked | None = None, clock: Callable[[], float] = time.perf_counter) -> None:
        self.asked = asked or Asked()
        self.limit = self.asked.tol
        self.planning_s = 0.0
        self._frames: list[FramePlan] = []
        self._last: FramePlan | None = None
        self._chains: set[bytes] = set()
        self._device: Device | None = None
        self._pattern: TargetPattern | None = None
        self._idle = 0.0
        self._clock = clock

    def otherwise(self, tol: float, budget_s: float | None) -> None:
        """Take what a job asks for where the command line says nothing."""
        self.asked = replace(self.asked, tol=self.asked.tol or tol, budget_s=self.asked.budget_s or budget_s)
        self.limit = self.asked.tol

    def watched(self, plan: Plan) -> Iterator[FramePlan]:
        """The plan's frames; those that are not exact enough, or late, say so by their outcome."""
        self._device = plan.device
        frames, number = iter(plan.frames), 0
        while True:
            began = self._clock()
            frame = next(frames, None)
            self.planning_s += self._clock() - began
            if frame is None:
                return
            number += 1
            if self.asked.pareto is not None and number == self.asked.pareto.number and frame.frame is not None:
                self._pattern = frame.frame.pattern
            self._look(frame)
            yield self._judged(frame)

    def _look(self, frame: FramePlan) -> None:
        asked = self.asked
        if asked.tol is None and asked.budget_s is None and not asked.explain:
            return
        keys = {state.lam.tobytes() + state.bias.tobytes() + repr(state.epsilon).encode() for state in frame.states}
        # Creep grows to the end, the way out with it.
        self._last = frame
        if keys - self._chains and len(self._chains) < MOST_CHAINS:
            self._chains |= keys
            self._frames.append(frame)
            if frame.frame is not None:
                wanted = np.abs(frame.frame.pattern.amplitude).reshape(len(frame.states), -1)
                held = np.array([state.target for state in frame.states])
                self._idle = max(self._idle, float(held[wanted == 0].max(initial=0.0)))

    def _judged(self, frame: FramePlan) -> FramePlan:
        budget_s = self.asked.budget_s
        if budget_s is not None and self.planning_s > budget_s:
            note = f"planning took longer than {budget_s:g} s; give budget.planning_s (--budget) more."
            return replace(frame, outcome=Outcome.OUT_OF_BUDGET, note=note)
        if self.limit is None or frame.outcome is not Outcome.OK:
            return frame
        error = max(state.error for state in frame.states)
        if error > self.limit:
            note = f"off by {100 * error:.3g} % of full scale, {100 * self.limit:g} % are allowed."
            return replace(frame, outcome=Outcome.UNREACHABLE, note=note)
        return frame

    def told(self, report: Report, ok: bool) -> Told:
        """A report with what was asked beside it.

        Raises
        ------
        AppError, PlanError
            When the scene has no frame of the number asked for, or the frame cannot be traded.
        """
        asked, device = self.asked, self._device
        if device is None:
            return Told(report, ok, (), {})
        reached, met = self._reached(device) if asked.tol is not None or asked.budget_s is not None else ((), True)
        parts: dict[str, Report] = {}
        if asked.explain:
            from .tradeoff_report import ExplainReport

            parts["requirement"] = ExplainReport(self._required(device, asked.tol or USUAL_TOL))
        if asked.pareto is not None:
            from .tradeoff_report import pareto_report

            if self._pattern is None:
                raise AppError(f"--pareto: the scene has no frame {asked.pareto.number}; count from 1")
            parts["pareto"] = pareto_report(self._pattern, device, asked.pareto)
        return Told(report, ok and met, reached, parts)

    def _required(self, device: Device, tol: float) -> Requirement:
        from planner import assumed, require

        frames = [frame for frame in self._frames if frame is not self._last]
        last = [] if self._last is None else [self._last]
        return require([*frames, *last], device, assumed(device), tol=tol)

    def _reached(self, device: Device) -> tuple[tuple[str, ...], bool]:
        from planner import questions_of, seconds_words

        lines = [f"Planned in {seconds_words(self.planning_s)}."]
        questions, left = questions_of(self._frames, device)
        met = True
        if device.actuators:
            lines.append("Its actuators were measured one by one: the planner's own prediction stands.")
            questions, left = [], 0
        for question in questions:
            words, good = self._predicted(question, device)
            lines.append(words)
            met = met and good
        if self.asked.tol is not None and self._idle > self.asked.tol:
            share = f"{100 * self._idle:.2g} % of full scale"
            lines.append(f"Unraised dots idle at up to {share}, not counted as error; a higher contrast lowers them.")
        if left:
            lines.append(f"The planner's own prediction stands for {left} chains: of several tones, or beyond 64.")
        if self.asked.budget_s is not None:
            late = self.planning_s > self.asked.budget_s
            kept = "not kept" if late else "kept"
            lines.append(
                f"Budget {seconds_words(self.asked.budget_s)} {kept}; by the clock, so another run may differ."
            )
        return tuple(lines), met

    def _predicted(self, question: Question, device: Device) -> tuple[str, bool]:
        from planner import climb, seconds_words

        asked = self.asked
        left_s = None if asked.budget_s is None else max(asked.budget_s - self.planning_s, 1e-9)
        began = self._clock()
        if asked.tol is not None:
            answer, _ = climb(question, tol=asked.tol, clock=self._clock)
        else:
            answer, _ = climb(question, budget_s=left_s, clock=self._clock)
        spent = seconds_words(self._clock() - began)
        reached = float(max(answer.error_estimate))
        good = asked.tol is None or reached <= asked.tol
        verdict = "" if asked.tol is None else f", tolerance {asked.tol:g} {'met' if good else 'not met'}"
        words = f"Predicted by {answer.rung} to about {reached:.1e}{verdict}, in {spent}"
        return f"{words}; {self._left(answer.rung, device)}.", good

    def _left(self, rung: str, device: Device) -> str:
        """What a rung leaves out of this scene."""
        terms = self._required(device, self.asked.tol or USUAL_TOL).terms
        # The way in, which a plan has, is in no rung.
        modelled = load_rung(rung).models | {"transients"}
        lacking = {term.name: term.effect for term in terms if term.name not in modelled}
        listed = [f"{name} {_size(effect)}" for name, effect in lacking.items() if effect > 0]
        return f"left out of it: {', '.join(listed)}" if listed else "nothing is left out of it"


def _size(effect: float) -> str:
    return f"{effect:.0e}" if math.isfinite(effect) and effect < 1 else "over 1"


@dataclass(frozen=True)
class Told:
    """A report, and what was asked beside it.

    Attributes
    ----------
    ok : the report's, and whether the tolerance was met. reached : sentences. parts : further reports by their names.
    """

    report: Report
    ok: bool
    reached: tuple[str, ...]
    parts: dict[str, Report]

    def as_dict(self) -> dict[str, Any]:
        """Plain JSON types: the report's keys, then `reached` and the further reports where they were asked for."""
        found = self.report.as_dict() | {"ok": self.ok}
        if self.reached:
            found["reached"] = list(self.reached)
        return found | {name: part.as_dict() for name, part in self.parts.items()}

    def as_text(self) -> str:
        """The report's lines, then the sentences, then the further reports."""
        return "\n".join([self.report.as_text(), *self.reached, *(part.as_text() for part in self.parts.values())])
