"""The task of steering a chain from rest or one motion to another or to rest, in a given time, on the slow flow.

The drive is a smooth step from the one steady drive to the other plus quintic B-splines that leave both ends alone; the
links follow a course chosen beforehand. The splines' coefficients are the unknowns.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from chainsim import Chain

from ..drive import closed, smooth_step
from ..operating_point import OperatingPoint
from .slow_flow import DriveCourse, follow_course

__all__ = ["LinkCourse", "Steering", "rest"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

# Complex coefficients of a drive for every actuator, each of which makes one complex condition.
PER_ACTUATOR = 13 / 6
# Intervals under one spline, and the weights of its shifted powers.
SUPPORT, BINOMIAL = 6, np.array([1.0, -6.0, 15.0, -20.0, 15.0, -6.0, 1.0])
# Phase of the fastest slow rate in one step: Runge and Kutta then err by 1e-5 of the amplitude on a way.
STEP = 0.25
# Weights of movement on the way, seen at about so many instants, against 1 for the steady amplitude, and of a
# coefficient against the steady drive.
MOVEMENT, LOOKS, EFFORT = 0.02, 40, 1e-4


def rest(lam: Floats, omega: float) -> OperatingPoint:
    """Rest, with links of which only the number matters where they may move."""
    return OperatingPoint(0j, lam, omega, np.zeros(len(lam) + 1, dtype=np.complex128))


@dataclass(frozen=True)
class LinkCourse:
    """Links that go to `top` in the first `share` of the way and leave it in the last; at rest they are there at once.

    `top` is None where they may not move: they are those of the motions throughout.
    """

    top: float | None
    share: float

    def at(self, x: Floats, start: OperatingPoint, held: OperatingPoint) -> tuple[Floats, Floats]:
        """Links and their derivatives in x at x in [0, 1]; each float64, shape (len(x), n-1)."""
        if self.top is None:
            still = np.repeat((start if held.resting else held).lam[None, :], len(x), axis=0)
            return still, np.zeros_like(still)
        value, slope = np.full((len(x), len(held.lam)), self.top), np.zeros((len(x), len(held.lam)))
        for end, place, way in ((start, x / self.share, -1.0), (held, (x - 1) / self.share + 1, 1.0)):
            if not end.resting:
                step, rise, _ = smooth_step(place)
                share = step if way > 0 else 1 - step
                value += (end.lam - self.top) * share[:, None]
                slope += (end.lam - self.top) * way * rise[:, None] / self.share
        return value, slope


def splines(x: Floats, intervals: int) -> tuple[Floats, Floats]:
    """Quintic B-splines on equal intervals of [0, 1] that vanish with four derivatives at both ends, and derivatives.

    An interval is about two periods of the carrier. Cubic ones would have enough of the frequency 2 omega in them to
    turn what is felt with the carrier's phase by several thousandths.

    Returns
    -------
    float64, shape (len(x), intervals - SUPPORT + 1), each.
    """
    away = x[:, None, None] * intervals - np.arange(intervals - SUPPORT + 1)[:, None] - np.arange(SUPPORT + 1)
    late = np.maximum(away, 0.0)
    value: Floats = late**5 @ BINOMIAL / 120
    slope: Floats = intervals / 24 * (late**4 @ BINOMIAL)
    return value, slope


@dataclass(frozen=True)
class Steering:
    """The task: `chain` at `omega` from `start` to `held` in `duration` (tau) with the links on `links`.

    A start at another frequency than `omega` turns in the frame of the way.
    """

    chain: Chain
    omega: float
    start: OperatingPoint
    held: OperatingPoint
    links: LinkCourse
    duration: float

    @property
    def intervals(self) -> int:
        """Spline intervals of the drive."""
        return SUPPORT - 1 + max(6, math.ceil(self.chain.n * PER_ACTUATOR))

    @property
    def size(self) -> int:
        """Unknowns: real and imaginary part of every coefficient."""
        return 2 * (self.intervals - SUPPORT + 1)

    @cached_property
    def amplitude(self) -> float:
        """What motions are measured in: the largest amplitude at the ends."""
        return float(np.abs([self.start.phasor, self.held.phasor]).max())

    @cached_property
    def unit(self) -> float:
        """What drives are measured in: the larger steady one, or what would hold one actuator at resonance."""
        steady = max(abs(self.start.epsilon), abs(self.held.epsilon))
        return steady or self.chain.delta * self.omega * self.amplitude

    @property
    def steps(self) -> int:
        """Integration steps."""
        strongest = max(float(end.lam.max(initial=0.0)) for end in (self.start, self.held))
        top = max(strongest, self.links.top or 0.0)
        bend = 0.75 * abs(self.chain.beta) * (2 * self.amplitude) ** 2
        rate = (abs(1 - self.omega**2) + self.chain.delta + top + bend) / (2 * self.omega)
        return max(4 * self.intervals, math.ceil(self.duration * rate / STEP))

    def drive(self, x: Floats, unknowns: Floats) -> tuple[Complexes, Complexes]:
        """Drive envelopes of unknowns of shape (P, size) and their derivatives in x; complex128, (len(x), P) each."""
        half = self.size // 2
        factors = self.unit * (unknowns[:, :half] + 1j * unknowns[:, half:]).T
        value, slope = splines(x, self.intervals)
        step, step_slope, _ = smooth_step(x)
        last, angle = self.held.epsilon, 1j * (self.start.omega - self.omega) * self.duration
        first = self.start.epsilon * np.exp(angle * x)
        steady, steady_slope = first + (last - first) * step, (last - first) * step_slope + angle * first * (1 - step)
        return np.asarray(steady[:, None] + value @ factors), np.asarray(steady_slope[:, None] + slope @ factors)

    def follow(self, unknowns: Floats, softness: float) -> Complexes:
        """Amplitudes on the way for unknowns of shape (P, size); complex128, shape (steps + 1, n, P)."""
        x = np.linspace(0.0, 1.0, 2 * self.steps + 1)
        epsilon, epsilon_slope = self.drive(x, unknowns)
        lam, lam_slope = (closed(self.chain, links) for links in self.links.at(x, self.start, self.held))
        course = DriveCourse(epsilon, epsilon_slope / self.duration, lam, lam_slope / self.duration, self._lent(x))
        with np.errstate(all="ignore"):
            return follow_course(self.chain, self.omega, self.duration, course, self.start.phasor, softness)

    def _lent(self, x: Floats) -> Floats:
        """Squares of amplitudes between those of the ends; rest has none to lend."""
        ends = [self.held if one.resting else one for one in (self.start, self.held)]
        first, last = (np.abs((self.start if one.resting else one).phasor) ** 2 for one in ends)
        return np.asarray(first + (last - first) * smooth_step(x).value[:, None])

    def misses(self, unknowns: Floats, softness: float) -> tuple[Floats, Floats]:
        """By how much the end is missed, shape (P, 2 n), and movement and effort, shape (P, S)."""
        trace = self.follow(unknowns, softness) / self.amplitude
        end = trace[-1] - self.held.phasor[:, None] / self.amplitude
        moved = trace[:: max(1, len(trace) // LOOKS)].reshape(-1, len(unknowns)) * MOVEMENT
        cost = np.concatenate([moved.real, moved.imag, EFFORT * unknowns.T])
        return np.concatenate([end.real, end.imag]).T, cost.T
