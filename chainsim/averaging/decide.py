"""Which of several answers a start leads to: decided by the slow flow where it is sure, else left open.

The slow flow is an approximation. How much an error in it can matter on the way is measured: beside the motion runs a
second one whose drive is a little stronger, and the largest distance between the two, over what the drives differ by,
says by how much any error is magnified: a hundredfold or more where a way passes near the border between two basins.
Where the magnified error of the slow flow stays small, both end on the same answer, and so does the true motion.
"""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..equations.chain import Chain, Setting
from ..model.response import Stats
from ..rung import Start
from .envelope import slow_refusal
from .fixed import fixed_point, rates_at
from .run import COARSE, LOOK, Run

__all__ = ["FEW", "MOST_DECIDED", "Decision", "decide"]

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Complexes = NDArray[np.complex128]
Lanes = NDArray[np.int64]

MOST_DECIDED = 32  # Oscillators, beyond which the dense matrices of the flow cost more than an integration.
WELL = 0.6  # Of the hilltop, for the largest amplitude on the way.
# By how much the two drives differ. On a ramp past a fold they jump one after the other, whatever they differ by; there
# only where they end is compared, and so they are farther apart.
APART = {Start.REST: 1e-3, Start.RAMP: 2e-2}
QUIET = 0.1  # Change of every oscillator between two looks, relative, above which looking for an answer is idle.
NEAR = 0.05  # Distance of every oscillator from its answer, relative, at which the linearised flow decides.
SAME = 0.02  # Two answers nearer than this, relative, are one.
# What the slow flow leaves out, relative: at least the first, the second times (beta a^2)^2, and the third times
# (3 beta z0 a)^2 beside an equilibrium z0. Measured against the full equations (tests/chainsim/test_starts.py).
ERROR = (3e-4, 0.1, 0.5)
FEW = 32  # Settings up to which
MOST_STEPS = (256, 32)  # steps between two looks may be as many as the first, else as the second: a motion that needs
# more turns so fast that the full equations are cheaper, though for a few settings not with the compiler they load.
MATTERS = 0.2  # A magnified error beyond which nothing is sure.


@dataclass(frozen=True)
class Decision:
    """Which answer N settings reach.

    Attributes
    ----------
    sure : bool, shape (N,).
    phasor : complex128, shape (N, n), amplitudes of the answer reached, as exact as the slow flow is; NaN where it is
        not sure.
    stats : work of the whole batch.
    """

    sure: Bools
    phasor: Complexes
    stats: Stats


def decide(chain: Chain, setting: Setting, start: Start) -> Decision:
    """Follow the slow flow from `start` (rest or ramp).

    A setting the slow flow is not true of, or which does not settle in time, is not sure.
    """
    began, size = time.perf_counter(), len(setting)
    nothing = np.full((size, setting.n), np.nan, dtype=np.complex128)
    if setting.n > MOST_DECIDED or not chain.deltas.min() > 0 or slow_refusal(chain, setting):
        return Decision(np.zeros(size, dtype=bool), nothing, Stats())
    with np.errstate(all="ignore"):
        ways = _Ways(chain, setting, start)
        ways.follow()
        weak, strong = ways.answer
        sure = (np.abs(weak - strong) <= SAME * np.abs(strong)).all(axis=1) & (ways.matter() <= MATTERS)
    work = Stats(rhs_evals=ways.run.evals, seconds=time.perf_counter() - began)
    return Decision(sure, np.where(sure[:, None], weak, np.nan), work)


class _Ways:
    """Two ways of every setting, the second under the stronger drive: lanes i and N + i of one run.

    answer : complex128, shape (2, N, n), what each reaches under the true drive; NaN where nothing.
    gap : float64, shape (N,), the largest distance seen between the two, relative to each oscillator's peak.
    """

    def __init__(self, chain: Chain, setting: Setting, start: Start) -> None:
        size = len(setting)
        self.size, self.start, self.apart = size, start, APART[start]
        self.run = Run(chain, setting[np.tile(np.arange(size), 2)], COARSE, np.repeat([1.0, 1.0 + self.apart], size))
        self.drive = np.tile(self.run.drive[:size], 2)
        self.answer: Complexes = np.full((2, size, setting.n), np.nan, dtype=np.complex128)
        self.gap = np.zeros(size)
        self.patience = int(np.ceil((20 + 4 * setting.n) * 2 / LOOK))

    def follow(self) -> None:
        """Go until every setting has its answers or has no hope of being sure."""
        run = self.run
        run.begin(self.start)
        lanes: Lanes = run.payable[run.payable < self.size]
        before = run.amplitude(lanes)
        for _ in range(self.patience):
            if not len(lanes):
                break
            pair = np.concatenate([lanes, lanes + self.size])
            run.steps[pair] = np.tile(np.maximum(run.steps[lanes], run.steps[lanes + self.size]), 2)
            run.advance(pair, most=MOST_STEPS[self.size > FEW])
            both = run.amplitude(pair).reshape(2, len(lanes), before.shape[1])
            here, top = both[0], run.peak[lanes]
            gap = np.abs(both[1] - here) / np.maximum(top, 1e-300)
            self.gap[lanes] = np.fmax(self.gap[lanes], gap.max(axis=1))
            hopeless = ~(top <= WELL * run.top[lanes]).all(axis=1) | run.spent[lanes] | (self.matter()[lanes] > MATTERS)
            quiet = (np.abs(here - before) <= QUIET * np.abs(here)).all(axis=1) & ~hopeless
            done = np.zeros(len(lanes), dtype=bool)
            done[quiet] = self._captured(lanes[quiet], both[:, quiet])
            lanes, before = lanes[~done & ~hopeless], here[~done & ~hopeless]

    def matter(self) -> Floats:
        """How much what the slow flow leaves out may have moved the motion, relative; float64, shape (N,)."""
        lanes = np.arange(self.size)
        error = ERROR[0] + ERROR[1] * self.run.strength(lanes) ** 2 + ERROR[2] * self.run.skew(lanes) ** 2
        matter: Floats = self.gap / self.apart * error
        return matter

    def _captured(self, lanes: Lanes, both: Complexes) -> Bools:
        """Whether `lanes` are beside stable answers of their drives; those of the true drive are noted."""
        pair, here = np.concatenate([lanes, lanes + self.size]), both.reshape(2 * len(lanes), both.shape[2])
        flow = self.run.flow.pick(pair)
        orbit, found = fixed_point(flow, self.drive[pair], here, most=8)
        near = found & (np.abs(here - orbit) <= NEAR * np.abs(orbit)).all(axis=1)
        held = near & (rates_at(flow, orbit).real.max(axis=1) < 0)
        good: Bools = held.reshape(2, len(lanes)).all(axis=0)
        self.answer[:, lanes[good]] = orbit.reshape(both.shape)[:, good]
        return good
