"""The kernel that moves one chain of WIDTH devices side by side, with what acts on them beside the chain's equation.

The composition is that of `grid_kernels`: oscillator and modes are flows, solved exactly; at every kick all positions
stand still, so the tips, the links, the electric force, its hysteresis and the cubic term are known. Play operators are
pushed at the end of every step, so corners cost an error of second order. Creep, slow beside a sample, is taken by the
midpoint rule once a sample.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..compiled import compiled
from ..equations.composition import FLOWS, KICK_TIMES, KICKS
from ..inlined import inlined
from ..time_domain.splitting import flow
from .lanes import (
    FLOWS_AT,
    MADE,
    MOVES,
    OWN,
    PLAYS,
    WIDTH,
    add,
    arrive,
    bent_tip,
    electric,
    flow_own,
    flow_pair,
    hiss,
    kick,
    kick_pair,
    played,
    pushed,
    stiff_tip,
)

__all__ = ["Given", "Shared", "advance_drawn", "flows_of_step"]

Floats = NDArray[np.float64]
Whole = NDArray[np.int64]
Seeds = NDArray[np.uint64]

_CHECKED = 16
"""Samples from one look for escapes to the next; beyond the limit a motion is not finite a few samples later."""


class Shared(NamedTuple):
    """What all devices have in common.

    dtau, substeps, limit : of `grid_kernels.Chains`. ring : whether the last actuator feeds the first.
    preload : on the first actuator. base, radius, weight : of `effects.Play`; none is base 1 and no radius.
    mode_flows : float64, shape (J, 4, 3), coefficients of the four distinct flows. mode_gains : shape (J,).
        J is even.
    creep_steps : share of the way to its end that each creep goes in a sample, shape (C,). creep_gain : of each.
    """

    dtau: float
    substeps: int
    limit: float
    ring: bool
    preload: float
    base: float
    radius: Floats
    weight: Floats
    mode_flows: Floats
    mode_gains: Floats
    creep_steps: Floats
    creep_gain: float


class Given(NamedTuple):
    """One chain's share of a block of samples; row 0 is the last sample before the block.

    force, lam : float64, shape (S + 1, n). noise : shape (n,), rms of a force. channel : int64, shape (n,), the
    number of the actuator, of `channels`, for its noise. first : number of the block's first sample.
    frame : int64, shape (S,), the frame a sample counts for, -1 for none. basis : float64, shape (S, K), its weights.
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
    """The four distinct flows of a step: float64, shape (4, 3, N) for N oscillators."""
    found = np.empty((4, 3, len(delta)))
    for i in range(len(delta)):
        for k in range(4):
            found[k, 0, i], found[k, 1, i], found[k, 2, i] = flow(delta[i], stiffness[i], FLOWS[k] * step)
    return found


@inlined
def _tips(work: Floats, size: int, n: int, modes: int, ring: bool) -> None:
    for m in range(1, n + 1):
        here = m * size
        tip, bent = work[here + 2 * WIDTH : here + 3 * WIDTH], here + OWN * WIDTH
        if modes == 0:
            stiff_tip(tip, work[here : here + WIDTH])
        else:
            bent_tip(tip, work[here : here + WIDTH], work[bent : bent + 4 * WIDTH])
        for j in range(2, modes, 2):
            bent_tip(tip, tip, work[bent + 2 * j * WIDTH : bent + (2 * j + 4) * WIDTH])
    if ring:
        stiff_tip(work[2 * WIDTH : 3 * WIDTH], work[n * size + 2 * WIDTH : n * size + 3 * WIDTH])


@inlined
def _make(work: Floats, size: int, m: int, at: float, force: float, lam: float, shared: Shared) -> None:
    """What the piezo of actuator m makes of its electric force, into the chain's share."""
    modes, here, before = len(shared.mode_gains), m * size, (m - 1) * size + 2 * WIDTH
    row, source, head = work[here : here + 8 * WIDTH], work[before : before + WIDTH], work[: 6 * WIDTH]
    if len(shared.radius):
        play = here + (OWN + 2 * modes) * WIDTH
        played(
            row, source, head, work[play : play + PLAYS * WIDTH], at, force, lam, shared.base, shared.radius,
            shared.weight,
        )  # fmt: skip
    else:
        electric(row, source, head, at, force, lam, shared.base)


@inlined
def _step(work: Floats, size: int, sub: int, s: int, given: Given, shared: Shared) -> None:
    n, modes, h = given.force.shape[1], len(shared.mode_gains), shared.dtau / shared.substeps
    head = work[: 6 * WIDTH]
    for m in range(1, n + 1):
        here = m * size
        flow_own(work[here : here + 2 * WIDTH], work[here + FLOWS_AT : here + FLOWS_AT + 3 * WIDTH])
        for j in range(0, modes, 2):
            bent, flows = here + (OWN + 2 * j) * WIDTH, shared.mode_flows
            flow_pair(work[bent : bent + 4 * WIDTH], flows[j, 0], flows[j + 1, 0])
    for k in range(7):
        _tips(work, size, n, modes, shared.ring)
        at, b = (sub + KICK_TIMES[k]) / shared.substeps, KICKS[k] * h
        # The eight flows of a step are the four distinct ones, there and back.
        after = k + 1 if k < 3 else 6 - k
        for m in range(n, 0, -1):
            here = m * size
            force = given.force[s, m - 1] + at * (given.force[s + 1, m - 1] - given.force[s, m - 1])
            lam = given.lam[s, m - 1] + at * (given.lam[s + 1, m - 1] - given.lam[s, m - 1])
            _make(work, size, m, at, force, lam, shared)
            own = here + FLOWS_AT + 3 * WIDTH * after
            kick(work[here : here + 5 * WIDTH], head, work[own : own + 3 * WIDTH], b, shared.preload if m == 1 else 0.0)
            for j in range(0, modes, 2):
                bent, gains, flows = here + (OWN + 2 * j) * WIDTH, shared.mode_gains, shared.mode_flows
                kick_pair(
                    work[bent : bent + 4 * WIDTH], head[MADE:], b * gains[j], b * gains[j + 1],
                    flows[j, after], flows[j + 1, after],
                )  # fmt: skip


@inlined
def _settle(work: Floats, size: int, sub: int, s: int, given: Given, shared: Shared) -> None:
    """Push the plays at the end of a step; at the end of a sample let creep follow."""
    n, modes, plays, creeps = given.force.shape[1], len(shared.mode_gains), len(shared.radius), len(shared.creep_steps)
    at, head = (sub + 1) / shared.substeps, work[: 6 * WIDTH]
    if plays or (creeps and sub + 1 == shared.substeps):
        _tips(work, size, n, modes, shared.ring)
        for m in range(1, n + 1):
            here = m * size
            force = given.force[s, m - 1] + at * (given.force[s + 1, m - 1] - given.force[s, m - 1])
            lam = given.lam[s, m - 1] + at * (given.lam[s + 1, m - 1] - given.lam[s, m - 1])
            _make(work, size, m, at, force, lam, shared)
            for i in range(plays):
                play = here + (OWN + 2 * modes + i) * WIDTH
                pushed(head, work[play : play + WIDTH], shared.radius[i])
            if sub + 1 == shared.substeps:
                first = here + (OWN + 2 * modes + plays) * WIDTH
                _creep(work[here : here + 6 * WIDTH], work[first : first + creeps * WIDTH], head, shared)


@inlined
def _creep(row: Floats, slow: Floats, head: Floats, shared: Shared) -> None:
    for w in range(WIDTH):
        # Without the creep that is in it.
        head[MADE + w] -= row[5 * WIDTH + w]
        row[5 * WIDTH + w] = 0.0
    for i in range(len(shared.creep_steps)):
        part, share, gain = slow[i * WIDTH : (i + 1) * WIDTH], shared.creep_steps[i], shared.creep_gain
        for w in range(WIDTH):
            part[w] += share * (gain * head[MADE + w] - part[w])
            row[5 * WIDTH + w] += part[w]


@inlined
def _check(work: Floats, size: int, n: int, limit: float, sample: int, escaped: Whole) -> None:
    """A chain that has passed `limit` lies still from then on."""
    for w in range(WIDTH):
        gone = False
        for m in range(1, n + 1):
            gone = gone or not abs(work[m * size + w]) <= limit
        if gone:
            escaped[w] = min(escaped[w], sample)
            work[MOVES + w] = 0.0
            for m in range(n + 1):
                for run in range(size // WIDTH):
                    # What it is made of stays.
                    if m and run not in (3, 4) and not 8 <= run < OWN:
                        work[m * size + run * WIDTH + w] = 0.0
            work[2 * WIDTH + w] = 0.0


@compiled
def advance_drawn(work: Floats, seeds: Seeds, given: Given, shared: Shared, load: Floats, escaped: Whole) -> None:
    """Move one chain of WIDTH devices through a block of samples.

    Parameters
    ----------
    work : float64, shape ((n + 1) size,), the state and what differs from device to device; changed in place.
    seeds : uint64, shape (WIDTH,), of each device's noise.
    load : float64, shape (frames, n, K, WIDTH): `basis` times the tips is added for every sample.
    escaped : int64, shape (WIDTH,), lowered to the sample at which a device has been seen to escape.
    """
    samples, n = len(given.frame), given.force.shape[1]
    size = len(work) // (n + 1)
    for s in range(samples):
        for m in range(n):
            if given.noise[m] > 0.0:
                row, count = work[(m + 1) * size : (m + 1) * size + 8 * WIDTH], given.first + s
                hiss(row, seeds, count * given.channels + given.channel[m], given.noise[m])
        for sub in range(shared.substeps):
            _step(work, size, sub, s, given, shared)
            _settle(work, size, sub, s, given, shared)
        for m in range(n):
            if given.noise[m] > 0.0:
                arrive(work[(m + 1) * size : (m + 1) * size + 8 * WIDTH])
        if (given.first + s) % _CHECKED == 0:
            _check(work, size, n, shared.limit, given.first + s, escaped)
        if given.frame[s] >= 0:
            _tips(work, size, n, len(shared.mode_gains), shared.ring)
            for m in range(n):
                tip = work[(m + 1) * size + 2 * WIDTH : (m + 1) * size + 3 * WIDTH]
                for k in range(given.basis.shape[1]):
                    into, weight = load[given.frame[s], m, k], given.basis[s, k]
                    add(into, weight, tip)
