"""From rest to a verdict: which periodic orbit a sudden drive reaches, if any."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..equations.scaled_chain import ScaledChain
from ..model.response import Outcome
from ..threads import in_threads
from .network import advance_network
from .rounding import rounding_floor
from .shooting import FAR_SMALLER, shoot
from .splitting import WIDTH, advance_block, forcing_table
from .stepping import coarse_steps, escape_amplitude, steps_at

__all__ = ["Settled", "settle"]

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Lanes = NDArray[np.int64]

_QUIET = 2e-2  # Change over one period, relative, above which looking for an orbit is idle.
_NEAR = 1e-3  # Distance from an orbit, relative to each oscillator, at which the linearised flow decides.
_SAME = 1e-6  # Two orbits found one after the other are one orbit.
_SHRINKS = 0.98  # Between two looks a decaying distance falls by more.
_DRIFTS = 1e-5  # Change over one period, relative, that is motion and not the tail of a slow decay.
_RESTS = 1e-6  # Change over one period, relative, of an oscillator that has come to rest.
_DROWNS = 1e-3  # Of the length scale: a disturbance beyond which it is no small one, so that nothing is told below it.
_STRONG = 0.05  # z^2 beyond which eight steps per period are too few to trust a verdict.
_MOST_KICKS = 1_000_000_000  # Of one setting; about ten seconds.
_MOST_STEPS = 8192  # Steps per period beyond which a setting counts as out of budget.


@dataclass(frozen=True)
class Settled:
    """The verdict for N settings, in the units of `ScaledChain`.

    Attributes
    ----------
    outcome : object array of `Outcome`, shape (N,).
    steps : int64, shape (N,), steps per period used.
    state : float64, shape (N, 2n), the reached orbit at phase 0 for those that are OK.
    phasor : complex128, shape (N, n), its first harmonic; NaN otherwise.
    periods, turns, kicks : work done over all settings.
    """

    outcome: NDArray[np.object_]
    steps: Lanes
    state: Floats
    phasor: NDArray[np.complex128]
    periods: int
    turns: int
    kicks: int


def settle(scaled: ScaledChain, max_periods: int) -> Settled:
    """Integrate every setting from rest until its outcome is sure, for at most `max_periods` periods each.

    A linear chain needs no integration: its only orbit attracts everything or nothing. Settings whose motion
    is strongly nonlinear are decided again with four times the steps that their swings at that amplitude need.
    """
    run = _Run(scaled, max_periods)
    steps = coarse_steps(scaled)
    for value in np.unique(steps[steps <= _MOST_STEPS]):
        decide = run.decide_linear if scaled.linear else run.decide
        decide(np.flatnonzero(steps == value), int(value))
    if not scaled.linear:
        strong = ~(run.peak <= _STRONG) & (steps <= _MOST_STEPS)
        again = np.minimum(4 * steps_at(scaled, run.peak), _MOST_STEPS)
        for value in np.unique(again[strong]):
            run.decide(np.flatnonzero(strong & (again == value)), int(value))
    return Settled(run.outcome, run.steps, run.state, run.phasor, run.periods, run.turns, run.kicks)


class _Run:
    """The arrays of one call of `settle`; every field has the leading axis N."""

    def __init__(self, scaled: ScaledChain, max_periods: int) -> None:
        size, n = len(scaled), scaled.n
        self.scaled, self.max_periods = scaled, max_periods
        self.outcome = np.empty(size, dtype=object)
        self.outcome.fill(Outcome.OUT_OF_BUDGET)
        self.steps = np.array(coarse_steps(scaled))
        self.state, self.peak = np.zeros((size, 2 * n)), np.zeros(size)
        self.phasor = np.full((size, n), np.nan, dtype=np.complex128)
        self.orbit, self.distance = np.full((size, 2 * n), np.nan), np.full(size, np.inf)
        self.periods = self.turns = self.kicks = 0

    def decide(self, lanes: Lanes, steps: int) -> None:
        """Integrate `lanes` from rest at `steps` per period until each has its outcome."""
        self.outcome[lanes], self.steps[lanes] = Outcome.OUT_OF_BUDGET, steps
        self.state[lanes], self.peak[lanes] = 0.0, 0.0
        self.orbit[lanes], self.distance[lanes], self.phasor[lanes] = np.nan, np.inf, np.nan
        rate = 0.5 * float(np.min(self.scaled.network.delta)) * float(np.min(self.scaled.network.period[lanes]))
        pace = int(np.clip(1.0 / rate if rate > 0 else np.inf, 4, max(self.max_periods // 16, 4)))
        # Transients of n stages in cascade die like t^(n-1) e^(-rate t). Fed forward, beats that stay are rare,
        # and what looks like one may be a slow passage by the ghost of a fold: that is given three times as long.
        folds = (20 + 4 * self.scaled.n) * (1 if self.scaled.joint else 3)
        patience = folds / rate if rate > 0 else np.inf
        table, history, done = forcing_table(steps), _History(self.scaled), 0
        most = min(self.max_periods, max(1, _MOST_KICKS // (7 * steps * self.scaled.n)))
        while len(lanes) and done < most:
            go = min(max(pace, int(0.15 * done)), most - done)
            before = self._advance(lanes, table, go)
            done += go
            floor = self._floor(lanes, steps)
            history.add(done, lanes, _distances(before, self.state[lanes], joint=self.scaled.joint, floor=floor))
            lanes = self._look(lanes, steps, history, floor, done >= patience)

    def decide_linear(self, lanes: Lanes, steps: int) -> None:
        """The outcome of linear settings from their one orbit; a marginal one (no damping) stays undecided."""
        orbits = shoot(self.scaled, lanes, np.zeros((len(lanes), 2 * self.scaled.n)), steps)
        self.turns += orbits.turns
        inside = np.max(np.abs(orbits.state), axis=1) <= escape_amplitude(self.scaled)
        reached = orbits.stable & inside
        self._accept(lanes[reached], orbits.state[reached], orbits.harmonics[reached, 1])
        grows = np.max(np.abs(orbits.multipliers), axis=(1, 2)) > 1 + _SAME
        self.outcome[lanes[orbits.found & (grows | ~inside)]] = Outcome.ESCAPED

    def _accept(self, lanes: Lanes, state: Floats, phasor: NDArray[np.complex128]) -> None:
        self.outcome[lanes], self.state[lanes], self.phasor[lanes] = Outcome.OK, state, phasor

    def _advance(self, lanes: Lanes, table: Floats, periods: int) -> Floats:
        """Advance by whole periods; the states before the last one, shape (L, 2n)."""
        scaled, steps = self.scaled, len(table)

        def move(count: int) -> None:
            def work(part: slice) -> None:
                if scaled.plain:
                    advance_block(self.state, lanes[part], scaled.network.plain, table, 0, count * steps, self.peak)
                else:
                    advance_network(self.state, lanes[part], scaled.network, table, 0, count * steps, self.peak)

            in_threads(work, len(lanes), WIDTH if scaled.plain else 1)

        move(periods - 1)
        before = self.state[lanes]
        move(1)
        self.periods += periods * len(lanes)
        self.kicks += 7 * steps * periods * len(lanes) * scaled.n
        return before

    def _floor(self, lanes: Lanes, steps: int) -> Floats:
        """How far rounding alone may keep each oscillator from its orbit, shape (L, n)."""
        n = self.scaled.n
        if self.scaled.joint:
            return np.zeros((len(lanes), n))
        size = np.hypot(self.state[lanes, :n], self.state[lanes, n:])
        return rounding_floor(self.scaled, lanes, size, steps)

    def _look(self, lanes: Lanes, steps: int, history: _History, floor: Floats, patient: bool) -> Lanes:
        """Settle what can be settled now; returns the settings that go on."""
        escaped = ~(np.sqrt(self.peak[lanes]) <= escape_amplitude(self.scaled))
        # What cannot run away has outrun the steps.
        self.outcome[lanes[escaped]] = Outcome.NO_CONVERGENCE if self.scaled.hardens else Outcome.ESCAPED
        lanes, floor = lanes[~escaped], floor[~escaped]
        quiet = np.full_like(lanes, True, dtype=np.bool_) if patient else history.change(lanes) < _QUIET
        restless, lanes, floor = lanes[~quiet], lanes[quiet], np.where(floor <= _DROWNS, floor, 0.0)[quiet]
        orbits = shoot(self.scaled, lanes, self.state[lanes], steps)
        self.turns += orbits.turns
        away = _worst(_distances(self.state[lanes], orbits.state, joint=self.scaled.joint, floor=floor))
        distance = np.where(orbits.stable, away, np.inf)
        same = _worst(_distances(self.orbit[lanes], orbits.state)) < _SAME
        nearing = same & (distance < np.maximum(_SHRINKS * self.distance[lanes], _SAME))
        reached = nearing & (_worst(_distances(self.state[lanes], orbits.state, floor=floor)) < _NEAR)
        self.orbit[lanes], self.distance[lanes] = orbits.state, distance
        self._accept(lanes[reached], orbits.state[reached], orbits.harmonics[reached, 1])
        lost = ~reached & ~nearing & history.recurrent(lanes) if patient else np.zeros_like(reached)
        self.outcome[lanes[lost]] = Outcome.NOT_LOCKED
        return np.concatenate([restless, lanes[~reached & ~lost]])


class _History:
    """What every look saw, to tell recurrent motion from decay."""

    def __init__(self, scaled: ScaledChain) -> None:
        self._joint, self._shape = scaled.joint, (len(scaled), scaled.n)
        self._looks: list[tuple[int, Floats]] = []

    def add(self, done: int, lanes: Lanes, changes: Floats) -> None:
        """Note each oscillator's relative change over the period that ended after `done`; shape (L, n)."""
        whole = np.zeros(self._shape)
        whole[lanes] = changes
        self._looks.append((done, whole))

    def change(self, lanes: Lanes) -> Floats:
        """The change of the worst oscillator at the last look."""
        worst: Floats = np.max(self._looks[-1][1][lanes], axis=1)
        return worst

    def recurrent(self, lanes: Lanes) -> Bools:
        """Whether the change is real and has not halved since half the time.

        An open chain in which one more oscillator has come to rest since then is still on its way: near a
        fold they jump one after the other, each after a long wait.
        """
        done = self._looks[-1][0]
        then = next(seen for at, seen in reversed(self._looks) if at <= done / 2 or at == self._looks[0][0])[lanes]
        now = self._looks[-1][1][lanes]
        moving: Bools = (np.max(now, axis=1) > _DRIFTS) & (np.max(now, axis=1) > 0.5 * np.max(then, axis=1))
        return moving if self._joint else moving & (_settled_head(now) <= _settled_head(then))


def _settled_head(changes: Floats) -> Lanes:
    """How many oscillators at a chain's head have stopped changing."""
    head: Lanes = np.sum(np.cumprod(changes < _RESTS, axis=1), axis=1, dtype=np.int64)
    return head


def _worst(distances: Floats) -> Floats:
    found: Floats = np.max(distances, axis=1, initial=0.0)
    return found


def _distances(a: Floats, b: Floats, *, joint: bool = False, floor: Floats | float = 0.0) -> Floats:
    """Each oscillator's distance in its phase plane beyond `floor`, relative to its own size in `b`; NaN becomes inf.

    With `joint` it is relative to the largest oscillator's size: in a ring a transient runs round through
    oscillators that will be a thousand times smaller, and their own size would hide its decay.

    No size counts as smaller than 1e-9 of the largest: nobody feels what is.
    """
    n = a.shape[1] // 2
    size = np.hypot(b[:, :n], b[:, n:])
    size = np.maximum(size, (1.0 if joint else FAR_SMALLER) * np.max(size, axis=1, keepdims=True, initial=0.0))
    with np.errstate(invalid="ignore"):
        apart = np.hypot(a[:, :n] - b[:, :n], a[:, n:] - b[:, n:])
        apart = np.where(np.isfinite(apart), np.maximum(apart - floor, 0.0), apart)
    nothing = np.where((apart == 0) & (size == 0), 0.0, np.inf)
    found: Floats = np.divide(apart, size, out=nothing, where=(size > 0) & np.isfinite(apart) & np.isfinite(size))
    return found
