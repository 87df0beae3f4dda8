"""The loops over devices side by side: one actuator of WIDTH devices at a time, and how its numbers lie in memory.

All that a loop takes of one actuator stands at constant places of one slice, so the compiler need not ask what
overlaps.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..inlined import inlined
from .composition import DISTINCT

__all__ = [
    "BETA_RUN", "CREEPS", "FLOWS_AT", "GAIN_RUN", "MODES", "MOVES_RUN", "PLAYS", "RUNS", "TIP_RUN", "WIDTH", "add",
    "arrive", "copy", "creep", "flow_all", "hiss", "kick_all", "pull_all", "push_all",
]  # fmt: skip

Floats = NDArray[np.float64]
Seeds = NDArray[np.uint64]

WIDTH = 16
"""Devices side by side."""

MODES, PLAYS, CREEPS = 2, 4, 7
"""Higher modes, play operators and relaxations of every actuator; creep has two to a decade, over three decades."""

TIP_RUN, GAIN_RUN, BETA_RUN, MOVES_RUN = 2, 3, 4, 8
"""Runs of WIDTH numbers in an actuator's share: its tip, what its link makes of lam, its beta, whether it moves."""

_Q, _P, _TIP, _GAIN, _BETA, _CREPT, _NOISE, _HISS, _MOVES = (run * WIDTH for run in range(9))
_MODE = 9 * WIDTH  # Position and velocity of each.
_PLAY = _MODE + 2 * MODES * WIDTH
_CREEP = _PLAY + PLAYS * WIDTH
_PULL = _CREEP + CREEPS * WIDTH

FLOWS_AT = _PULL + WIDTH
"""Where the distinct flows of the oscillator begin, three coefficients each."""

RUNS = FLOWS_AT // WIDTH + 3 * DISTINCT

_GOLDEN, _FIRST_MIX, _SECOND_MIX = (
    np.uint64(word) for word in (0x9E3779B97F4A7C15, 0xBF58476D1CE4E5B9, 0x94D049BB133111EB)
)
_TO_NORMAL = 1 / np.sqrt((65536.0**2 - 1) / 3)


@inlined
def flow_all(row: Floats, own: Floats, first: Floats, second: Floats) -> None:
    """The flows of an oscillator, by its own coefficients, and of its modes; leaves the tip."""
    c1, s1, d1, c2, s2, d2 = first[0], first[1], first[2], second[0], second[1], second[2]
    for w in range(WIDTH):
        x, y, c = row[_Q + w], row[_P + w], own[w]
        x1, y1 = row[_MODE + w], row[_MODE + WIDTH + w]
        x2, y2 = row[_MODE + 2 * WIDTH + w], row[_MODE + 3 * WIDTH + w]
        x, y = c * x + own[WIDTH + w] * y, c * y - own[2 * WIDTH + w] * x
        x1, y1 = c1 * x1 + s1 * y1, c1 * y1 - d1 * x1
        x2, y2 = c2 * x2 + s2 * y2, c2 * y2 - d2 * x2
        row[_Q + w], row[_P + w] = x, y
        row[_MODE + w], row[_MODE + WIDTH + w] = x1, y1
        row[_MODE + 2 * WIDTH + w], row[_MODE + 3 * WIDTH + w] = x2, y2
        row[_TIP + w] = x + (x1 + x2)


@inlined
def kick_all(
    row: Floats, before: Floats, own: Floats, at: float, force: float, lam: float, b: float, press: float,
    piezo: Floats, first: Floats, second: Floats,
) -> None:  # fmt: skip
    """A kick by what the piezo makes of its electric force, a press and the cubic term, then `flow_all`.

    `piezo` is the force if no play were behind it, radii and weights of the plays, and the gains of the modes.
    """
    whole, r0, r1, r2, r3 = piezo[0], piezo[1], piezo[2], piezo[3], piezo[4]
    w0, w1, w2, w3, g1, g2 = piezo[5], piezo[6], piezo[7], piezo[8], b * piezo[9], b * piezo[10]
    c1, s1, d1, c2, s2, d2 = first[0], first[1], first[2], second[0], second[1], second[2]
    for w in range(WIDTH):
        moves = row[_MOVES + w]
        e = moves * (force + row[_PULL + w] + row[_NOISE + w] + at * row[_HISS + w])
        e += lam * row[_GAIN + w] * (before[w] - row[_TIP + w])
        behind = w0 * min(max(row[_PLAY + w] - e, -r0), r0) + w1 * min(max(row[_PLAY + WIDTH + w] - e, -r1), r1)
        behind += w2 * min(max(row[_PLAY + 2 * WIDTH + w] - e, -r2), r2)
        behind += w3 * min(max(row[_PLAY + 3 * WIDTH + w] - e, -r3), r3)
        made = whole * e + (row[_CREPT + w] + behind)
        x, c = row[_Q + w], own[w]
        y = row[_P + w] + b * (made + press * moves - row[_BETA + w] * x * x * x)
        x1, y1 = row[_MODE + w], row[_MODE + WIDTH + w] + g1 * made
        x2, y2 = row[_MODE + 2 * WIDTH + w], row[_MODE + 3 * WIDTH + w] + g2 * made
        x, y = c * x + own[WIDTH + w] * y, c * y - own[2 * WIDTH + w] * x
        x1, y1 = c1 * x1 + s1 * y1, c1 * y1 - d1 * x1
        x2, y2 = c2 * x2 + s2 * y2, c2 * y2 - d2 * x2
        row[_Q + w], row[_P + w] = x, y
        row[_MODE + w], row[_MODE + WIDTH + w] = x1, y1
        row[_MODE + 2 * WIDTH + w], row[_MODE + 3 * WIDTH + w] = x2, y2
        row[_TIP + w] = x + (x1 + x2)


@inlined
def pull_all(row: Floats, above: Floats, row_lam: float) -> None:
    """Keep the force through the link from the actuator above, whose tips `above` are."""
    for w in range(WIDTH):
        row[_PULL + w] = row_lam * (above[w] - row[_TIP + w])


@inlined
def push_all(row: Floats, before: Floats, made: Floats, at: float, force: float, lam: float, piezo: Floats) -> None:
    """Push the plays by the electric force; `made` gets what they and the rest make of it, without creep."""
    whole, r0, r1, r2, r3 = piezo[0], piezo[1], piezo[2], piezo[3], piezo[4]
    w0, w1, w2, w3 = piezo[5], piezo[6], piezo[7], piezo[8]
    for w in range(WIDTH):
        e = row[_MOVES + w] * (force + row[_PULL + w] + row[_NOISE + w] + at * row[_HISS + w])
        e += lam * row[_GAIN + w] * (before[w] - row[_TIP + w])
        p0 = min(max(row[_PLAY + w] - e, -r0), r0)
        p1 = min(max(row[_PLAY + WIDTH + w] - e, -r1), r1)
        p2 = min(max(row[_PLAY + 2 * WIDTH + w] - e, -r2), r2)
        p3 = min(max(row[_PLAY + 3 * WIDTH + w] - e, -r3), r3)
        row[_PLAY + w], row[_PLAY + WIDTH + w] = e + p0, e + p1
        row[_PLAY + 2 * WIDTH + w], row[_PLAY + 3 * WIDTH + w] = e + p2, e + p3
        made[w] = whole * e + (w0 * p0 + w1 * p1 + (w2 * p2 + w3 * p3))


@inlined
def creep(row: Floats, made: Floats, share: Floats, gain: float) -> None:
    """Let every relaxation go its share of the way to its end, and add them up."""
    for w in range(WIDTH):
        end, total = gain * made[w], 0.0
        for i in range(CREEPS):
            part = row[_CREEP + i * WIDTH + w]
            part += share[i] * (end - part)
            row[_CREEP + i * WIDTH + w] = part
            total += part
        row[_CREPT + w] = total


@inlined
def hiss(row: Floats, seeds: Seeds, count: int, rms: float) -> None:
    """The change to the noise of number `count`: four uniform numbers of a hash, added (Irwin and Hall)."""
    step = np.uint64(count) * _GOLDEN
    for w in range(WIDTH):
        x = seeds[w] + step
        x = (x ^ (x >> np.uint64(30))) * _FIRST_MIX
        x = (x ^ (x >> np.uint64(27))) * _SECOND_MIX
        x = x ^ (x >> np.uint64(31))
        low, part = np.uint64(65535), (x >> np.uint64(32))
        total = (x & low) + ((x >> np.uint64(16)) & low) + (part & low) + (part >> np.uint64(16))
        row[_HISS + w] = rms * _TO_NORMAL * (np.float64(total) - 131070.0) - row[_NOISE + w]


@inlined
def arrive(row: Floats) -> None:
    """Make the next sample's noise the present one."""
    for w in range(WIDTH):
        row[_NOISE + w] += row[_HISS + w]
        row[_HISS + w] = 0.0


@inlined
def add(into: Floats, weight: float, row: Floats) -> None:
    """Collect a tip times its weight."""
    for w in range(WIDTH):
        into[w] += weight * row[_TIP + w]


@inlined
def copy(into: Floats, row: Floats) -> None:
    """Keep a tip."""
    for w in range(WIDTH):
        into[w] = row[_TIP + w]
