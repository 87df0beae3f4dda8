"""The kernel that moves chains of WIDTH devices side by side, with what acts on them beside the chain's equation.

The composition is as in `grid_kernels`, with fewer kicks: oscillator and modes are flows, solved exactly; at every kick
all positions stand still, so the tips, the links, the electric force, its hysteresis and the cubic term are known. Play
operators are pushed at the end of every step, so corners cost an error of second order. Creep, slow beside a sample, is
taken by the midpoint rule once in so many samples. An effect that is off has weights of 0.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..compiled import compiled
from ..inlined import inlined
from ..time_domain.splitting import flow
from .composition import DISTINCT, FLOWS, KICK_TIMES, KICKS
from .lanes import (
    BETA_RUN,
    FLOWS_AT,
    GAIN_RUN,
    RUNS,
    TIP_RUN,
    WIDTH,
    add,
    arrive,
    copy,
    creep,
    flow_all,
    hiss,
    kick_all,
    pull_all,
    push_all,
)

__all__ = ["ChainSamples", "Shared", "advance_drawn", "flows_of_step"]

Floats = NDArray[np.float64]
Whole = NDArray[np.int64]
Seeds = NDArray[np.uint64]

_SHARE = RUNS * WIDTH
_CHECKED = 16
"""Samples from one look for escapes to the next; beyond the limit a motion is not finite a few samples later."""


class Shared(NamedTuple):
    """What all devices have in common.

    dtau, substeps, limit : of `grid_kernels.Chains`.
    ring : whether the last actuator feeds the first.
    row_lam, beside : coupling from the actuator above, and how many chains before it the chain above stands.
    preload : on the first actuator.
    piezo : float64, shape (11,), base and weights of `effects.Play` together, its radii, its weights, and the gains of
        the modes.
    mode_flows : float64, shape (2, DISTINCT, 3), coefficients of the modes' distinct flows.
    plays : whether there are any.
    creep_every : samples from one step of creep to the next, 0 where there is none.
    creep_steps : float64, shape (7,), share of the way to its end that each relaxation goes in such a step.
    creep_gain : of each.
    """

    dtau: float
    substeps: int
    limit: float
    ring: bool
    row_lam: float
    beside: int
    preload: float
    piezo: Floats
    mode_flows: Floats
    plays: bool
    creep_every: int
    creep_steps: Floats
    creep_gain: float


class ChainSamples(NamedTuple):
    """What C chains share of a block of samples; row 0 is the last sample before the block.

    force, lam : float64, shape (C, S + 1, n).
    noise : float64, shape (C, n), rms of a force.
    channel : int64, shape (C, n), the number of each actuator, of `channels`, for its noise.
    first : number of the block's first sample.
    frame : int64, shape (S,), the frame a sample counts for, -1 for none.
    basis : float64, shape (C, S, K), its weights.
    """

    force: Floats
    lam: Floats
    noise: Floats
    channel: Whole
    channels: int
    first: int
    frame: Whole
    basis: Floats


@compiled
def flows_of_step(delta: Floats, stiffness: Floats, step: float) -> Floats:
    """The distinct flows of a step: float64, shape (DISTINCT, 3, N) for N oscillators."""
    found = np.empty((DISTINCT, 3, len(delta)))
    for i in range(len(delta)):
        for k in range(DISTINCT):
            found[k, 0, i], found[k, 1, i], found[k, 2, i] = flow(delta[i], stiffness[i], FLOWS[k] * step)
    return found


@inlined
def _step(works: Floats, sub: int, s: int, given: ChainSamples, shared: Shared) -> None:
    n, h, modes = given.force.shape[2], shared.dtau / shared.substeps, shared.mode_flows
    for c in range(len(works)):
        for m in range(n):
            here = (m + 1) * _SHARE
            own = works[c, here + FLOWS_AT : here + FLOWS_AT + 3 * WIDTH]
            flow_all(works[c, here : here + FLOWS_AT], own, modes[0, 0], modes[1, 0])
    for k in range(len(KICKS)):
        at, b = (sub + KICK_TIMES[k]) / shared.substeps, KICKS[k] * h
        # The flows of a step are the distinct ones, there and back.
        after = min(k + 1, len(KICKS) - 1 - k)
        # From the last one on, so that each finds the tips before and above it where they were.
        for c in range(len(works) - 1, -1, -1):
            work = works[c]
            if shared.ring:
                copy(work[:WIDTH], work[n * _SHARE : (n + 1) * _SHARE])
            for m in range(n - 1, -1, -1):
                here = (m + 1) * _SHARE
                _pull(works, c, m, shared)
                force = given.force[c, s, m] + at * (given.force[c, s + 1, m] - given.force[c, s, m])
                lam = given.lam[c, s, m] + at * (given.lam[c, s + 1, m] - given.lam[c, s, m])
                flows_at, before = here + FLOWS_AT + 3 * WIDTH * after, here - _SHARE + TIP_RUN * WIDTH if m else 0
                kick_all(
                    work[here : here + FLOWS_AT], work[before : before + WIDTH], work[flows_at : flows_at + 3 * WIDTH],
                    at, force, lam, b, shared.preload if m == 0 else 0.0, shared.piezo, modes[0, after],
                    modes[1, after],
                )  # fmt: skip


@inlined
def _pull(works: Floats, c: int, m: int, shared: Shared) -> None:
    if shared.row_lam != 0.0 and c >= shared.beside:
        here, tip = (m + 1) * _SHARE, (m + 1) * _SHARE + TIP_RUN * WIDTH
        pull_all(works[c, here : here + FLOWS_AT], works[c - shared.beside, tip : tip + WIDTH], shared.row_lam)


@inlined
def _settle(works: Floats, sub: int, s: int, creeps: bool, given: ChainSamples, shared: Shared) -> None:
    """Push the plays at the end of a step, and let creep follow."""
    n, at = given.force.shape[2], (sub + 1) / shared.substeps
    for c in range(len(works)):
        work = works[c]
        if shared.ring:
            copy(work[:WIDTH], work[n * _SHARE : (n + 1) * _SHARE])
        for m in range(n):
            here, made = (m + 1) * _SHARE, work[WIDTH : 2 * WIDTH]
            _pull(works, c, m, shared)
            row, before = work[here : here + FLOWS_AT], here - _SHARE + TIP_RUN * WIDTH if m else 0
            force = given.force[c, s, m] + at * (given.force[c, s + 1, m] - given.force[c, s, m])
            lam = given.lam[c, s, m] + at * (given.lam[c, s + 1, m] - given.lam[c, s, m])
            push_all(row, work[before : before + WIDTH], made, at, force, lam, shared.piezo)
            if creeps:
                creep(row, made, shared.creep_steps, shared.creep_gain)


@inlined
def _check(work: Floats, n: int, limit: float, sample: int, escaped: Whole) -> None:
    """A chain that has passed `limit` lies still from then on."""
    for w in range(WIDTH):
        gone = False
        for m in range(1, n + 1):
            gone = gone or not abs(work[m * _SHARE + w]) <= limit
        if gone:
            escaped[w] = min(escaped[w], sample)
            work[w] = 0.0
            for m in range(1, n + 1):
                for run in range(FLOWS_AT // WIDTH):
                    # The gain of its link and beta stay; whether it moves does not.
                    if run not in (GAIN_RUN, BETA_RUN):
                        work[m * _SHARE + run * WIDTH + w] = 0.0


@inlined
def _hiss(works: Floats, seeds: Seeds, sample: int, given: ChainSamples) -> None:
    for c in range(len(works)):
        for m in range(given.noise.shape[1]):
            if given.noise[c, m] > 0.0:
                row = works[c, (m + 1) * _SHARE : (m + 1) * _SHARE + FLOWS_AT]
                hiss(row, seeds, sample * given.channels + given.channel[c, m], given.noise[c, m])


@inlined
def _end(works: Floats, s: int, given: ChainSamples, load: Floats) -> None:
    """Let the noise arrive, and collect what is felt."""
    for c in range(len(works)):
        for m in range(given.noise.shape[1]):
            row = works[c, (m + 1) * _SHARE : (m + 1) * _SHARE + FLOWS_AT]
            if given.noise[c, m] > 0.0:
                arrive(row)
            if given.frame[s] >= 0:
                for k in range(given.basis.shape[2]):
                    add(load[c, given.frame[s], m, k], given.basis[c, s, k], row)


@compiled
def advance_drawn(
    works: Floats, seeds: Seeds, given: ChainSamples, shared: Shared, load: Floats, escaped: Whole
) -> None:
    """Move C chains of WIDTH devices through a block of samples: one, or where rows are coupled all of them.

    Parameters
    ----------
    works : float64, shape (C, (n + 1) RUNS WIDTH), for each the chain's own share, then the actuators'; changed in
        place.
    seeds : uint64, shape (WIDTH,), of each device's noise.
    load : float64, shape (C, frames, n, K, WIDTH): `basis` times the tips is added for every sample.
    escaped : int64, shape (C, WIDTH), lowered to the sample at which a device has been seen to escape.
    """
    for s in range(len(given.frame)):
        sample = given.first + s
        _hiss(works, seeds, sample, given)
        for sub in range(shared.substeps):
            _step(works, sub, s, given, shared)
            due = shared.creep_every > 0 and sub + 1 == shared.substeps and (sample + 1) % shared.creep_every == 0
            if shared.plays or due:
                _settle(works, sub, s, due, given, shared)
        if sample % _CHECKED == 0:
            for c in range(len(works)):
                _check(works[c], given.force.shape[2], shared.limit, sample, escaped[c])
        _end(works, s, given, load)
