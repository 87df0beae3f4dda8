"""Every branch of one setting: a tree over the oscillators, since each of an oscillator's answers drives the next."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .balance import Oscillator, newton
from .basis import Basis
from .march import March, cubic_of, first_phasor, oscillator, push
from .rung import RungError
from .scaling import Stages
from .starts import mean_starts

__all__ = ["all_branches"]

Floats = NDArray[np.float64]

MAX_BRANCHES = 2048
# Answers nearer than this, relative to their size, are the same answer found twice.
SAME = 1e-6


def all_branches(stages: Stages, basis: Basis) -> March:
    """Every answer of the one setting in `stages`, along the batch axis; the lowest at every oscillator first.

    Raises
    ------
    RungError
        When there are more than 2048.
    """
    paths: list[list[Floats]] = [[]]
    labels: list[list[int]] = [[]]
    steps = 0
    for m in range(stages.n):
        osc, grown, named = oscillator(stages, m), [], []
        for path, label in zip(paths, labels, strict=True):
            before = path[-1][:, None] if path else None
            found, work = _answers(osc, basis, push(stages, basis, m, before))
            steps += work
            ranks = (0, 2) if len(found) == 2 else range(len(found))
            grown += [[*path, x] for x in found]
            named += [[*label, rank] for rank in ranks]
        paths, labels = grown, named
        if len(paths) > MAX_BRANCHES:
            raise RungError(f"more than {MAX_BRANCHES} branches by oscillator {m}; use start rest, or a shorter chain")
    shape = (stages.n, basis.size, len(paths))
    x = np.array(paths).transpose(1, 2, 0) if paths else np.empty(shape)
    branch = np.array(labels, dtype=np.int8).reshape(len(paths), stages.n).T
    return March(basis, x, np.ones(len(paths), dtype=bool), branch, steps)


def _answers(osc: Oscillator, basis: Basis, force: Floats) -> tuple[list[Floats], int]:
    """The distinct answers of one oscillator under `force` (d, 1), by size, and the Newton steps spent."""
    starts = _starts(osc, basis, force)
    many = osc.pick(np.zeros(starts.shape[1], dtype=np.intp))
    solved = newton(basis, many, np.repeat(force, starts.shape[1], axis=1), starts)
    found: list[Floats] = []
    for x in solved.x[:, solved.ok].T:
        if all(np.abs(x - other).max() > SAME * np.abs(x).max() for other in found):
            found.append(x)
    by_size = sorted(found, key=lambda x: float(np.hypot(x[0], x[1]) if basis.order else abs(x[0])))
    return by_size, solved.steps


def _starts(osc: Oscillator, basis: Basis, force: Floats) -> Floats:
    """Starts for Newton, shape (d, J): the single-harmonic roots and the folds between them; a fold leads to the
    answer beside it when the true fold lies elsewhere.
    """
    if not basis.order:
        return np.array([_rest_points(osc, float(force[-1, 0]))])
    drive = first_phasor(force)
    kappa, g = osc.k - osc.omega**2, osc.delta * osc.omega
    means = np.zeros(1)
    if not osc.sign:
        phasors = drive / (kappa + 1j * g)
    elif basis.mean and force[-1, 0]:
        pairs = mean_starts(kappa, g, osc.k, osc.sign, drive, force[-1])
        phasors, means = pairs[0][:, 0], pairs[1][:, 0]
    else:
        cubic = cubic_of(osc, drive)
        roots = [cubic.lowest(), cubic.middle(), cubic.highest()]
        folds = [np.where(cubic.folded, v, np.nan) for v in (cubic.peak, cubic.dip)]
        phasors = np.concatenate([cubic.amplitude(v, drive) for v in (*roots, *folds)])
    kept = np.isfinite(phasors)
    starts = np.zeros((basis.size, int(kept.sum())))
    starts[0], starts[1] = phasors[kept].real, phasors[kept].imag
    if basis.mean:
        starts[-1] = np.broadcast_to(means, phasors.shape)[kept]
    return starts


def _rest_points(osc: Oscillator, constant: float) -> Floats:
    """Real roots of ``sign c^3 + k c = constant``."""
    k = float(osc.k[0])
    roots = np.roots([osc.sign, 0.0, k, -constant]) if osc.sign else np.array([constant / k])
    real: Floats = np.real(roots[np.abs(np.imag(roots)) <= 1e-7 * (1 + np.abs(roots))])
    return real
