"""The search for the shortest way: on the slow flow from long to short, then corrected under the full equations."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from chainsim import Chain

from ..operating_point import OperatingPoint
from .check import Orbit, Passage, Way, travel
from .gauss_newton import Steered, slopes_at, steer
from .hermite import broken_line
from .limits import WayLimits
from .steering import LinkCourse, Steering

__all__ = ["ARRIVES", "MOST_PERIODS", "STANDS", "STRONG", "RampSearch"]

Floats = NDArray[np.float64]

# Relative deviation of an actuator at and after the end of a way that still counts as standing; a way may use half of
# it, the rest is for what plays it.
STANDS = 1e-3
# Phases of the carrier at which that is seen to, with the worst among them or beside one.
PHASES = (0.0, math.pi / 4, math.pi / 2, 3 * math.pi / 4)
# The full equations are made to arrive this well, so that what later stages magnify stays far below `STANDS`.
ARRIVES, CORRECTIONS = 1e-6, 8
# Longest time after a way that is looked at.
MOST_PERIODS = 4000
# A way is shortened only while no actuator goes farther than on an easy way by more than this: what overshoots and has
# to be cancelled magnifies every error of drive and device as much.
OVERSHOOT = 1.5
SHORTER = 0.9
# What is found in the first length but does not stand is made so many times longer.
LONGER = (1.25, 1.5, 1.75, 2.0, 2.5, 3.0)
# Radians of the carrier in an interval of the drive's splines; in less, the drive would not be slow.
SHORTEST_INTERVAL = 8.0
# Links need not be stronger than this on the way, where the slow flow is still slow.
STRONG = 0.1
# Part of the way in which the links come down; lengths tried first, in times that a stage takes to pass energy on.
COMING_DOWN = 0.25
STAGE_TIMES, LENGTHS = 1.5, (1.0, 0.75, 1.4, 2.0)
# Nodes of the drive in one interval of its splines, and seconds in a straight piece of the links' course: what is left
# of the corners turns with the carrier's phase and is magnified by the stages.
NODES_PER_INTERVAL, PIECE_S = 8, 1.5e-3
# The end is met on the slow flow; steps of Gauss and Newton for one length.
MET, STEPS = 1e-4, 10
# Smallest advance in softness on the way from a linear chain to the real one, and how it grows and shrinks.
LEAST_ADVANCE, FASTER, SLOWER = 0.05, 1.5, 4.0


@dataclass
class RampSearch:
    """Lengths tried one after another; `spent` slopes so far, `lacking` what stopped the last one.

    A way is gone from `start` to `held`, one of which may be rest. `orbit` is the motion it all begins with in the full
    equations, None for rest, and `ahead` the way gone from there to `start`, None where that is the orbit.
    """

    chain: Chain
    start: OperatingPoint
    held: OperatingPoint
    omega: float
    limits: WayLimits
    tau_per_s: float
    budget: int
    orbit: Orbit | None = None
    ahead: Way | None = None
    spent: int = 0
    lacking: str = ""
    links: LinkCourse = field(init=False)

    def __post_init__(self) -> None:
        strongest = max(float(end.lam.max(initial=0.0)) for end in (self.start, self.held))
        top = max(min(self.limits.lam_max, STRONG), strongest)
        self.links = LinkCourse(None if self.limits.lam_scope == "fixed" else top, COMING_DOWN)

    @property
    def first_length(self) -> float:
        """A length in tau that is easy for chains of any number and coupling."""
        standing = self.start if self.held.resting else self.held
        top = self.links.top or float(standing.lam.min(initial=math.inf))
        rate = max(min(top, STRONG), self.chain.delta)
        return STAGE_TIMES * (self.chain.n + 1) * 2 * self.omega / rate

    def task(self, duration: float) -> Steering:
        """The task for one length."""
        return Steering(self.chain, self.omega, self.start, self.held, self.links, duration)

    def shorter_and_shorter(self) -> list[tuple[Steering, Floats]]:
        """Ways on the slow flow within all limits, from an easy length to the shortest."""
        found: list[tuple[Steering, Floats]] = []
        for share in LENGTHS:
            task = self.task(share * self.first_length)
            unknowns = self.from_nothing(task)
            if unknowns is not None and self.allowed(task, unknowns, math.inf):
                found.append((task, unknowns))
                break
        calm = OVERSHOOT * max([self._peak(*first) for first in found], default=0.0)
        while found:
            task = self.task(found[-1][0].duration * SHORTER)
            if task.duration * self.omega < SHORTEST_INTERVAL * task.intervals:
                break
            steered = self.steer(task, found[-1][1], 1.0)
            if steered.missed > MET or not self.allowed(task, steered.unknowns, calm):
                break
            found.append((task, steered.unknowns))
        return found

    def longer_and_longer(self, shortest: Steering) -> Iterator[tuple[Steering, Floats]]:
        """Ways on the slow flow within all limits, longer than the first found."""
        for stretch in LONGER:
            task = self.task(stretch * shortest.duration)
            unknowns = self.from_nothing(task)
            if unknowns is not None and self.allowed(task, unknowns, math.inf):
                yield task, unknowns

    def _peak(self, task: Steering, unknowns: Floats) -> float:
        """Largest amplitude on the way, on the slow flow."""
        return float(np.abs(task.follow(unknowns[None, :], 1.0)).max())

    def steer(self, task: Steering, unknowns: Floats, softness: float) -> Steered:
        """Steps from `unknowns`, within the budget."""
        steered = steer(task, unknowns, softness, min(STEPS, self.budget - self.spent))
        self.spent += steered.slopes
        return steered

    def from_nothing(self, task: Steering) -> Floats | None:
        """From the linear chain, in one step or by and by, to the real one."""
        steered = self.steer(task, np.zeros(task.size), 0.0)
        softness, advance, drift = 0.0, 1.0, np.zeros(task.size)
        while steered.missed <= MET and softness < 1 and advance >= LEAST_ADVANCE:
            goal = min(1.0, softness + advance)
            further = self.steer(task, steered.unknowns + (goal - softness) * drift, goal)
            if further.missed <= MET:
                drift = (further.unknowns - steered.unknowns) / (goal - softness)
                steered, softness, advance = further, goal, FASTER * advance
            else:
                advance /= SLOWER
        return steered.unknowns if softness == 1 else None

    def allowed(self, task: Steering, unknowns: Floats, most: float) -> bool:
        """Whether a way stays within the drive's limits, the well and the amplitude `most`."""
        peak = self._peak(task, unknowns)
        self.lacking = self.limits.exceeded(self.way(task, unknowns), self.omega, self.tau_per_s)
        if not peak <= self.limits.hilltop(self.chain):
            self.lacking = f"it passes through an amplitude of {peak:.3g}, too near the edge of the well; it lacks time"
        return not self.lacking and peak <= most

    def way(self, task: Steering, unknowns: Floats) -> Way:
        """The nodes of a ramp."""
        x = np.linspace(0.0, 1.0, NODES_PER_INTERVAL * task.intervals + 1)
        epsilon, slope = task.drive(x, unknowns[None, :])
        links, links_slope = task.links.at(x, self.start, self.held)
        pieces = max(8, math.ceil(task.duration / self.tau_per_s / PIECE_S))
        lam = broken_line(links[None], links_slope[None], pieces)[0] if links.size else np.empty((pieces + 1, 0))
        # The nearest broken line passes its curve a little where that bends.
        lam = np.clip(lam, min(self.limits.lam_min, links.min(initial=0.0)), links.max(initial=0.0))
        tau = x * task.duration
        if self.held.resting and self.links.top is not None:
            # At rest strong links would only magnify what is left.
            lam[-1] = self.held.lam
        lam_tau = np.linspace(0.0, task.duration, pieces + 1)
        way = Way(tau, epsilon[:, 0], slope[:, 0] / task.duration, lam_tau, lam)
        return way if self.ahead is None else self.ahead.then(way)

    def arriving(self, task: Steering, unknowns: Floats) -> Way | None:
        """The way corrected until the full equations arrive, or None where they do not arrive or do not stay."""
        slopes = slopes_at(task, unknowns, 1.0)
        self.spent += 1
        for _ in range(CORRECTIONS):
            way = self.way(task, unknowns)
            # What is not slow turns twice with the carrier: half of it is left at the worst phase.
            ends = self._travel(way, 1, (0.0, math.pi / 2)).felt[:, 0]
            missed = (ends.mean(axis=0) - self.held.phasor) / task.amplitude
            if not np.abs(missed).max() > ARRIVES:
                break
            unknowns = unknowns + slopes.least_step(np.concatenate([missed.real, missed.imag]))
        way = self.way(task, unknowns)
        passage = self._travel(way, self._time_after, PHASES)
        away = np.abs(passage.felt - self.held.phasor).max(axis=(0, 1))
        standing = self.orbit.harmonics[0] if self.orbit is not None and self.held.resting else self.held.phasor
        # The settled motion may be off by half of it, the samples by a little.
        allowed = 0.4 * STANDS * np.abs(standing)
        self.lacking = self.limits.exceeded(way, self.omega, self.tau_per_s)
        if not passage.peak <= self.limits.hilltop(self.chain):
            self.lacking = f"it passes through {passage.peak:.3g}, too near the edge of the well; it lacks time"
        if not np.all(away <= allowed):
            self.lacking = "what is found on the slow flow does not stand in the full equations; it lacks time"
        return None if self.lacking else way

    def _travel(self, way: Way, periods: int, phases: Sequence[float]) -> Passage:
        return travel(self.chain, self.omega, way, self.orbit, periods, phases)

    @property
    def _time_after(self) -> int:
        """Periods in which a disturbance of the first actuator has come through all of them."""
        efold = 2 / max(self.chain.delta, 1e-9)
        return min(MOST_PERIODS, math.ceil(self.chain.n * efold * self.omega / (2 * math.pi)))
