"""Floquet multipliers of oscillators that act on each other: eigenvalues of the whole monodromy matrix.

About an orbit z the deviations obey ``x_m'' + delta_m x_m' + (k_m + 3 sign_m z_m^2) x_m = links``, a linear system of
period 2 pi/omega. Its matrix over one period is a composition of exact flows of each oscillator alone and kicks by
links and cubic terms (`composition`): n^2 operations a step, where a product of matrices takes n^3.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..equations.basis import Basis
from ..equations.composition import FLOWS, KICK_TIMES, KICKS
from ..equations.scaled_chain import ScaledChain

__all__ = ["MOST_JOINT", "joint_multipliers", "rest_matrix", "rest_multipliers"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

MOST_JOINT = 200
"""Oscillators up to which the whole matrix is formed; its eigenvalues cost n^3 (2 s at 200)."""

# Agreement of two step sizes, relative to the matrix; the finer is then closer by 2^4 at least.
AGREEMENT = 1e-8
MAX_STEPS = 8192
# Numbers held at once for all settings of a block.
CHUNK = 1_000_000

# Where steps are too long or too many, multipliers come from the frozen system at so many points of the orbit.
FROZEN = 64
# Decay over a period from which on a multiplier is as good as 0.
DEAD = 40.0
MOST_GROWTH = 690.0
# Rates per radian of the drive above which the orbit is slow beside them, and below which they see its mean.
FAST, IDLE = 50.0, 0.02
# Swings per radian of the drive from which on the frozen system is asked first: it costs less and errs less.
MANY_SWINGS = 200.0


def joint_multipliers(scaled: ScaledChain, basis: Basis, x: Floats) -> Complexes:
    """All 2n multipliers in pairs, the largest first; complex128, shape (N, n, 2), NaN where not resolved.

    x : float64, shape (n, d, N), scaled coordinates of the orbit in `basis`.
    """
    n, size = scaled.n, len(scaled)
    found = np.full((size, 2 * n), np.nan, dtype=np.complex128)
    if n > MOST_JOINT:
        return found.reshape(size, n, 2)
    # An odd series has z^2 of half the period: the monodromy is the square of that of half a turn.
    halves = 1 if basis.mean else 2
    known = np.isfinite(x).all(axis=(0, 1))
    many = _swings(scaled, x) > MANY_SWINGS
    _fill_frozen(found, scaled, basis, x, known & many)
    todo = np.flatnonzero(known & ~np.isfinite(found).all(axis=1))
    block = max(1, CHUNK // (4 * n * n))
    for first in range(0, len(todo), block):
        part = todo[first : first + block]
        matrices = _refined(scaled.pick(part), basis, x[:, :, part], 2 * np.pi / halves)
        for j, matrix in zip(part, matrices, strict=True):
            if np.isfinite(matrix).all():
                found[j] = _largest_first(np.linalg.eigvals(matrix).astype(np.complex128) ** halves)
    _fill_frozen(found, scaled, basis, x, known & ~many & ~np.isfinite(found).all(axis=1))
    return found.reshape(size, n, 2)


def _fill_frozen(found: Complexes, scaled: ScaledChain, basis: Basis, x: Floats, lanes: NDArray[np.bool_]) -> None:
    for j in np.flatnonzero(lanes):
        lane = np.array([j])
        found[j] = _largest_first(_frozen(scaled.pick(lane), basis, x[:, :, lane]))


def _swings(scaled: ScaledChain, x: Floats) -> Floats:
    """A bound of the fastest swing about the orbit, per radian of the drive; float64, shape (N,)."""
    largest = np.abs(scaled.k) + 3 * np.abs(scaled.sign) * np.abs(x).sum(axis=1) ** 2
    for _, source, link in scaled.links():
        largest[source] += np.abs(link)
    fastest: Floats = np.sqrt(largest.max(axis=0)) / scaled.omega
    return fastest


def _largest_first(values: Complexes) -> Complexes:
    return values[np.argsort(-np.abs(values), kind="stable")]


def _frozen(scaled: ScaledChain, basis: Basis, x: Floats) -> Complexes:
    """Multipliers (2n,) of one setting as ``exp(mean over the orbit of the eigenvalues at rest in it)``; NaN if untrue.

    True of rates far above the drive's, of rates so far below that only the mean counts, of those that hardly change
    along the orbit, and of those so strongly damped that their multiplier is 0.
    """
    square = (basis.evaluate_at(2 * np.pi * (np.arange(FROZEN) + 0.5) / FROZEN) @ x[:, :, 0].T) ** 2
    added = 3 * scaled.of_each(scaled.sign) * np.concatenate([square.mean(axis=0)[None], square])
    many = scaled.pick(np.zeros(FROZEN + 1, dtype=np.intp))
    matrices = rest_matrix(replace(many, k=many.k + added.T))
    if not np.isfinite(matrices).all():
        return np.full(2 * scaled.n, np.nan, dtype=np.complex128)
    mean, *each = np.linalg.eigvals(matrices).astype(np.complex128)
    moved = np.stack([values[np.abs(values - mean[:, None]).argmin(axis=1)] for values in each])
    change = np.abs(moved - mean).max(axis=0)
    slow = (np.abs(mean) >= FAST) | (np.abs(mean) <= IDLE) | (change <= 0.1 * np.abs(mean.real))
    dead = 2 * np.pi * moved.real.max(axis=0) < -DEAD
    apart = np.abs(mean[:, None] - mean) + np.where(np.eye(len(mean), dtype=bool), np.inf, 0.0)
    alone = change <= 0.5 * apart.min(axis=1)
    turned = _turned(2 * np.pi * moved.mean(axis=0))
    return turned if (dead | (slow & alone)).all() else np.full_like(turned, np.nan)


def rest_multipliers(scaled: ScaledChain) -> Complexes:
    """exp(s T) of the eigenvalues s of the chain without its cubic term; complex128, shape (N, n, 2)."""
    n, size = scaled.n, len(scaled)
    if n > MOST_JOINT:
        return np.full((size, n, 2), np.nan, dtype=np.complex128)
    exponents = np.linalg.eigvals(rest_matrix(scaled) * scaled.omega[:, None, None]).astype(np.complex128)
    return _turned(exponents * (2 * np.pi / scaled.omega)[:, None]).reshape(size, n, 2)


def _turned(exponents: Complexes) -> Complexes:
    """exp, short of overflow: a multiplier of 10^300 is as unstable as a larger one."""
    turned: Complexes = np.exp(np.minimum(exponents.real, MOST_GROWTH) + 1j * exponents.imag)
    return turned


def rest_matrix(scaled: ScaledChain) -> Floats:
    """The system's matrix per radian of the drive, without the cubic term; float64, shape (N, 2n, 2n)."""
    n, size = scaled.n, len(scaled)
    m, omega = np.arange(n), scaled.omega[:, None]
    system = np.zeros((size, 2 * n, 2 * n))
    system[:, m, n + m] = 1.0
    system[:, n + m, n + m] = -scaled.of_each(scaled.delta) / omega
    system[:, n + m, m] = -scaled.k.T / omega**2
    for fed, source, link in scaled.links():
        system[:, n + fed, source] += link.T / omega**2
    return system


def _refined(scaled: ScaledChain, basis: Basis, x: Floats, span: float) -> Floats:
    """The monodromy over `span`, shape (N, 2n, 2n), the steps doubled until two agree; NaN where they never do."""
    found = np.full((len(scaled), 2 * scaled.n, 2 * scaled.n), np.nan)
    turns = np.maximum(_swings(scaled, x), max(0.5 * basis.order, 1.0)) * (span / np.pi)
    known = np.isfinite(turns) & (turns <= MAX_STEPS / 8)
    levels = 4 * 2 ** np.ceil(np.log2(np.where(known, turns, 1.0))).astype(np.intp)
    for level in np.unique(levels[known]):
        lanes, steps = np.flatnonzero(known & (levels == level)), int(level)
        coarse = _map(scaled.pick(lanes), basis, x[:, :, lanes], span, steps)
        while len(lanes) and steps < MAX_STEPS:
            steps *= 2
            fine = _map(scaled.pick(lanes), basis, x[:, :, lanes], span, steps)
            gap, size = np.abs(fine - coarse).max(axis=(1, 2)), np.abs(fine).max(axis=(1, 2))
            same = gap <= AGREEMENT * size
            found[lanes[same]] = fine[same]
            left = ~same & np.isfinite(gap)
            lanes, coarse = lanes[left], fine[left]
    return found


def _map(scaled: ScaledChain, basis: Basis, x: Floats, span: float, steps: int) -> Floats:
    """Deviations (q, p = v + delta/2 q) after `span` from every unit deviation; float64, shape (N, 2n, 2n)."""
    n, size, h = scaled.n, len(scaled), span / steps
    unit = np.broadcast_to(np.eye(2 * n), (size, 2 * n, 2 * n))
    q, p = unit[:, :n].copy(), unit[:, n:].copy()
    square = (scaled.omega**2)[:, None, None]
    slope = 3 * scaled.of_each(scaled.sign)[:, None] / square
    links = [(fed, source, link.T[:, :, None] / square) for fed, source, link in scaled.links()]
    flows = [_flow(scaled, length * h) for length in FLOWS]
    z = basis.evaluate_at(((np.arange(steps)[:, None] + KICK_TIMES) * h).reshape(-1)) @ x.reshape(n, basis.size, size)
    for step in range(steps):
        for k, (c, s, d) in enumerate(flows):
            q, p = c * q + s * p, c * p - d * q
            if k < len(KICKS):
                force = -slope * (z[:, 7 * step + k] ** 2).T[:, :, None] * q
                for fed, source, link in links:
                    force[:, fed] += link * q[:, source]
                p += (KICKS[k] * h) * force
    return np.concatenate([q, p], axis=1)


def _flow(scaled: ScaledChain, angle: float) -> tuple[Floats, Floats, Floats]:
    """Coefficients (N, n, 1) of ``q' = c q + s p, p' = c p - d q`` of each oscillator alone over `angle`."""
    half = 0.5 * scaled.delta / scaled.omega
    square = scaled.k / scaled.omega**2 - half**2
    root = np.sqrt(np.abs(square))
    # exp(-half angle) goes into the hyperbolic functions, which would overflow without it.
    up, down = np.exp((root - half) * angle), np.exp(-(root + half) * angle)
    safe, decay = np.where(root > 0, root, 1.0), np.exp(-half * angle)
    c = np.where(square < 0, 0.5 * (up + down), decay * np.cos(root * angle))
    s = np.where(square < 0, 0.5 * (up - down), decay * np.sin(root * angle)) / safe
    s = np.where(root > 0, s, decay * angle)
    found = c, s, square * s
    return tuple(part.T[:, :, None] for part in found)  # type: ignore[return-value]
