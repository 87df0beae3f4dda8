"""Who judges a plan while it is made: holds frames to a tolerance and a budget, and finds what was asked beside."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from chainsim import Device, Outcome, load_rung
from encoders import TargetPattern
from planner import FramePlan, Plan

from ..errors import AppError
from ..plain import Printable
from ..request import Request

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from planner import FrameSpread, Question, Requirement

    from ..reports.devices import YieldReport

__all__ = ["Findings", "Judge"]

# What the terms that a scene requires are listed to, when nobody says.
USUAL_TOL = 1e-2
# Frames that bring no chain not met before are not looked at again, and no more than so many chains are.
MOST_CHAINS = 64


@dataclass(frozen=True)
class Findings:
    """What was reached, in sentences; whether a tolerance was met; further reports by their names."""

    reached: tuple[str, ...] = ()
    met: bool = True
    beside: dict[str, Printable] = field(default_factory=dict)


class Judge:
    """Judges the frames of one plan as they are made, and finds what was reached.

    Attributes
    ----------
    request : what a person asks for.
    planning_s : seconds that planning has taken, by the clock.
    """

    def __init__(self, request: Request | None = None, clock: Callable[[], float] = time.perf_counter) -> None:
        self.request = request or Request()
        self.planning_s = 0.0
        self._frames: list[FramePlan] = []
        self._last: FramePlan | None = None
        self._chains: set[bytes] = set()
        self._device: Device | None = None
        self._pattern: TargetPattern | None = None
        self._idle = 0.0
        self._spread: FrameSpread | None = None
        self._devices: NDArray[np.bool_] | None = None
        self._clock = clock

    def judged(self, plan: Plan) -> Iterator[FramePlan]:
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
            if self.request.pareto is not None and number == self.request.pareto.number and frame.frame is not None:
                self._pattern = frame.frame.pattern
            self._look(frame)
            yield self._verdict(frame)

    def _look(self, frame: FramePlan) -> None:
        request, spread = self.request, frame.spread
        if spread is not None:
            self._spread = spread
            self._devices = spread.devices if self._devices is None else self._devices & spread.devices
        if request.tol is None and request.budget_s is None and not request.explain:
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

    def _verdict(self, frame: FramePlan) -> FramePlan:
        budget_s = self.request.budget_s
        if budget_s is not None and self.planning_s > budget_s:
            note = f"planning took longer than {budget_s:g} s; give budget.planning_s (--budget) more."
            return replace(frame, outcome=Outcome.OUT_OF_BUDGET, note=note)
        limit = self.request.tol
        if limit is not None and frame.outcome is Outcome.OK and frame.error > limit:
            note = f"off by {100 * frame.error:.3g} % of full scale, {100 * limit:g} % are allowed."
            return replace(frame, outcome=Outcome.UNREACHABLE, note=note)
        return frame

    def findings(self) -> Findings:
        """What was asked beside the plan, of the frames that went by.

        Raises
        ------
        AppError, PlanError
            When the scene has no frame of the number asked for, or the frame cannot be traded.
        """
        request, device = self.request, self._device
        if device is None:
            return Findings()
        held = request.tol is not None or request.budget_s is not None
        reached, met = self._reached(device) if held else ((), True)
        beside: dict[str, Printable] = {}
        if request.explain:
            reached += (*self._standing(device), *self._travelling(device))
            from .tradeoff import ExplainReport

            beside["requirement"] = ExplainReport(self._required(device, request.tol or USUAL_TOL))
        if request.pareto is not None:
            from .tradeoff import pareto_report

            if self._pattern is None:
                raise AppError(f"--pareto: the scene has no frame {request.pareto.number}; count from 1")
            beside["pareto"] = pareto_report(self._pattern, device, request.pareto)
        devices = self._yield()
        if devices is not None:
            beside["yield"] = devices
            met = met and devices.met
        return Findings(reached, met, beside)

    def _standing(self, device: Device) -> Iterator[str]:
        """What a plan of standing dots leaves to the piezos; those that were measured are planned as they are."""
        from planner import standing_error

        frames = [] if device.actuators else [frame for frame in self._frames if frame.frame is not None]
        worst = max((frame.error + standing_error(device, frame.states, frame.end_s) for frame in frames), default=0.0)
        if worst > max((frame.error for frame in frames), default=0.0):
            yield f"As built, standing dots are off by up to {_percent(worst)} (higher modes, creep, hysteresis)."

    def _travelling(self, device: Device) -> Iterator[str]:
        """How fast patterns travel, how fast they could, and how sharp they are on their way."""
        speeds = [1 / (frame.end_s - frame.start_s) for frame in self._frames if frame.frame and frame.frame.travels]
        if not speeds:
            return
        from planner import quickest_travel

        most = quickest_travel(device, contrast_db=self.request.contrast_db)
        ends = " to ".join(dict.fromkeys(f"{speed:.3g}" for speed in (min(speeds), max(speeds))))
        yield (
            f"Patterns travel, {ends} a second; {device.name} can {most:.3g}. A dot is within 0.2 % of its full level "
            "for two fifths of the time, and at half of it in two places in the middle of its way."
        )

    def _yield(self) -> YieldReport | None:
        """On how many devices all frames are felt as wished; None where none has a spread."""
        spread, devices = self._spread, self._devices
        if spread is None or devices is None:
            return None
        from planner import needed_for

        from ..reports.devices import YieldReport

        asked, needed = self.request.yield_ is not None, needed_for(devices, spread.wanted)
        return YieldReport(float(devices[0].mean()), spread.wanted, asked, needed, spread.spread, spread.draws)

    def _required(self, device: Device, tol: float) -> Requirement:
        from chainsim import surroundings_of
        from planner import require

        frames = [frame for frame in self._frames if frame is not self._last]
        last = [] if self._last is None else [self._last]
        return require([*frames, *last], device, surroundings_of(device), tol=tol)

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
        if self.request.tol is not None and self._idle > self.request.tol:
            share = f"{100 * self._idle:.2g} % of full scale"
            lines.append(f"Unraised dots idle at up to {share}, not counted as error; a higher contrast lowers them.")
        if left:
            lines.append(f"The planner's own prediction stands for {left} chains: of several tones, or beyond 64.")
        if self.request.budget_s is not None:
            late = self.planning_s > self.request.budget_s
            kept = "not kept" if late else "kept"
            lines.append(
                f"Budget {seconds_words(self.request.budget_s)} {kept}; by the clock, so another run may differ."
            )
        return tuple(lines), met

    def _predicted(self, question: Question, device: Device) -> tuple[str, bool]:
        from planner import climb, seconds_words

        request = self.request
        left_s = None if request.budget_s is None else max(request.budget_s - self.planning_s, 1e-9)
        began = self._clock()
        if request.tol is not None:
            answer, _ = climb(question, tol=request.tol, clock=self._clock)
        else:
            answer, _ = climb(question, budget_s=left_s, clock=self._clock)
        spent = seconds_words(self._clock() - began)
        reached = float(max(answer.error_estimate))
        good = request.tol is None or reached <= request.tol
        verdict = "" if request.tol is None else f", tolerance {request.tol:g} {'met' if good else 'not met'}"
        words = f"Predicted by {answer.rung} to about {reached:.1e}{verdict}, in {spent}"
        return f"{words}; {self._left(answer.rung, device)}.", good

    def _left(self, rung: str, device: Device) -> str:
        """What a rung leaves out of this scene."""
        terms = self._required(device, self.request.tol or USUAL_TOL).terms
        # The way in, which a plan has, is in no rung.
        modelled = load_rung(rung).models | {"transients"}
        lacking = {term.name: term.effect for term in terms if term.name not in modelled}
        listed = [f"{name} {_size(effect)}" for name, effect in lacking.items() if effect > 0]
        return f"left out of it: {', '.join(listed)}" if listed else "nothing is left out of it"


def _percent(share: float) -> str:
    return f"{100 * share:.2g} % of full scale"


def _size(effect: float) -> str:
    return f"{effect:.0e}" if math.isfinite(effect) and effect < 1 else "over 1"
