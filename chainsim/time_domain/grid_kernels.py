"""Kernels that move blocks of chains under sampled forces, WIDTH chains side by side."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..compiled import compiled
from ..equations.composition import FLOWS, KICK_TIMES, KICKS
from ..inlined import inlined
from .splitting import flow

__all__ = ["WIDTH", "Actuators", "Chains", "Stretch", "advance_chains", "advance_unequal"]

Floats = NDArray[np.float64]
Whole = NDArray[np.int64]

WIDTH = 16
"""Chains side by side; a caller should hand over a multiple."""

# One actuator's share of the workspace, in runs of WIDTH numbers: q, p, force and lam at the last sample,
# their changes to the next, and a run of padding against cache-set conflicts.
_ROW = 7 * WIDTH

_TILE = 64
"""Samples all blocks go through before the next ones, so that a large grid's samples stay in the cache."""


@inlined
def _kick_row(row: Floats, previous: Floats, at: float, c: float, s: float, d: float, b: float, beta: float) -> None:
    # Slices with constant offsets, as in splitting: the form the compiler vectorises.
    for w in range(WIDTH):
        x = row[w]
        force = row[2 * WIDTH + w] + at * row[4 * WIDTH + w]
        lam = row[3 * WIDTH + w] + at * row[5 * WIDTH + w]
        y = row[WIDTH + w] + b * (force + lam * (previous[w] - x) - beta * x * x * x)
        row[w] = c * x + s * y
        row[WIDTH + w] = c * y - d * x


@inlined
def _flow_row(row: Floats, c: float, s: float, d: float) -> None:
    for w in range(WIDTH):
        x, y = row[w], row[WIDTH + w]
        row[w] = c * x + s * y
        row[WIDTH + w] = c * y - d * x


class Chains(NamedTuple):
    """What every chain has in common; `limit` is the |z| beyond which it counts as escaped."""

    delta: float
    beta: float
    ring: bool
    dtau: float
    substeps: int
    limit: float


class Stretch(NamedTuple):
    """Chains first..last-1, samples of the block from `skip` on; `done` samples came before the block."""

    first: int
    last: int
    skip: int
    done: int


@inlined
def _one_sample(work: Floats, flows: Floats, system: Chains) -> None:
    """Move one block from a sample to the next; force and lam are linear between them."""
    last, h = len(work) - _ROW, system.dtau / system.substeps
    for sub in range(system.substeps):
        for at in range(_ROW, len(work), _ROW):
            _flow_row(work[at : at + 2 * WIDTH], flows[0, 0], flows[0, 1], flows[0, 2])
        for k in range(7):
            if system.ring:
                for w in range(WIDTH):
                    work[w] = work[last + w]
            c, s, d = flows[k + 1, 0], flows[k + 1, 1], flows[k + 1, 2]
            part = (sub + KICK_TIMES[k]) / system.substeps
            for at in range(last, 0, -_ROW):
                _kick_row(
                    work[at : at + 6 * WIDTH], work[at - _ROW : at - _ROW + WIDTH],
                    part, c, s, d, KICKS[k] * h, system.beta,
                )  # fmt: skip


@inlined
def _aim(work: Floats, start: int, force: Floats, lam: Floats) -> None:
    """Take the next sample's forces and links as changes from the present ones."""
    for at in range(force.shape[1]):
        row = work[(at + 1) * _ROW : (at + 2) * _ROW]
        for w in range(min(WIDTH, len(force) - start)):
            row[4 * WIDTH + w] = force[start + w, at] - row[2 * WIDTH + w]
            row[5 * WIDTH + w] = lam[start + w, at] - row[3 * WIDTH + w]


@inlined
def _arrive(work: Floats, start: int, force: Floats, lam: Floats) -> None:
    """Make the next sample's forces and links the present ones, without the round-off of their changes."""
    for at in range(force.shape[1]):
        row = work[(at + 1) * _ROW : (at + 2) * _ROW]
        for w in range(min(WIDTH, len(force) - start)):
            row[2 * WIDTH + w], row[3 * WIDTH + w] = force[start + w, at], lam[start + w, at]


@inlined
def _store(work: Floats, start: int, limit: float, sample: int, z: Floats, held: Floats, escaped: Whole) -> None:
    """Write one sample of positions; a chain that passes `limit` keeps the positions it had before."""
    n = z.shape[1]
    for w in range(min(WIDTH, len(z) - start)):
        chain = start + w
        for at in range(n):
            x = work[(at + 1) * _ROW + w]
            if escaped[chain, 0] < 0 and not abs(x) <= limit:
                escaped[chain, 0], escaped[chain, 1] = sample, at
        for at in range(n):
            row = work[(at + 1) * _ROW : (at + 2) * _ROW]
            if escaped[chain, 0] < 0:
                held[chain, at] = row[w]
            else:
                row[w], row[WIDTH + w] = 0.0, 0.0
            z[chain, at] = held[chain, at]


@inlined
def _exchange(work: Floats, start: int, state: Floats, out: bool) -> None:
    """Copy the four parts of the state of a block's chains into the workspace, or out of it."""
    for part in range(4):
        for w in range(min(WIDTH, state.shape[1] - start)):
            for at in range(state.shape[2]):
                here = (at + 1) * _ROW + part * WIDTH + w
                if not out:
                    work[here] = state[part, start + w, at]
                elif part > 0:
                    state[part, start + w, at] = work[here]


@compiled
def advance_chains(
    span: Stretch, state: Floats, force: Floats, lam: Floats, system: Chains, z: Floats, escaped: Whole
) -> None:
    """Advance the chains of `span` through every sample after the first `skip`.

    `state` is float64, shape (4, chains, n): q, p, and force and lam at the last sample. `force` and `z` are
    (S, chains, n), `lam` the same or (1, chains, n). `span.first` is a multiple of WIDTH.
    """
    flows = np.empty((8, 3))
    for k in range(8):
        flows[k, 0], flows[k, 1], flows[k, 2] = flow(system.delta, 1.0, FLOWS[k] * system.dtau / system.substeps)
    work = np.zeros((force.shape[2] + 1) * _ROW)
    for tile in range(span.skip, len(force), _TILE):
        for start in range(span.first, span.last, WIDTH):
            _exchange(work, start, state, False)
            for s in range(tile, min(tile + _TILE, len(force))):
                links = lam[s if len(lam) > 1 else 0]
                _aim(work, start, force[s], links)
                _one_sample(work, flows, system)
                _arrive(work, start, force[s], links)
                _store(work, start, system.limit, span.done + s, z[s], state[0], escaped)
            _exchange(work, start, state, True)


class Actuators(NamedTuple):
    """What differs from actuator to actuator: float64, shape (chains, n) each; `stiffness` is 1 at f0."""

    delta: Floats
    beta: Floats
    stiffness: Floats


_OWN = 13 * WIDTH
"""One actuator's coefficients, in runs of WIDTH: four distinct flows of three each, and beta."""


@inlined
def _kick_own(row: Floats, previous: Floats, own: Floats, at: float, flow_at: int, b: float) -> None:
    for w in range(WIDTH):
        x = row[w]
        force = row[2 * WIDTH + w] + at * row[4 * WIDTH + w]
        lam = row[3 * WIDTH + w] + at * row[5 * WIDTH + w]
        y = row[WIDTH + w] + b * (force + lam * (previous[w] - x) - own[12 * WIDTH + w] * x * x * x)
        c = own[flow_at + w]
        row[w] = c * x + own[flow_at + WIDTH + w] * y
        row[WIDTH + w] = c * y - own[flow_at + 2 * WIDTH + w] * x


@inlined
def _flow_own(row: Floats, own: Floats) -> None:
    for w in range(WIDTH):
        x, y, c = row[w], row[WIDTH + w], own[w]
        row[w] = c * x + own[WIDTH + w] * y
        row[WIDTH + w] = c * y - own[2 * WIDTH + w] * x


@inlined
def _one_unequal_sample(work: Floats, own: Floats, system: Chains) -> None:
    """`_one_sample` where every actuator has coefficients of its own."""
    n, h = len(work) // _ROW - 1, system.dtau / system.substeps
    for sub in range(system.substeps):
        for m in range(1, n + 1):
            _flow_own(work[m * _ROW : m * _ROW + 2 * WIDTH], own[(m - 1) * _OWN : m * _OWN])
        for k in range(7):
            if system.ring:
                for w in range(WIDTH):
                    work[w] = work[n * _ROW + w]
            part = (sub + KICK_TIMES[k]) / system.substeps
            # The eight flows of a step are the four distinct ones, there and back.
            after = 3 * WIDTH * (k + 1 if k < 3 else 6 - k)
            for m in range(n, 0, -1):
                at = m * _ROW
                _kick_own(
                    work[at : at + 6 * WIDTH], work[at - _ROW : at - _ROW + WIDTH], own[(m - 1) * _OWN : m * _OWN],
                    part, after, KICKS[k] * h,
                )  # fmt: skip


@inlined
def _coefficients(actuators: Actuators, start: int, step: float, own: Floats) -> None:
    chains, n = actuators.delta.shape
    for m in range(n):
        for w in range(WIDTH):
            chain = min(start + w, chains - 1)
            at = m * _OWN + w
            for k in range(4):
                c, s, d = flow(actuators.delta[chain, m], actuators.stiffness[chain, m], FLOWS[k] * step)
                own[at + 3 * k * WIDTH] = c
                own[at + (3 * k + 1) * WIDTH] = s
                own[at + (3 * k + 2) * WIDTH] = d
            own[at + 12 * WIDTH] = actuators.beta[chain, m]


@compiled
def advance_unequal(
    span: Stretch, state: Floats, force: Floats, lam: Floats, system: Chains, actuators: Actuators, z: Floats,
    escaped: Whole,
) -> None:  # fmt: skip
    """`advance_chains` where every actuator is its own; `delta` and `beta` of `system` are not used."""
    n = force.shape[2]
    work, own = np.zeros((n + 1) * _ROW), np.empty(n * _OWN)
    for tile in range(span.skip, len(force), _TILE):
        for start in range(span.first, span.last, WIDTH):
            _exchange(work, start, state, False)
            _coefficients(actuators, start, system.dtau / system.substeps, own)
            for s in range(tile, min(tile + _TILE, len(force))):
                links = lam[s if len(lam) > 1 else 0]
                _aim(work, start, force[s], links)
                _one_unequal_sample(work, own, system)
                _arrive(work, start, force[s], links)
                _store(work, start, system.limit, span.done + s, z[s], state[0], escaped)
            _exchange(work, start, state, True)
