"""Floquet multipliers of oscillators that act on each other: eigenvalues of the whole monodromy matrix.

About an orbit z the deviations obey ``x_m'' + delta_m x_m' + (k_m + 3 sign_m z_m^2) x_m = links``, a linear system of
period 2 pi/omega. Its matrix over one period is a composition of exact flows of each oscillator alone and kicks by
links and cubic terms, ABA(8,6,4) of Blanes, Casas, Farres, Laskar, Makazaga and Murua, Appl. Numer. Math. 68 (2013)
58-72: n^2 operations a step, where a product of matrices takes n^3.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .basis import Basis
from .scaling import Stages

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

_A = (0.0711334264982231177779387300061549964174, 0.241153427956640098736487795326289649618,
      0.521411761772814789212136078067994229991, -0.333698616227678005726562603400438876027)  # fmt: skip
_B = (0.183083687472197221961703757166430291072, 0.310782859898574869507522291054262796375,
      -0.0265646185119588006972121379164987592663, 0.0653961422823734184559721793911134363710)  # fmt: skip
FLOWS = (*_A, *_A[::-1])
KICKS = (*_B, *_B[2::-1])
KICK_TIMES = np.cumsum(FLOWS)[:7]


def joint_multipliers(stages: Stages, basis: Basis, x: Floats) -> Complexes:
    """All 2n multipliers in pairs, the largest first; complex128, shape (N, n, 2), NaN where not resolved.

    x : float64, shape (n, d, N), scaled coordinates of the orbit in `basis`.
    """
    n, size = stages.n, len(stages)
    found = np.full((size, 2 * n), np.nan, dtype=np.complex128)
    if n > MOST_JOINT:
        return found.reshape(size, n, 2)
    # An odd series has z^2 of half the period: the monodromy is the square of that of half a turn.
    halves = 1 if basis.mean else 2
    block = max(1, CHUNK // (4 * n * n))
    for first in range(0, size, block):
        part = np.arange(first, min(first + block, size))
        matrices = _refined(stages.pick(part), basis, x[:, :, part], 2 * np.pi / halves)
        for j, matrix in zip(part, matrices, strict=True):
            if np.isfinite(matrix).all():
                values = np.linalg.eigvals(matrix).astype(np.complex128) ** halves
                found[j] = values[np.argsort(-np.abs(values), kind="stable")]
    return found.reshape(size, n, 2)


def rest_multipliers(stages: Stages) -> Complexes:
    """exp(s T) of the eigenvalues s of the chain without its cubic term; complex128, shape (N, n, 2)."""
    n, size = stages.n, len(stages)
    if n > MOST_JOINT:
        return np.full((size, n, 2), np.nan, dtype=np.complex128)
    exponents = np.linalg.eigvals(rest_matrix(stages) * stages.omega[:, None, None]).astype(np.complex128)
    turned: Complexes = np.exp(exponents * (2 * np.pi / stages.omega)[:, None])
    return turned.reshape(size, n, 2)


def rest_matrix(stages: Stages) -> Floats:
    """The system's matrix per radian of the drive, without the cubic term; float64, shape (N, 2n, 2n)."""
    n, size = stages.n, len(stages)
    m, omega = np.arange(n), stages.omega[:, None]
    system = np.zeros((size, 2 * n, 2 * n))
    system[:, m, n + m] = 1.0
    system[:, n + m, n + m] = -stages.of_each(stages.delta) / omega
    system[:, n + m, m] = -stages.k.T / omega**2
    for fed, source, link in stages.links():
        system[:, n + fed, source] += link.T / omega**2
    return system


def _refined(stages: Stages, basis: Basis, x: Floats, span: float) -> Floats:
    """The monodromy over `span`, shape (N, 2n, 2n), the steps doubled until two agree; NaN where they never do."""
    found = np.full((len(stages), 2 * stages.n, 2 * stages.n), np.nan)
    largest = np.abs(stages.k) + 3 * np.abs(stages.sign) * np.abs(x).sum(axis=1) ** 2
    for _, source, link in stages.links():
        largest[source] += np.abs(link)
    turns = np.maximum(np.sqrt(largest.max(axis=0)) / stages.omega, max(0.5 * basis.order, 1.0)) * (span / np.pi)
    known = np.isfinite(turns) & (turns <= MAX_STEPS / 8)
    levels = 4 * 2 ** np.ceil(np.log2(np.where(known, turns, 1.0))).astype(np.intp)
    for level in np.unique(levels[known]):
        lanes, steps = np.flatnonzero(known & (levels == level)), int(level)
        coarse = _map(stages.pick(lanes), basis, x[:, :, lanes], span, steps)
        while len(lanes) and steps < MAX_STEPS:
            steps *= 2
            fine = _map(stages.pick(lanes), basis, x[:, :, lanes], span, steps)
            gap, size = np.abs(fine - coarse).max(axis=(1, 2)), np.abs(fine).max(axis=(1, 2))
            same = gap <= AGREEMENT * size
            found[lanes[same]] = fine[same]
            left = ~same & np.isfinite(gap)
            lanes, coarse = lanes[left], fine[left]
    return found


def _map(stages: Stages, basis: Basis, x: Floats, span: float, steps: int) -> Floats:
    """Deviations (q, p = v + delta/2 q) after `span` from every unit deviation; float64, shape (N, 2n, 2n)."""
    n, size, h = stages.n, len(stages), span / steps
    unit = np.broadcast_to(np.eye(2 * n), (size, 2 * n, 2 * n))
    q, p = unit[:, :n].copy(), unit[:, n:].copy()
    square = (stages.omega**2)[:, None, None]
    slope = 3 * stages.of_each(stages.sign)[:, None] / square
    links = [(fed, source, link.T[:, :, None] / square) for fed, source, link in stages.links()]
    flows = [_flow(stages, length * h) for length in FLOWS]
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


def _flow(stages: Stages, angle: float) -> tuple[Floats, Floats, Floats]:
    """Coefficients (N, n, 1) of ``q' = c q + s p, p' = c p - d q`` of each oscillator alone over `angle`."""
    half = 0.5 * stages.delta / stages.omega
    square = stages.k / stages.omega**2 - half**2
    root = np.sqrt(np.abs(square))
    # exp(-half angle) goes into the hyperbolic functions, which would overflow without it.
    up, down = np.exp((root - half) * angle), np.exp(-(root + half) * angle)
    safe, decay = np.where(root > 0, root, 1.0), np.exp(-half * angle)
    c = np.where(square < 0, 0.5 * (up + down), decay * np.cos(root * angle))
    s = np.where(square < 0, 0.5 * (up - down), decay * np.sin(root * angle)) / safe
    s = np.where(root > 0, s, decay * angle)
    found = c, s, square * s
    return tuple(part.T[:, :, None] for part in found)  # type: ignore[return-value]
