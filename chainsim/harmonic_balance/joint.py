"""All oscillators at once, where they act on each other (ring, bidirectional): Newton on the coupled balance equations.

Row m of the Jacobian has the block J_m of the oscillator alone, and minus the link times the identity at each of its
two neighbours. In the order that the coupling law gives neighbours are at most two apart also round a ring, so
elimination with row exchanges stays in a band: time and memory are O(n).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..equations.basis import Basis, resize
from ..equations.scaled_chain import ScaledChain
from .balance import linearise
from .march import March, branches_of, layer_of

__all__ = ["band_step", "correct_joint", "follow_load", "newton_joint", "rounding_of"]

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Wholes = NDArray[np.intp]

SMALL_STEP = 1e-9
MAX_STEPS = 20
# Unknowns up to which the whole matrix is factored, many settings per call; beyond, a band for each setting.
DENSE = 160
# Following the load from 0: a step is taken when Newton moves its prediction by less than this altogether (by more, it
# could be another branch), and is given up (a fold) below the second number.
CLOSE = 0.15
SHORTEST = 1e-4
# Perturbation whose effect is the rounding error of an answer.
ROUNDING = 4e-16


@dataclass(frozen=True)
class _Solved:
    """x : float64, shape (n, d, N). ok : bool, shape (N,). steps : summed up."""

    x: Floats
    ok: Bools
    steps: int


def newton_joint(scaled: ScaledChain, basis: Basis, guess: Floats) -> March:
    """Solve the whole chain in `basis` from `guess` (n, d, N)."""
    solved = _newton(scaled, basis, guess, np.ones(len(scaled)))
    return March(basis, solved.x, solved.ok, branches_of(scaled, basis, solved.x), solved.steps)


def follow_load(scaled: ScaledChain, basis: Basis) -> March:
    """The answer that grows from rest as every force is raised from 0; not `ok` where it ends in a fold before 1."""
    n, size = scaled.n, len(scaled)
    rest = np.zeros((n, basis.size, size))
    x, before = rest.copy(), rest.copy()
    load, last, step = np.zeros(size), np.zeros(size), np.ones(size)
    ok, count = np.zeros(size, dtype=bool), 0
    active = np.arange(size)
    while len(active):
        here = scaled.pick(active)
        target = np.minimum(load[active] + step[active], 1.0)
        guess = _predict(here, basis, x[:, :, active], before[:, :, active], load[active], last[active], target)
        solved = _newton(here, basis, guess, target)
        count += solved.steps
        with np.errstate(all="ignore"):
            away, large = (np.abs(each).max(axis=(0, 1)) for each in (solved.x - guess, solved.x))
        good = solved.ok & (away <= CLOSE * large)
        won, lost = active[good], active[~good]
        before[:, :, won], last[won] = x[:, :, won], load[won]
        x[:, :, won], load[won] = solved.x[:, :, good], target[good]
        step[won] *= 2.0
        step[lost] = 0.5 * (target[~good] - load[lost])
        ok[won] = load[won] == 1.0
        active = active[~ok[active] & (step[active] >= SHORTEST)]
    return March(basis, x, ok, branches_of(scaled, basis, x), count)


def _predict(
    scaled: ScaledChain, basis: Basis, x: Floats, before: Floats, load: Floats, last: Floats, target: Floats
) -> Floats:
    """Where the answer will be at the load `target`: on the line through the last two, or the tangent at rest."""
    with np.errstate(all="ignore"):
        onward = x + (x - before) * ((target - load) / (load - last))
    fresh = load == 0
    if fresh.any():
        onward[:, :, fresh] = correct_joint(scaled, basis, np.zeros_like(x), basis, target)[:, :, fresh]
    return onward


def correct_joint(scaled: ScaledChain, basis: Basis, x: Floats, old: Basis, load: Floats | float = 1.0) -> Floats:
    """One Newton step of all oscillators in `basis` from x (n, d, N) in `old`, the forces times `load`."""
    jacobian, right = _equations(scaled, basis, resize(x.transpose(1, 0, 2), old, basis).transpose(1, 0, 2), load)
    return _solve(scaled, jacobian, right)


def band_step(scaled: ScaledChain, basis: Basis, x: Floats, old: Basis, before: Floats | None) -> Floats:
    """The same for one setting, always by a band; `before` (d, 1) acts on the first oscillator as well."""
    jacobian, right = _equations(scaled, basis, resize(x.transpose(1, 0, 2), old, basis).transpose(1, 0, 2), 1.0)
    if before is not None:
        right[0] += before
    return _in_band(scaled, jacobian[..., 0], right[..., 0], 0)[:, :, None]


def rounding_of(scaled: ScaledChain, basis: Basis, x: Floats) -> Floats:
    """What rounding of the equations does to x, relative to its largest coordinate; float64, shape (N,)."""
    jacobian, _ = _equations(scaled, basis, x, 1.0)
    signs = np.where(np.arange(scaled.n * basis.size) * 0.6180339887 % 1 < 0.5, -1.0, 1.0).reshape(x.shape[:2])
    size = np.abs(x).max(axis=(0, 1))
    moved = _solve(scaled, jacobian, signs[:, :, None] * np.abs(jacobian).max(axis=(1, 2))[:, None])
    relative: Floats = ROUNDING * (1 + np.abs(moved).max(axis=(0, 1)))
    return np.where(size == 0, ROUNDING, relative)


def _newton(scaled: ScaledChain, basis: Basis, guess: Floats, load: Floats) -> _Solved:
    size = guess.shape[2]
    x, ok, count = guess.copy(), np.zeros(size, dtype=bool), 0
    active = np.arange(size)
    for _ in range(MAX_STEPS):
        here = x[:, :, active]
        moved = correct_joint(scaled.pick(active), basis, here, basis, load[active])
        count += len(active) * scaled.n
        with np.errstate(all="ignore"):
            length, large = np.abs(moved - here).max(axis=(0, 1)), np.abs(moved).max(axis=(0, 1))
            settled = length <= SMALL_STEP * large
        x[:, :, active] = moved
        ok[active] = settled
        active = active[~settled & np.isfinite(large)]
        if not len(active):
            break
    return _Solved(x, ok, count)


def _equations(scaled: ScaledChain, basis: Basis, x: Floats, load: Floats | float) -> tuple[Floats, Floats]:
    """Blocks J_m (n, d, d, N) of the oscillators alone, and the right sides (n, d, N) of Newton's next x."""
    n, d, size = x.shape
    osc = layer_of(scaled, np.arange(n))
    blocks, twice = linearise(basis, osc.coefficients(basis), osc.sign, x.transpose(1, 0, 2).reshape(d, -1))
    jacobian = blocks.reshape(d, d, n, size).transpose(2, 0, 1, 3)
    right = np.array(twice.reshape(d, n, size).transpose(1, 0, 2))
    if basis.order:
        right[0, 0] += load * scaled.drive.real
        right[0, 1] += load * scaled.drive.imag
    if basis.mean:
        right[:, -1] += load * scaled.force
    return jacobian, right


def _solve(scaled: ScaledChain, jacobian: Floats, right: Floats) -> Floats:
    """Solve the coupled linear equations; NaN where they are singular."""
    n, d, size = right.shape
    if n * d > DENSE:
        return np.stack([_in_band(scaled, jacobian[..., j], right[..., j], j) for j in range(size)], axis=2)
    matrix = np.zeros((size, n, d, n, d))
    each = np.arange(d)
    for m in range(n):
        matrix[:, m, :, m, :] = jacobian[m].transpose(2, 0, 1)
    for fed, source, link in scaled.links():
        for at in each:
            matrix[:, fed, at, source, at] -= link.T
    stacked = right.transpose(2, 0, 1).reshape(size, n * d)
    found = _each_or_nan(matrix.reshape(size, n * d, n * d), stacked)
    return found.reshape(size, n, d).transpose(1, 2, 0)


def _each_or_nan(matrix: Floats, right: Floats) -> Floats:
    finite = np.isfinite(matrix).all(axis=(1, 2)) & np.isfinite(right).all(axis=1)
    found = np.full_like(right, np.nan)
    try:
        found[finite] = np.linalg.solve(matrix[finite], right[finite][..., None])[..., 0]
    except np.linalg.LinAlgError:
        for j in np.flatnonzero(finite):
            try:
                found[j] = np.linalg.solve(matrix[j], right[j])
            except np.linalg.LinAlgError:
                continue
    return found


def _in_band(scaled: ScaledChain, jacobian: Floats, right: Floats, setting: int) -> Floats:
    """One setting: blocks (n, d, d) and right side (n, d), by banded elimination with row exchanges."""
    from scipy.linalg import LinAlgError, solve_banded

    n, d = right.shape
    place, links = scaled.law.places(n), scaled.links()
    reach = d * max([1, *(int(np.abs(place[fed] - place[source]).max(initial=0)) for fed, source, _ in links)])
    band = np.zeros((2 * reach + 1, n * d))
    row, column = np.arange(d)[:, None], np.arange(d)
    start = (place * d)[:, None, None]
    band[np.broadcast_to(reach + row - column, (n, d, d)), np.broadcast_to(start + column, (n, d, d))] = jacobian
    for fed, source, link in links:
        apart = reach + (place[fed] - place[source]) * d
        np.subtract.at(band, (apart[:, None], place[source][:, None] * d + column), link[:, setting, None])
    ordered = np.empty((n, d))
    ordered[place] = right
    try:
        found = solve_banded((reach, reach), band, ordered.reshape(-1), overwrite_ab=True)
    except (LinAlgError, ValueError):
        return np.full((n, d), np.nan)
    answer: Floats = found.reshape(n, d)[place]
    return answer
