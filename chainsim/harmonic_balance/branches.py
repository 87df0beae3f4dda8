"""Every branch of one setting: a tree over the oscillators, since each of an oscillator's answers drives the next."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..equations.basis import Basis
from ..equations.scaled_chain import ScaledChain
from ..rung import RungError
from .balance import Oscillator, newton
from .march import March, cubic_of, first_phasor, oscillator, push
from .starts import mean_starts

__all__ = ["all_branches"]

Floats = NDArray[np.float64]

MAX_BRANCHES = 2048
# Answers nearer than this, relative to their size, are the same answer found twice.
SAME = 1e-6


def all_branches(scaled: ScaledChain, basis: Basis) -> March:
    """Every answer of the one setting of `scaled`, along the batch axis; the lowest at every oscillator first.

    Raises
    ------
    RungError
        When there are more than 2048.
    """
    x, branch = np.empty((0, basis.size, 1)), np.empty((0, 1), dtype=np.int8)
    steps = 0
    for m in range(scaled.n):
        paths = scaled.pick(np.zeros(x.shape[2], dtype=np.intp))
        force = push(paths, basis, m, x)
        found, path, work = _answers(oscillator(scaled, m), basis, force)
        steps += work
        if len(path) > MAX_BRANCHES:
            raise RungError(f"more than {MAX_BRANCHES} branches by oscillator {m}; use start rest, or a shorter chain")
        x = np.concatenate([x[:, :, path], found[None]])
        branch = np.concatenate([branch[:, path], _ranks(path)[None]])
    return March(basis, x, np.ones(x.shape[2], dtype=bool), branch, steps)


def _ranks(path: NDArray[np.intp]) -> NDArray[np.int8]:
    """Low, middle, high of the answers of each path, which stand one after the other; low and high of two."""
    count = np.bincount(path)[path] if len(path) else path
    rank = np.arange(len(path)) - np.searchsorted(path, path)
    return np.where((count == 2) & (rank == 1), 2, rank).astype(np.int8)


def _answers(osc: Oscillator, basis: Basis, force: Floats) -> tuple[Floats, NDArray[np.intp], int]:
    """The distinct answers (d, B) of one oscillator under each `force` (d, P) by size, whose they are, the steps."""
    many = osc.pick(np.zeros(force.shape[1], dtype=np.intp))
    starts, path = _starts(many, basis, force)
    solved = newton(basis, many.pick(path), force[:, path], starts)
    x, path = solved.x[:, solved.ok], path[solved.ok]
    size = np.hypot(x[0], x[1]) if basis.order else np.abs(x[0])
    order = np.lexsort((size, path))
    x, path = x[:, order], path[order]
    new = np.ones(len(path), dtype=bool)
    # Answers of one size may differ in phase, so each is held against all of its path before it: at most four.
    for back in range(1, 5):
        twin = (path[back:] == path[:-back]) & (
            np.abs(x[:, back:] - x[:, :-back]).max(axis=0) <= SAME * np.abs(x[:, back:]).max(axis=0)
        )
        new[back:] &= ~twin
    return x[:, new], path[new], solved.steps


def _starts(osc: Oscillator, basis: Basis, force: Floats) -> tuple[Floats, NDArray[np.intp]]:
    """Starts for Newton, shape (d, J), and which force each belongs to.

    They are the single-harmonic roots and the folds between them; a fold leads to the answer beside it when the true
    fold lies elsewhere.
    """
    if not basis.order:
        points = [_rest_points(osc, float(constant)) for constant in force[-1]]
        return np.concatenate(points)[None], np.repeat(np.arange(len(points)), [len(each) for each in points])
    drive = first_phasor(force)
    kappa, g = osc.k - osc.omega**2, osc.delta * osc.omega
    means = np.zeros((1, len(drive)))
    if not osc.sign.any():
        phasors = (drive / (kappa + 1j * g))[None]
        if basis.mean:
            means = (force[-1] / osc.k)[None]
    elif basis.mean and force[-1].any():
        phasors, means = mean_starts(kappa, g, osc.k, osc.sign, drive, force[-1])
    else:
        cubic = cubic_of(osc, drive)
        roots = [cubic.lowest(), cubic.middle(), cubic.highest()]
        folds = [np.where(cubic.folded, v, np.nan) for v in (cubic.peak, cubic.dip)]
        phasors = np.stack([cubic.amplitude(v, drive) for v in (*roots, *folds)])
    which, path = np.nonzero(np.isfinite(phasors))
    starts = np.zeros((basis.size, len(path)))
    chosen = phasors[which, path]
    starts[0], starts[1] = chosen.real, chosen.imag
    if basis.mean:
        starts[-1] = np.broadcast_to(means, phasors.shape)[which, path]
    return starts, path


def _rest_points(osc: Oscillator, constant: float) -> Floats:
    """Real roots of ``sign c^3 + k c = constant``."""
    k = float(osc.k[0])
    sign = float(osc.sign[0])
    roots = np.roots([sign, 0.0, k, -constant]) if sign else np.array([constant / k])
    real: Floats = np.real(roots[np.abs(np.imag(roots)) <= 1e-7 * (1 + np.abs(roots))])
    return real
