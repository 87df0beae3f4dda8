"""Every branch of one setting where oscillators act on each other: rings and bidirectional chains.

With one harmonic the last amplitude determines all others, from the last oscillator back to the first, and what drive
that takes:

    lam_m A_{m-1} = K_m(A_m) A_m - other_m A_{m+1},      D = K_1(A_1) A_1 - other_1 A_2  (- lam_1 A_n in a ring)

with K = k - omega^2 + i delta omega + 3/4 sign |A|^2. A common phase of all amplitudes only turns D. So with
A_n = a > 0 the answers are the roots of |D(a)| = epsilon, one equation in one real unknown, found to the last by
bisection with enclosures of |D| and of its slope. Each then starts Newton's method of the full equations.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..equations.basis import Basis, basis_for, resize
from ..equations.chain import Chain, Setting
from ..equations.scaled_chain import ScaledChain
from ..model.response import Outcome, Response, Stats
from ..rung import RUNGS, RungError, load_rung
from .answer import ORDERS, Answer, defect, finer, outcomes, response_of
from .joint import follow_load, newton_joint
from .joint_roots import Amplitudes, roots_of
from .march import March, branches_of, cubic_of, layer_of, means_under

__all__ = ["Branches", "joint_branches"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

SAME = 1e-5  # Relative distance below which two answers are one found twice.
NEAR = 0.2  # Relative distance that Newton may go from a single-harmonic answer to be its full one.
FIRST = 3
LAST = ORDERS[-2]
LOADS = (0.25, 0.5, 0.75, 1.0)
AGAIN = 60  # Starts beside one that led nowhere,
ASTRAY = np.array([0.003, 0.01, 0.03])  # so far from it, relative to each oscillator.
SCATTERED = 512  # Starts where no list of single-harmonic answers is to be had, fewer for more than six oscillators.
SEED = 20260101


@dataclass(frozen=True)
class Branches:
    """What was found.

    response : every branch along the batch axis, the smallest motion first.
    complete : whether every single-harmonic answer was found and each led to a full one of its own.
    """

    response: Response
    complete: bool


def joint_branches(chain: Chain, setting: Setting, *, tol: float, rung: str) -> Branches:
    """Every branch of one setting of a ring or a bidirectional chain.

    Parameters
    ----------
    tol : relative to each answer's largest amplitude.
    rung : one_harmonic, harmonic_balance, or static (no drive).

    With bias or preload, and with rung static, the starts are continued from those without and scattered: the list is
    then never called complete.

    Raises
    ------
    RungError
        For another rung, more than one setting, or a chain that can be solved in turn.
    """
    if rung not in RUNGS or not load_rung(rung).lists_branches:
        raise RungError(f"rung {rung}: it does not list every branch; use rung harmonic_balance or auto")
    if len(setting) != 1 or chain.feed_forward:
        raise RungError(f"start all: expected one setting of a ring or bidirectional chain, got {len(setting)}")
    began = time.perf_counter()
    with np.errstate(all="ignore"):
        scaled = ScaledChain.of(chain, setting)
        if rung == "static":
            basis, guesses, complete = basis_for(0, True), _static_starts(scaled), False
        else:
            basis = basis_for(1 if rung == "one_harmonic" else FIRST, scaled.has_mean)
            guesses, complete = _starts(scaled, basis)
        many, found, followed = _distinct(scaled, basis, guesses, whole=complete)
        response = _refined(many, rung, found, tol, began)
    return Branches(response, complete and followed)


def _starts(scaled: ScaledChain, basis: Basis) -> tuple[Floats, bool]:
    """Starts (n, d, J) in `basis`, and whether all single-harmonic answers are among them."""
    listed = roots_of(scaled)
    guesses = _coordinates(basis, listed)
    if listed.complete and not scaled.has_mean:
        return guesses, True
    if scaled.has_mean:
        for load in LOADS:
            lifted = _repeated(scaled, guesses.shape[2])
            moved = newton_joint(replace(lifted, force=load * lifted.force), basis, guesses)
            guesses = np.where(moved.ok, moved.x, guesses)
    return np.concatenate([guesses, _scattered(scaled, basis)], axis=2), False


def _coordinates(basis: Basis, listed: Amplitudes) -> Floats:
    x = np.zeros((len(listed.phasor), basis.size, listed.phasor.shape[1]))
    x[:, 0], x[:, 1] = listed.phasor.real, listed.phasor.imag
    return x


def _scattered(scaled: ScaledChain, basis: Basis) -> Floats:
    """Starts with amplitudes on any branch of each oscillator and any phases."""
    rng = np.random.default_rng(SEED)
    n, count = scaled.n, _scatter(scaled.n)
    shape, many = (n, count), _repeated(scaled, count)
    force = np.abs(scaled.drive) + rng.uniform(0, 1, shape) * np.abs(scaled.lam).max()
    cubic = cubic_of(layer_of(many, np.arange(n)), force.reshape(-1) + 0j)
    roots = np.sqrt(np.stack([cubic.lowest(), cubic.middle(), cubic.highest()]) / (0.75 * np.abs(cubic.strength)))
    size = roots.reshape(3, n, count)[rng.integers(0, 3, shape), np.arange(n)[:, None], np.arange(count)]
    size = np.where(np.isfinite(size), size, np.abs(scaled.drive))
    phasor = size * np.exp(2j * np.pi * rng.uniform(0, 1, shape))
    x = np.zeros((n, basis.size, count))
    x[:, 0], x[:, 1] = phasor.real, phasor.imag
    if basis.mean:
        x[:, -1] = means_under(many, phasor)
    return x


def _scatter(n: int) -> int:
    return max(8, min(SCATTERED, 6 * SCATTERED // n))


def _static_starts(scaled: ScaledChain) -> Floats:
    """Every oscillator in its well or beyond either of its hilltops; a scatter of them where that is too many."""
    n, sides = scaled.n, np.array([-1.0, 0.0, 1.0])
    top = np.sqrt(np.abs(scaled.k[:, 0]) / np.maximum(np.abs(scaled.of_each(scaled.sign)), 1e-300))
    if 3**n <= SCATTERED:
        picked = np.stack(np.meshgrid(*[sides] * n, indexing="ij")).reshape(n, -1)
    else:
        picked = np.random.default_rng(SEED).choice(sides, (n, _scatter(n)))
        picked[:, 0] = 0.0
    return (picked * np.minimum(top, 1e3)[:, None])[:, None]


def _repeated(scaled: ScaledChain, count: int) -> ScaledChain:
    return scaled.pick(np.zeros(count, dtype=np.intp))


def _distinct(scaled: ScaledChain, basis: Basis, guesses: Floats, *, whole: bool) -> tuple[ScaledChain, March, bool]:
    """The different answers Newton finds from `guesses`, by size; and whether there is one for each start.

    With `whole` the starts are single-harmonic answers: a start that leads far away has found another's.
    """
    grown = follow_load(scaled, basis)
    x, steps = _converged(scaled, basis, guesses, NEAR if whole else np.inf)
    lost = ~np.isfinite(x).all(axis=(0, 1))
    parts = [grown.x[:, :, grown.ok], x[:, :, ~lost]]
    if whole and lost.any():
        again, more = _converged(scaled, basis, _beside(guesses[:, :, lost]), NEAR)
        parts.append(again[:, :, np.isfinite(again).all(axis=(0, 1))])
        steps += more
    x = _unlike(np.concatenate(parts, axis=2))
    count = x.shape[2]
    if not count:
        x = np.zeros((scaled.n, basis.size, 1))
    many = _repeated(scaled, x.shape[2])
    ok = np.full(x.shape[2], count > 0)
    found = March(basis, x, ok, branches_of(many, basis, x), grown.steps + steps)
    return many, found, count >= guesses.shape[2]


def _converged(scaled: ScaledChain, basis: Basis, guesses: Floats, near: float) -> tuple[Floats, int]:
    """Where Newton goes from each start, NaN where nowhere or too far; and its steps."""
    solved = newton_joint(_repeated(scaled, guesses.shape[2]), basis, guesses)
    size = np.abs(solved.x).max(axis=(0, 1))
    away = np.abs(solved.x - guesses).max(axis=(0, 1)) / np.where(size > 0, size, 1.0)
    return np.where(solved.ok & (away <= near), solved.x, np.nan), solved.steps


def _beside(guesses: Floats) -> Floats:
    """Starts scattered around each: beside a fold of the full equations the way in is narrow."""
    many = np.repeat(guesses, AGAIN, axis=2)
    noise = np.random.default_rng(SEED).standard_normal(many.shape) * np.tile(ASTRAY, many.shape[2] // len(ASTRAY))
    beside: Floats = many + noise * np.abs(many).max(axis=1, keepdims=True)
    return beside


def _unlike(x: Floats) -> Floats:
    """Each answer once, by size."""
    size = np.sqrt((x**2).sum(axis=(0, 1)))
    order = np.argsort(size, kind="stable")
    kept: list[int] = []
    for at in order:
        twin = False
        for other in reversed(kept):
            if size[other] < (1 - 2 * SAME) * size[at]:
                break
            twin = twin or bool(np.sqrt(((x[:, :, at] - x[:, :, other]) ** 2).sum()) <= SAME * size[at])
        if not twin:
            kept.append(int(at))
    return x[:, :, kept]


def _refined(scaled: ScaledChain, rung: str, found: March, tol: float, began: float) -> Response:
    """All branches with as many harmonics as the worst of them needs."""
    branch, steps, before = found.branch, found.steps, np.inf
    estimate = defect(scaled, found.basis, found.x)
    while rung == "harmonic_balance" and found.basis.order < LAST:
        worst = float(estimate[found.ok].max(initial=0.0))
        if worst <= tol or worst > 0.5 * before:
            break
        basis, before = finer(found.basis), worst
        sharper = newton_joint(scaled, basis, np.stack([resize(x, found.basis, basis) for x in found.x]))
        found, steps = replace(sharper, ok=sharper.ok & found.ok), steps + sharper.steps
        estimate = defect(scaled, basis, found.x)
    outcome = outcomes(len(scaled), Outcome.OK)
    if rung == "harmonic_balance":
        outcome[~(estimate <= tol)] = Outcome.OUT_OF_BUDGET
    outcome[~found.ok] = Outcome.NO_CONVERGENCE
    work = Stats(newton_steps=steps, oscillators_solved=scaled.n * len(scaled))
    return response_of(scaled, rung, Answer(found.basis, found.x, outcome, branch, estimate), work, began)
