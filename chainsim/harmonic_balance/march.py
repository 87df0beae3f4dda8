"""Along an open chain or grid, layer by layer: each oscillator is driven by the series of those before it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..equations.basis import Basis, basis_for, resize
from ..equations.scaled_chain import ScaledChain
from ..model.response import Branch
from .balance import Oscillator, linearise, newton, solve_blocks
from .single import march_alone
from .starts import Cubic, mean_of, mean_starts

__all__ = [
    "March", "branches_of", "classify", "correct", "cubic_of", "first_phasor", "layer_of", "march", "means_under",
    "oscillator", "past_fold", "push",
]  # fmt: skip

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
Bools = NDArray[np.bool_]
Wholes = NDArray[np.intp]


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


def oscillator(scaled: ScaledChain, m: int) -> Oscillator:
    """Oscillator m of every setting."""
    delta, sign = (each[m] if len(each) > 1 else each[0] for each in (scaled.delta, scaled.sign))
    return Oscillator(scaled.omega, scaled.k[m], delta, sign)


def layer_of(scaled: ScaledChain, layer: Wholes) -> Oscillator:
    """The oscillators `layer` of every setting, side by side: (M, N) lanes become M N."""
    if len(layer) == 1:
        return oscillator(scaled, int(layer[0]))
    delta, sign = (np.repeat(scaled.of_each(value)[layer], len(scaled)) for value in (scaled.delta, scaled.sign))
    return Oscillator(np.tile(scaled.omega, len(layer)), scaled.k[layer].reshape(-1), delta, sign)


def push(scaled: ScaledChain, basis: Basis, m: int, x: Floats) -> Floats:
    """Force on oscillator m under the series x (n, d, N) of those that feed it; float64, shape (d, N)."""
    pulls = [link * x[source] for source, link in scaled.inputs(m)]
    force: Floats = pulls[0] if pulls else np.zeros((basis.size, len(scaled)))
    for pull in pulls[1:]:
        force += pull
    if m == 0 and basis.order:
        force[0], force[1] = scaled.drive.real, scaled.drive.imag
    if basis.mean:
        force[-1] += scaled.force[m]
    return force


def push_layer(scaled: ScaledChain, basis: Basis, layer: Wholes, x: Floats) -> Floats:
    """Force on the oscillators `layer`, side by side; float64, shape (d, M N)."""
    if len(layer) == 1:
        return push(scaled, basis, int(layer[0]), x)
    force = np.zeros((len(layer), basis.size, len(scaled)))
    for links, source in scaled.feeds(layer):
        force += links[:, None] * np.where((source >= 0)[:, None, None], x[np.maximum(source, 0)], 0.0)
    if basis.mean:
        force[:, -1] += scaled.force[layer]
    return _side_by_side(force)


def _side_by_side(x: Floats) -> Floats:
    """(M, d, N) as (d, M N)."""
    return x[0] if len(x) == 1 else x.transpose(1, 0, 2).reshape(x.shape[1], -1)


def first_phasor(x: Floats) -> Complexes:
    """Complex amplitude of the first harmonic, from coordinates with the first harmonic in front."""
    phasor: Complexes = x[0] + 1j * x[1]
    return phasor


def cubic_of(osc: Oscillator, force: Complexes) -> Cubic:
    """The single-harmonic cubic of an oscillator without a mean."""
    return Cubic.of(osc.k - osc.omega * osc.omega, osc.delta * osc.omega, osc.sign, force)


def march(scaled: ScaledChain, basis: Basis, guide: Floats | None = None) -> March:
    """Solve the chain in `basis`, on the lower branch, or from the coordinates `guide` (n, d, N)."""
    if len(scaled) == 1 and guide is None and basis is basis_for(3, False) and not scaled.linear and scaled.law.in_line:
        alone = march_alone(scaled)
        if alone is not None:
            series, count = alone
            return March(basis, series, np.ones(1, dtype=bool), branches_of(scaled, basis, series), count)
    # Where a row of a grid begins the link from the end of the row before is 0, and what it multiplies must be finite.
    x = np.zeros((scaled.n, basis.size, len(scaled)))
    ok = np.ones(len(scaled), dtype=bool)
    branch = np.zeros((scaled.n, len(scaled)), dtype=np.int8)
    steps, size, lanes = 0, len(scaled), basis.size
    for layer in scaled.layers:
        osc, force = layer_of(scaled, layer), push_layer(scaled, basis, layer, x)
        cubic = cubic_of(osc, first_phasor(force)) if basis.order and not scaled.linear else None
        start = _side_by_side(guide[layer]) if guide is not None else _low_start(osc, basis, force, cubic)
        solved = newton(basis, osc, force, start)
        steps += solved.steps
        ok &= solved.ok.reshape(-1, size).all(axis=0)
        x[layer] = solved.x.reshape(lanes, -1, size).transpose(1, 0, 2)
        if cubic is not None:
            branch[layer] = classify(cubic, first_phasor(solved.x)).reshape(-1, size)
    return March(basis, x, ok, branch, steps)


def correct(scaled: ScaledChain, basis: Basis, x: Floats, old: Basis) -> Floats:
    """One Newton step of the whole chain in `basis` from x (n, d, N) in `old`; errors travel down the chain."""
    moved = np.zeros((scaled.n, basis.size, len(scaled)))
    for layer in scaled.layers:
        osc = layer_of(scaled, layer)
        here = resize(_side_by_side(x[layer]), old, basis)
        jacobian, twice = linearise(basis, osc.coefficients(basis), osc.sign, here)
        found = solve_blocks(jacobian, push_layer(scaled, basis, layer, moved) + twice)
        moved[layer] = found.reshape(basis.size, -1, len(scaled)).transpose(1, 0, 2)
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


def classify(cubic: Cubic, phasor: Complexes) -> NDArray[np.int8]:
    """`Branch` of an oscillator of first harmonic `phasor`: on which side of the folds it lies."""
    if not cubic.folded.any():
        return np.full(phasor.shape, Branch.LOW, dtype=np.int8)
    v = cubic.measure(phasor)
    label = np.full(v.shape, Branch.MIDDLE, dtype=np.int8)
    label[v < cubic.peak] = Branch.LOW
    label[v > cubic.dip] = Branch.HIGH
    label[~cubic.multiple] = Branch.LOW
    return label


def branches_of(scaled: ScaledChain, basis: Basis, x: Floats) -> NDArray[np.int8]:
    """`Branch` of each oscillator given its input; int8, shape (n, N)."""
    branch = np.zeros((scaled.n, len(scaled)), dtype=np.int8)
    if not basis.order or scaled.linear:
        return branch
    phasor = x[:, 0] + 1j * x[:, 1]
    force = np.zeros_like(phasor)
    force[0] = scaled.drive
    for fed, source, link in scaled.links():
        force[fed] += link * phasor[source]
    label = classify(cubic_of(layer_of(scaled, np.arange(scaled.n)), force.reshape(-1)), phasor.reshape(-1))
    return label.reshape(branch.shape)


def past_fold(scaled: ScaledChain, basis: Basis, x: Floats) -> Bools:
    """Whether any oscillator is beyond the fold where the branch that starts at 0 ends; bool, shape (N,).

    Between the two folds of the cubic lies its inflection: the branch from 0 is below it.
    """
    past = np.zeros(len(scaled), dtype=bool)
    if not basis.order or scaled.linear:
        return past
    for m in range(scaled.n):
        here, osc = x[m, :, :], oscillator(scaled, m)
        # In units of the oscillator's own cubic term.
        v = 0.75 * np.abs(osc.sign) * (here[0] ** 2 + here[1] ** 2)
        stiffness = osc.k + 3 * osc.sign * (here[-1] ** 2 if basis.mean else 0.0)
        bend = np.sign(osc.sign) * (scaled.omega**2 - stiffness)
        past |= (bend > np.sqrt(3) * osc.delta * scaled.omega) & (v > 2 * bend / 3)
    return past


def means_under(scaled: ScaledChain, phasor: Complexes) -> Floats:
    """Mean of every oscillator that vibrates with `phasor` (n, N); float64, shape (n, N), 0 where none is known."""
    means = np.zeros((scaled.n, len(scaled)))
    for m in range(scaled.n):
        constant, osc = scaled.force[m], oscillator(scaled, m)
        for source, link in scaled.inputs(m):
            constant = constant + link * means[source]
        stiffness = osc.k + 1.5 * osc.sign * np.abs(phasor[m]) ** 2
        means[m] = np.nan_to_num(mean_of(stiffness, osc.sign, constant))
    return means
