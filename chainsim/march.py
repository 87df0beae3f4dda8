"""Along an open chain, oscillator by oscillator: each is driven by the series of the one before."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .balance import Oscillator, linearise, newton, solve_blocks
from .basis import Basis, resize
from .response import Branch
from .scaling import Stages
from .starts import Cubic, mean_of, mean_starts

__all__ = ["March", "correct", "cubic_of", "first_phasor", "march", "means_under", "oscillator", "past_fold", "push"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
Bools = NDArray[np.bool_]


@dataclass(frozen=True)
class March:
    """One answer for every setting.

    x : float64, shape (n, d, N), scaled coordinates in `basis`.
    ok : bool, shape (N,), every oscillator's equations are solved.
    branch : int8, shape (n, N), `Branch` of each oscillator given its input.
    steps : Newton steps, summed over settings.
    """

    basis: Basis
    x: Floats
    ok: Bools
    branch: NDArray[np.int8]
    steps: int


def oscillator(stages: Stages, m: int) -> Oscillator:
    """Oscillator m of every setting."""
    return Oscillator(stages.omega, stages.k[m], stages.delta, stages.sign)


def push(stages: Stages, basis: Basis, m: int, before: Floats | None) -> Floats:
    """Force on oscillator m; float64, shape (d, N). `before` is the series of oscillator m - 1."""
    if before is None:
        force = np.zeros((basis.size, len(stages)))
        if basis.order:
            force[0], force[1] = stages.drive.real, stages.drive.imag
    else:
        force = stages.lam[m] * before
    if basis.mean:
        force[-1] += stages.force[m]
    return force


def first_phasor(x: Floats) -> Complexes:
    """Complex amplitude of the first harmonic, from coordinates with the first harmonic in front."""
    phasor: Complexes = x[0] + 1j * x[1]
    return phasor


def cubic_of(osc: Oscillator, force: Complexes) -> Cubic:
    """The single-harmonic cubic of an oscillator without a mean."""
    return Cubic.of(osc.k - osc.omega * osc.omega, osc.delta * osc.omega, osc.sign, force)


def march(stages: Stages, basis: Basis, guide: Floats | None = None) -> March:
    """Solve the chain in `basis`, on the lower branch, or from the coordinates `guide` (n, d, N)."""
    x = np.empty((stages.n, basis.size, len(stages)))
    ok = np.ones(len(stages), dtype=bool)
    branch = np.zeros((stages.n, len(stages)), dtype=np.int8)
    steps = 0
    before = None
    for m in range(stages.n):
        osc, force = oscillator(stages, m), push(stages, basis, m, before)
        cubic = cubic_of(osc, first_phasor(force)) if basis.order and osc.sign else None
        start = guide[m] if guide is not None else _low_start(osc, basis, force, cubic)
        solved = newton(basis, osc, force, start)
        x[m], ok, steps = solved.x, ok & solved.ok, steps + solved.steps
        if cubic is not None:
            branch[m] = _classify(cubic, first_phasor(solved.x))
        before = solved.x
    return March(basis, x, ok, branch, steps)


def correct(stages: Stages, basis: Basis, x: Floats, old: Basis) -> Floats:
    """One Newton step of the whole chain in `basis` from x (n, d, N) in `old`; errors travel down the chain."""
    moved = np.empty((stages.n, basis.size, len(stages)))
    before = None
    for m in range(stages.n):
        osc = oscillator(stages, m)
        here = resize(x[m], old, basis)
        jacobian, twice = linearise(basis, osc.coefficients(basis), osc.sign, here)
        before = solve_blocks(jacobian, push(stages, basis, m, before) + twice)
        moved[m] = before
    return moved


def _low_start(osc: Oscillator, basis: Basis, force: Floats, cubic: Cubic | None) -> Floats:
    start = np.zeros(force.shape)
    if not basis.order:
        return start
    drive = first_phasor(force)
    if cubic is None:
        phasor = drive / (osc.k - osc.omega**2 + 1j * osc.delta * osc.omega)
    elif basis.mean and force[-1].any():
        kappa, g = osc.k - osc.omega**2, osc.delta * osc.omega
        phasors, means = mean_starts(kappa, g, osc.k, osc.sign, drive, force[-1])
        phasor, start[-1] = phasors[0], means[0]
    else:
        phasor = cubic.amplitude(cubic.lowest(), drive)
        if basis.order >= 3 and not basis.mean:
            # The third harmonic that goes with it saves a Newton step.
            third = force[2] + 1j * force[3] - 0.25 * osc.sign * phasor**3
            third /= osc.k - 9 * osc.omega**2 + 3j * osc.delta * osc.omega
            start[2], start[3] = third.real, third.imag
    start[0], start[1] = phasor.real, phasor.imag
    return start


def _classify(cubic: Cubic, phasor: Complexes) -> NDArray[np.int8]:
    if not cubic.folded.any():
        return np.full(phasor.shape, Branch.LOW, dtype=np.int8)
    v = 0.75 * (phasor.real**2 + phasor.imag**2)
    label = np.full(v.shape, Branch.MIDDLE, dtype=np.int8)
    label[v < cubic.peak] = Branch.LOW
    label[v > cubic.dip] = Branch.HIGH
    label[~cubic.multiple] = Branch.LOW
    return label


def past_fold(stages: Stages, basis: Basis, x: Floats) -> Bools:
    """Whether any oscillator is beyond the fold where the branch that starts at 0 ends; bool, shape (N,).

    Between the two folds of the cubic lies its inflection: the branch from 0 is below it.
    """
    past = np.zeros(len(stages), dtype=bool)
    if not (basis.order and stages.sign):
        return past
    for m in range(stages.n):
        here = x[m, :, :]
        v = 0.75 * (here[0] ** 2 + here[1] ** 2)
        stiffness = stages.k[m] + 3 * stages.sign * (here[-1] ** 2 if basis.mean else 0.0)
        bend = stages.sign * (stages.omega**2 - stiffness)
        past |= (bend > np.sqrt(3) * stages.delta * stages.omega) & (v > 2 * bend / 3)
    return past


def means_under(stages: Stages, phasor: Complexes) -> Floats:
    """Mean of every oscillator that vibrates with `phasor` (n, N); float64, shape (n, N), 0 where none is known."""
    means = np.zeros((stages.n, len(stages)))
    constant = stages.force[0]
    for m in range(stages.n):
        if m:
            constant = stages.lam[m] * means[m - 1] + stages.force[m]
        stiffness = stages.k[m] + 1.5 * stages.sign * np.abs(phasor[m]) ** 2
        means[m] = np.nan_to_num(mean_of(stiffness, stages.sign, constant))
    return means
