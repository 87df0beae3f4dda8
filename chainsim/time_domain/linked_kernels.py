"""The kernel that moves chains or grids of any wiring under sampled forces, actuator by actuator side by side.

At every kick all positions stand still, so each actuator takes what its two sources give it without asking who went
first: links both ways, links from above and links without a back term are one loop.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..compiled import compiled
from ..equations.composition import FLOWS, KICK_TIMES, KICKS
from ..inlined import inlined
from .grid_kernels import Actuators, Chains, Stretch
from .splitting import flow

__all__ = ["Samples", "Wiring", "advance_linked"]

Floats = NDArray[np.float64]
Whole = NDArray[np.int64]


class Wiring(NamedTuple):
    """Who feeds whom in every chain.

    first, second : int64, shape (n,), the actuators that feed each one (itself where nothing does; its link is 0).
    back : 1 where a link pulls towards its source (a resistor), 0 where it only pushes (an amplifier).
    """

    first: Whole
    second: Whole
    back: float


class Samples(NamedTuple):
    """What is given at the samples: float64, shape (S, chains, n); links also (1, chains, n), then they stay."""

    force: Floats
    lam: Floats
    other: Floats


@inlined
def _pull(
    q: Floats, p: Floats, now: Floats, change: Floats, beta: Floats, sources: Whole, back: float, at: float, b: float
) -> None:
    """One kick: `now` and `change` are (3, size), force and the two links at the last sample and to the next."""
    for i in range(len(q)):
        x = q[i]
        force, lam, other = now[0, i] + at * change[0, i], now[1, i] + at * change[1, i], now[2, i] + at * change[2, i]
        pulled = lam * (q[sources[0, i]] - back * x) + other * (q[sources[1, i]] - back * x)
        p[i] += b * (force + pulled - beta[i] * x * x * x)


@inlined
def _flow(q: Floats, p: Floats, own: Floats) -> None:
    for i in range(len(q)):
        x, y, c = q[i], p[i], own[0, i]
        q[i], p[i] = c * x + own[1, i] * y, c * y - own[2, i] * x


@inlined
def _given(samples: Samples, s: int, first: int, found: Floats) -> None:
    """Force and links of the chains from `first` on at sample s, into (3, size)."""
    n, lam, other = samples.force.shape[2], samples.lam, samples.other
    for i in range(found.shape[1]):
        chain, m = first + i // n, i % n
        found[0, i] = samples.force[s, chain, m]
        found[1, i] = lam[s if len(lam) > 1 else 0, chain, m]
        found[2, i] = other[s if len(other) > 1 else 0, chain, m]


@inlined
def _store(
    q: Floats, p: Floats, first: int, limit: float, sample: int, z: Floats, held: Floats, escaped: Whole
) -> None:
    """Write one sample of positions; a chain that passes `limit` keeps the positions it had before."""
    n = z.shape[1]
    for start in range(0, len(q), n):
        chain = first + start // n
        for m in range(n):
            if escaped[chain, 0] < 0 and not abs(q[start + m]) <= limit:
                escaped[chain, 0], escaped[chain, 1] = sample, m
        for m in range(n):
            if escaped[chain, 0] < 0:
                held[chain, m] = q[start + m]
            else:
                q[start + m], p[start + m] = 0.0, 0.0
            z[chain, m] = held[chain, m]


@inlined
def _prepare(first: int, wiring: Wiring, actuators: Actuators, step: float, own: Floats, sources: Whole) -> None:
    """Coefficients of the four distinct flows, (4, 3, size), and where each actuator's sources lie."""
    n = len(wiring.first)
    for i in range(sources.shape[1]):
        chain, m = first + i // n, i % n
        sources[0, i], sources[1, i] = i - m + wiring.first[m], i - m + wiring.second[m]
        for k in range(4):
            c, s, d = flow(actuators.delta[chain, m], actuators.stiffness[chain, m], FLOWS[k] * step)
            own[k, 0, i], own[k, 1, i], own[k, 2, i] = c, s, d


@compiled
def advance_linked(
    span: Stretch, state: Floats, samples: Samples, wiring: Wiring, system: Chains, actuators: Actuators, z: Floats,
    escaped: Whole,
) -> None:  # fmt: skip
    """Advance the chains of `span` through every sample after the first `skip`.

    `state` is float64, shape (5, chains, n): q, p, and force and the two links at the last sample. `z` is (S, chains,
    n). `delta`, `beta` and `ring` of `system` are not used.
    """
    n, first = state.shape[2], span.first
    size, step = (span.last - first) * n, system.dtau / system.substeps
    own, sources = np.empty((4, 3, size)), np.empty((2, size), dtype=np.int64)
    _prepare(first, wiring, actuators, step, own, sources)
    q, p = state[0, first : span.last].copy().reshape(size), state[1, first : span.last].copy().reshape(size)
    now, change, beta = np.empty((3, size)), np.empty((3, size)), actuators.beta[first : span.last].copy().reshape(size)
    for part in range(3):
        now[part] = state[2 + part, first : span.last].copy().reshape(size)
    for s in range(span.skip, len(z)):
        _given(samples, s, first, change)
        change -= now
        for sub in range(system.substeps):
            _flow(q, p, own[0])
            for k in range(7):
                at = (sub + KICK_TIMES[k]) / system.substeps
                _pull(q, p, now, change, beta, sources, wiring.back, at, KICKS[k] * step)
                # The eight flows of a step are the four distinct ones, there and back.
                _flow(q, p, own[k + 1 if k < 3 else 6 - k])
        # Taken anew, without the round-off of their changes.
        _given(samples, s, first, now)
        _store(q, p, first, system.limit, span.done + s, z[s], state[0], escaped)
    state[1, first : span.last] = p.reshape(span.last - first, n)
    for part in range(3):
        state[2 + part, first : span.last] = now[part].copy().reshape(span.last - first, n)
