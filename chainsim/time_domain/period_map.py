"""One drive period with its derivative: the kernels behind shooting.

Both integrate the composition of `splitting` together with its exact tangent, so Newton converges to the
fixed point of the very map the transient iterates, and the multipliers are that map's.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..compiled import compiled
from ..equations.composition import FLOWS, KICKS
from ..equations.views import Network
from ..inlined import inlined
from .splitting import flow

__all__ = ["HARMONICS", "map_joint", "shoot_forward"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
Lanes = NDArray[np.int64]

HARMONICS = 7
"""Harmonics that are measured of every orbit, besides the mean."""

_ROUNDS = 14
_STALL = 1e-9
_CLOSE = 1e-14
_NOTHING = 1e-290  # Corrections so small have lost their digits.


@inlined
def _flows(delta: float, stiffness: float, h: float, found: Floats) -> None:
    """Coefficients of the eight flows of one step of length `h`, into (8, 3)."""
    for k in range(8):
        found[k, 0], found[k, 1], found[k, 2] = flow(delta, stiffness, FLOWS[k] * h)


@inlined
def _measure(samples: Floats, found: Complexes) -> None:
    """Mean and harmonics of one period of samples: z = found[0] + Re(sum found[k] e^{i k theta})."""
    steps = len(samples)
    for k in range(HARMONICS + 1):
        total = 0.0 + 0.0j
        for s in range(steps):
            angle = 2 * np.pi * ((k * s) % steps) / steps
            total += samples[s] * (np.cos(angle) - 1j * np.sin(angle))
        found[k] = total / steps if k == 0 else 2 * total / steps


@inlined
def _one_period(
    start: Floats, h: float, flows: Floats, force: Floats, beta: float, seen: Floats, samples: Floats, end: Floats
) -> None:
    """One oscillator over one period under the force at every kick.

    `seen` receives its position at every kick, `samples` at every step's start, `end` the final q, p, the
    tangent (row by row) and the largest |q| or |p|.
    """
    x, y, high = start[0], start[1], 0.0
    xx, xy, yx, yy = 1.0, 0.0, 0.0, 1.0
    for s in range(len(samples)):
        samples[s] = x
        high = max(high, abs(x), abs(y))
        for k in range(8):
            c, g, d = flows[k, 0], flows[k, 1], flows[k, 2]
            x, y = c * x + g * y, c * y - d * x
            xx, yx = c * xx + g * yx, c * yx - d * xx
            xy, yy = c * xy + g * yy, c * yy - d * xy
            if k < 7:
                seen[s, k] = x
                b = KICKS[k] * h
                y += b * (force[s, k] - beta * x * x * x)
                slope = -3.0 * b * beta * x * x
                yx += slope * xx
                yy += slope * xy
    end[0], end[1], end[2], end[3], end[4], end[5], end[6] = x, y, xx, xy, yx, yy, high


@inlined
def _newton(
    start: Floats, h: float, flows: Floats, force: Floats, beta: float, seen: Floats, samples: Floats, end: Floats
) -> tuple[float, int]:
    """Make `start` periodic; returns the last correction relative to the orbit's size (NaN: failed) and rounds."""
    last = np.inf
    for turn in range(_ROUNDS):
        _one_period(start, h, flows, force, beta, seen, samples, end)
        r, t = end[0] - start[0], end[1] - start[1]
        a, b, c, d = 1.0 - end[2], -end[3], -end[4], 1.0 - end[5]
        det = a * d - b * c
        dx, dy = (d * r - b * t) / det, (a * t - c * r) / det
        size = np.hypot(dx, dy)
        if size <= _NOTHING:
            return 0.0, turn + 1
        size /= max(end[6], size)
        if not size <= 1.0:
            return np.nan, turn + 1
        if size < _CLOSE or (size < _STALL and size > 0.5 * last):
            return size, turn + 1
        start[0] += dx
        start[1] += dy
        last = size
    return np.nan, _ROUNDS


@inlined
def _forces(m: int, i: int, network: Network, table: Floats, seen: Floats, force: Floats) -> None:
    """Force on oscillator `m` of setting `i` at every kick; `seen` holds those before it, in turn."""
    depth = len(seen)
    force[:] = network.constant[i, m]
    if m == 0:
        force += network.drive[i, 0] * table[:, :, 0] + network.drive[i, 1] * table[:, :, 1]
    else:
        force += network.lam[i, m] * seen[(m - 1) % depth]
    if network.other[i, m] != 0.0:
        force += network.other[i, m] * seen[(m + network.stride) % depth]


@compiled
def shoot_forward(
    state: Floats, lanes: Lanes, network: Network, table: Floats,
    harmonics: Complexes, tangent: Floats, defect: Floats, turns: Lanes,
) -> None:  # fmt: skip
    """Periodic orbits of open chains and grids, oscillator by oscillator, from the guesses in `state`.

    Parameters
    ----------
    state : float64, shape (L, 2n), all q then all p; row j belongs to setting ``lanes[j]``; changed in place.
    harmonics : complex128, shape (L, 8, n), receives mean and harmonics.
    tangent : float64, shape (L, n, 2, 2), receives the monodromy blocks.
    defect : float64, shape (L, n), receives the last relative correction, NaN where Newton failed.
    turns : int64, shape (L,), receives the Newton corrections made.
    The rest as in `network.advance_network`.
    """
    n, steps = network.lam.shape[1], table.shape[0]
    force, seen = np.empty((steps, 7)), np.empty((max(1, abs(network.stride)) + 1, steps, 7))
    samples, end, start, flows = np.empty(steps), np.empty(7), np.empty(2), np.empty((8, 3))
    for j in range(len(lanes)):
        i = lanes[j]
        h = network.period[i] / steps
        turns[j] = 0
        defect[j] = np.nan
        for m in range(n):
            start[0], start[1] = state[j, m], state[j, n + m]
            _forces(m, i, network, table, seen, force)
            _flows(network.delta[m], network.stiffness[i, m], h, flows)
            here = seen[m % len(seen)]
            defect[j, m], done = _newton(start, h, flows, force, network.beta[m], here, samples, end)
            turns[j] += done
            if np.isnan(defect[j, m]):
                break
            state[j, m], state[j, n + m] = start[0], start[1]
            tangent[j, m, 0, 0], tangent[j, m, 0, 1] = end[2], end[3]
            tangent[j, m, 1, 0], tangent[j, m, 1, 1] = end[4], end[5]
            _measure(samples, harmonics[j, :, m])


@inlined
def _joint_step(y: Floats, dy: Floats, flows: Floats, h: float, network: Network, i: int, phases: Floats) -> None:
    """One step of setting `i`: `y` is (2, n), q and p; `dy` is (2, n, 2n), their tangent."""
    q, p, dq, dp = y[0], y[1], dy[0], dy[1]
    n = len(q)
    for k in range(8):
        for m in range(n):
            c, g, d = flows[m, k, 0], flows[m, k, 1], flows[m, k, 2]
            q[m], p[m] = c * q[m] + g * p[m], c * p[m] - d * q[m]
            for w in range(2 * n):
                u, v = dq[m, w], dp[m, w]
                dq[m, w], dp[m, w] = c * u + g * v, c * v - d * u
        if k == 7:
            return
        b = KICKS[k] * h
        p[0] += b * (network.drive[i, 0] * phases[k, 0] + network.drive[i, 1] * phases[k, 1])
        for m in range(n):
            # Links that are not there have strength 0, wherever the index falls.
            before, second = (m - 1) % n, (m + network.stride) % n
            x, lam, other = q[m], network.lam[i, m], network.other[i, m]
            p[m] += b * (network.constant[i, m] + lam * q[before] + other * q[second] - network.beta[m] * x * x * x)
            own = -3.0 * b * network.beta[m] * x * x
            for w in range(2 * n):
                dp[m, w] += own * dq[m, w] + b * (lam * dq[before, w] + other * dq[second, w])


@compiled
def map_joint(
    state: Floats, lanes: Lanes, network: Network, table: Floats,
    end: Floats, tangent: Floats, high: Floats, harmonics: Complexes,
) -> None:  # fmt: skip
    """One period of coupled oscillators from `state`, shape (L, 2n): the end, the tangent and each one's size.

    `end` is float64, shape (L, 2n); `tangent` (L, 2n, 2n); `high` (L, n), the largest |q| or |p| at a step's
    start; `harmonics` complex128, shape (L, 8, n). The rest as in `shoot_forward`.
    """
    n, steps = network.lam.shape[1], table.shape[0]
    samples, flows = np.empty((n, steps)), np.empty((n, 8, 3))
    for j in range(len(lanes)):
        i = lanes[j]
        h = network.period[i] / steps
        y, dy = state[j].copy().reshape(2, n), np.eye(2 * n).reshape(2, n, 2 * n)
        for m in range(n):
            _flows(network.delta[m], network.stiffness[i, m], h, flows[m])
            high[j, m] = 0.0
        for s in range(steps):
            for m in range(n):
                samples[m, s] = y[0, m]
                high[j, m] = max(high[j, m], abs(y[0, m]), abs(y[1, m]))
            _joint_step(y, dy, flows, h, network, i, table[s])
        end[j] = y.reshape(2 * n)
        tangent[j] = dy.reshape(2 * n, 2 * n)
        for m in range(n):
            _measure(samples[m], harmonics[j, :, m])
