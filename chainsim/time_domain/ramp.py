"""The full equations under a drive that is raised slowly from 0: which orbit a ramp ends on."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..averaging.flow import SlowFlow
from ..equations.chain import Chain, Setting
from ..equations.scaled_chain import ScaledChain
from ..model.response import Outcome
from ..threads import in_threads
from .network import advance_network
from .shooting import shoot
from .splitting import forcing_table
from .stepping import coarse_steps, escape_amplitude
from .transient import Settled

__all__ = ["RAMP", "settle_ramp"]

Floats = NDArray[np.float64]
Lanes = NDArray[np.int64]

RAMP = 100.0  # Length of the ramp, in units of 1/delta.
LOOK = 2.0  # Time between two looks after it, in the same units.
NEAR = 1e-3  # Distance from a stable orbit, relative to each setting, at which the linearised flow decides.
STEPS = 2  # Times the steps per period of the coarse transients from rest.


def settle_ramp(chain: Chain, setting: Setting, *, max_periods: int) -> Settled:
    """Integrate every setting from its equilibrium while the drive grows linearly within 100/delta, then until an orbit
    is reached.

    Outcomes are those of `settle`, but a motion that does not lock is out of budget after `max_periods` periods.
    """
    scaled = ScaledChain.of(chain, setting)
    run = _Run(scaled, _equilibrium(chain, setting) * scaled.length)
    steps = STEPS * coarse_steps(scaled)
    for value in np.unique(steps):
        run.decide(np.flatnonzero(steps == value), int(value), max_periods)
    return Settled(run.outcome, steps, run.state, run.phasor, run.periods, run.turns, run.kicks)


def _equilibrium(chain: Chain, setting: Setting) -> Floats:
    """Where constant forces hold it; float64, shape (N, n)."""
    with np.errstate(all="ignore"):
        lean = SlowFlow.of(chain, setting, setting.lam, 1).lean
    return np.zeros(setting.lam.shape) if lean is None else lean.place


class _Run:
    """The arrays of one call; every field has the leading axis N."""

    def __init__(self, scaled: ScaledChain, place: Floats) -> None:
        size, n = len(scaled), scaled.n
        self.scaled = scaled
        self.outcome = np.empty(size, dtype=object)
        self.outcome.fill(Outcome.OUT_OF_BUDGET)
        self.outcome[~np.isfinite(place).all(axis=1)] = Outcome.ESCAPED
        # All z, then all p = z' + delta/2 z.
        self.state = np.concatenate([place, 0.5 * scaled.network.delta * place], axis=1)
        self.peak = np.zeros(size)
        self.phasor = np.full((size, n), np.nan, dtype=np.complex128)
        self.periods = self.turns = self.kicks = 0

    def decide(self, lanes: Lanes, steps: int, max_periods: int) -> None:
        """Ramp `lanes` at `steps` per period, then look until each has its outcome."""
        lanes = lanes[np.isfinite(self.state[lanes]).all(axis=1)]
        delta = float(self.scaled.network.delta.min())
        longest = float(np.max(1 / (delta * self.scaled.network.period[lanes]))) if delta > 0 and len(lanes) else np.inf
        if RAMP * longest > max_periods:
            return
        table, count = forcing_table(steps), int(np.ceil(RAMP * longest))
        for k in range(count):
            self._advance(lanes, table, 1, (k + 0.5) / count)
        pace, done = int(np.ceil(LOOK * longest)), count
        last = np.full(self.state.shape, np.nan)
        while len(lanes) and done < max_periods:
            self._advance(lanes, table, pace, 1.0)
            done += pace
            gone = ~(np.sqrt(self.peak[lanes]) <= escape_amplitude(self.scaled))
            self.outcome[lanes[gone]] = Outcome.NO_CONVERGENCE if self.scaled.hardens else Outcome.ESCAPED
            lanes = lanes[~gone]
            orbits = shoot(self.scaled, lanes, self.state[lanes], steps)
            self.turns += orbits.turns
            near = _apart(self.state[lanes], orbits.state) < NEAR
            near &= orbits.stable & (_apart(last[lanes], orbits.state) < NEAR)
            last[lanes] = orbits.state
            self.outcome[lanes[near]] = Outcome.OK
            self.state[lanes[near]], self.phasor[lanes[near]] = orbits.state[near], orbits.harmonics[near, 1]
            lanes = lanes[~near]

    def _advance(self, lanes: Lanes, table: Floats, periods: int, share: float) -> None:
        """Advance by whole periods under the part `share` of the drive."""
        network = self.scaled.network._replace(drive=share * self.scaled.network.drive)

        def work(part: slice) -> None:
            advance_network(self.state, lanes[part], network, table, 0, periods * len(table), self.peak)

        in_threads(work, len(lanes), 1)
        self.periods += periods * len(lanes)
        self.kicks += 7 * len(table) * periods * len(lanes) * self.scaled.n


def _apart(a: Floats, b: Floats) -> Floats:
    """Distance relative to each setting's largest coordinate in `b`; NaN becomes inf."""
    size = np.maximum(np.abs(b).max(axis=1, initial=0.0), 1e-300)
    distance = np.abs(a - b).max(axis=1, initial=0.0) / size
    return np.where(np.isfinite(distance), distance, np.inf)
