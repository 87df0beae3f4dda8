"""The loops over devices side by side: one actuator of WIDTH devices at a time, and how its numbers lie in memory."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..inlined import inlined

__all__ = [
    "ELECTRIC", "FLOWS_AT", "MADE", "MOVES", "OWN", "PLAYS", "WIDTH", "add", "arrive", "bent_tip", "electric",
    "flow_own", "flow_pair", "hiss", "kick", "kick_pair", "played", "pushed", "stiff_tip",
]  # fmt: skip

Floats = NDArray[np.float64]
Seeds = NDArray[np.uint64]

WIDTH = 32
"""Devices side by side."""

# An actuator's share of the workspace, in runs of WIDTH numbers: q, p, tip, gain of its link, beta, sum of its creeps,
# noise at the last sample and its change to the next; four distinct flows of three coefficients each; then position and
# velocity of every mode, the plays, the creeps.
FLOWS_AT = 8 * WIDTH
OWN = 20
"""Runs before the modes."""

PLAYS = 4
"""Play operators of every actuator, where there are any."""

# The first share is the chain's: in place of its tip that of a ring's last actuator, in place of the gain whether it
# still moves, and room for the electric force and what hysteresis makes of it.
MOVES, ELECTRIC, MADE = 3 * WIDTH, 4 * WIDTH, 5 * WIDTH

_GOLDEN, _FIRST_MIX, _SECOND_MIX = (
    np.uint64(word) for word in (0x9E3779B97F4A7C15, 0xBF58476D1CE4E5B9, 0x94D049BB133111EB)
)
_TO_NORMAL = 1 / np.sqrt((65536.0**2 - 1) / 3)


@inlined
def flow_own(row: Floats, own: Floats) -> None:
    """The flow of an oscillator of its own numbers."""
    for w in range(WIDTH):
        x, y, c = row[w], row[WIDTH + w], own[w]
        row[w] = c * x + own[WIDTH + w] * y
        row[WIDTH + w] = c * y - own[2 * WIDTH + w] * x


@inlined
def flow_pair(pair: Floats, one: Floats, other: Floats) -> None:
    """The flows of two modes."""
    c, s, d, c2, s2, d2 = one[0], one[1], one[2], other[0], other[1], other[2]
    for w in range(WIDTH):
        x, y, x2, y2 = pair[w], pair[WIDTH + w], pair[2 * WIDTH + w], pair[3 * WIDTH + w]
        pair[w] = c * x + s * y
        pair[WIDTH + w] = c * y - d * x
        pair[2 * WIDTH + w] = c2 * x2 + s2 * y2
        pair[3 * WIDTH + w] = c2 * y2 - d2 * x2


@inlined
def kick_pair(pair: Floats, made: Floats, gain: float, gain2: float, one: Floats, other: Floats) -> None:
    """A kick of two modes by what the piezo makes, and the flows after it."""
    c, s, d, c2, s2, d2 = one[0], one[1], one[2], other[0], other[1], other[2]
    for w in range(WIDTH):
        x, y = pair[w], pair[WIDTH + w] + gain * made[w]
        x2, y2 = pair[2 * WIDTH + w], pair[3 * WIDTH + w] + gain2 * made[w]
        pair[w] = c * x + s * y
        pair[WIDTH + w] = c * y - d * x
        pair[2 * WIDTH + w] = c2 * x2 + s2 * y2
        pair[3 * WIDTH + w] = c2 * y2 - d2 * x2


@inlined
def electric(row: Floats, before: Floats, head: Floats, at: float, force: float, lam: float, base: float) -> None:
    """The electric force, and what a piezo without plays makes of it."""
    for w in range(WIDTH):
        given = head[MOVES + w] * (force + row[6 * WIDTH + w] + at * row[7 * WIDTH + w])
        e = given + lam * row[3 * WIDTH + w] * (before[w] - row[2 * WIDTH + w])
        head[ELECTRIC + w] = e
        head[MADE + w] = base * e + row[5 * WIDTH + w]


@inlined
def played(
    row: Floats, before: Floats, head: Floats, play: Floats, at: float, force: float, lam: float, base: float,
    radius: Floats, weight: Floats,
) -> None:  # fmt: skip
    """The electric force, and what a piezo with plays makes of it."""
    r0, r1, r2, r3 = radius[0], radius[1], radius[2], radius[3]
    w0, w1, w2, w3 = weight[0], weight[1], weight[2], weight[3]
    for w in range(WIDTH):
        given = head[MOVES + w] * (force + row[6 * WIDTH + w] + at * row[7 * WIDTH + w])
        e = given + lam * row[3 * WIDTH + w] * (before[w] - row[2 * WIDTH + w])
        first = w0 * min(max(play[w], e - r0), e + r0) + w1 * min(max(play[WIDTH + w], e - r1), e + r1)
        second = w2 * min(max(play[2 * WIDTH + w], e - r2), e + r2) + w3 * min(max(play[3 * WIDTH + w], e - r3), e + r3)
        head[ELECTRIC + w] = e
        head[MADE + w] = base * e + row[5 * WIDTH + w] + (first + second)


@inlined
def pushed(head: Floats, play: Floats, radius: float) -> None:
    """Push a play by the electric force."""
    for w in range(WIDTH):
        e = head[ELECTRIC + w]
        play[w] = min(max(play[w], e - radius), e + radius)


@inlined
def kick(row: Floats, head: Floats, own: Floats, b: float, preload: float) -> None:
    """A kick of an oscillator by what the piezo makes, a press and its cubic term, and the flow after it."""
    for w in range(WIDTH):
        x = row[w]
        pushed = head[MADE + w] + preload * head[MOVES + w]
        y = row[WIDTH + w] + b * (pushed - row[4 * WIDTH + w] * x * x * x)
        c = own[w]
        row[w] = c * x + own[WIDTH + w] * y
        row[WIDTH + w] = c * y - own[2 * WIDTH + w] * x


@inlined
def stiff_tip(tip: Floats, q: Floats) -> None:
    """A tip without modes; also a copy."""
    for w in range(WIDTH):
        tip[w] = q[w]


@inlined
def bent_tip(tip: Floats, q: Floats, pair: Floats) -> None:
    """A tip with two modes."""
    for w in range(WIDTH):
        tip[w] = q[w] + (pair[w] + pair[2 * WIDTH + w])


@inlined
def hiss(row: Floats, seeds: Seeds, count: int, rms: float) -> None:
    """The change to the noise of sample and channel `count`: four uniform numbers of a hash, added (Irwin and Hall)."""
    step = np.uint64(count) * _GOLDEN
    for w in range(WIDTH):
        x = seeds[w] + step
        x = (x ^ (x >> np.uint64(30))) * _FIRST_MIX
        x = (x ^ (x >> np.uint64(27))) * _SECOND_MIX
        x = x ^ (x >> np.uint64(31))
        low, part = np.uint64(65535), (x >> np.uint64(32))
        total = (x & low) + ((x >> np.uint64(16)) & low) + (part & low) + (part >> np.uint64(16))
        row[7 * WIDTH + w] = rms * _TO_NORMAL * (np.float64(total) - 131070.0) - row[6 * WIDTH + w]


@inlined
def arrive(row: Floats) -> None:
    """Make the next sample's noise the present one."""
    for w in range(WIDTH):
        row[6 * WIDTH + w] += row[7 * WIDTH + w]
        row[7 * WIDTH + w] = 0.0


@inlined
def add(into: Floats, weight: float, tip: Floats) -> None:
    """Collect a tip times its weight."""
    for w in range(WIDTH):
        into[w] += weight * tip[w]
