"""From scaled coordinates to a `Response`: units, stability, outcome, and the estimate of what was left out."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..equations.basis import Basis, basis_for
from ..equations.scaled_chain import ScaledChain
from ..floquet.hill import chain_multipliers
from ..floquet.monodromy import joint_multipliers
from ..model.response import Outcome, Response, Stats
from .joint import correct_joint, rounding_of
from .long import correct_long, is_long
from .march import correct

__all__ = ["Answer", "defect", "finer", "outcomes", "response_of", "stitch"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
Bools = NDArray[np.bool_]

ORDERS = (0, 1, 3, 5, 9, 17, 33, 65)
# One Newton step measures the distance to first order; twice it covers the rest.
SAFETY = 2.0
# Rounding in the solve of one oscillator, times its sharpness this is the floor of any estimate. At a resonance the
# sharpness is 1/(delta omega); what that makes of more than FINE is looked at oscillator by oscillator.
ROUNDING = 4e-16
FINE = 1e-12
# A multiplier nearer to the circle than this cannot be told from one on it: without damping nothing settles.
ROUNDED = 1e-15


@dataclass(frozen=True)
class Answer:
    """What a steady rung found, scaled.

    x : float64, shape (n, d, N) in `basis`. branch : int8, shape (n, N).
    outcome : OK or OUT_OF_BUDGET (tolerance not met) where there is an answer, else why there is none; stability is
        looked at later.
    estimate : float64, shape (N,), relative to the largest amplitude.
    multipliers : complex128, shape (N, n, 2), or None to have them computed.
    """

    basis: Basis
    x: Floats
    outcome: NDArray[np.object_]
    branch: NDArray[np.int8]
    estimate: Floats
    multipliers: Complexes | None = None


def outcomes(size: int, outcome: Outcome) -> NDArray[np.object_]:
    """An array of one outcome. (`numpy.full` would turn the members of a StrEnum into plain strings.)"""
    array = np.empty(size, dtype=object)
    array.fill(outcome)
    return array


def finer(basis: Basis) -> Basis:
    """The basis of the next dearer answer."""
    return basis_for(ORDERS[ORDERS.index(basis.order) + 1], basis.mean)


def defect(scaled: ScaledChain, basis: Basis, x: Floats) -> Floats:
    """Error of the first harmonic, the mean and every harmonic in `basis`, bought with one Newton step in a finer one.

    x has shape (n, d, N); the result is float64, shape (N,), relative to the setting's largest amplitude, and inf
    where the step is not finite.
    """
    if scaled.linear and basis.order and not scaled.joint:
        return _floor(scaled, basis, x)
    sharper = finer(basis)
    step = correct_joint if scaled.joint else correct_long if is_long(scaled) else correct
    moved = step(scaled, sharper, x, basis)
    mine, other = _shared(basis, sharper)
    size = np.abs(moved).max(axis=(0, 1))
    away = np.abs(moved[:, other] - x[:, mine]).max(axis=(0, 1))
    if not basis.order:
        # Without a drive what is found there is rounding, grown from stage to stage.
        away = np.where(scaled.drive == 0, away, np.maximum(away, np.abs(moved[:, :2]).max(axis=(0, 1))))
    relative = np.where(away == 0, 0.0, SAFETY * away / size)
    relative = relative + (rounding_of(scaled, basis, x) if scaled.joint else _floor(scaled, basis, x))
    return np.where(np.isfinite(relative), relative, np.inf)


def _shared(basis: Basis, sharper: Basis) -> tuple[list[int], list[int]]:
    """Places of the coordinates both bases have, in each of them."""
    there = [2 * int(np.searchsorted(sharper.harmonics, harmonic)) for harmonic in basis.harmonics]
    mine, other = list(range(2 * len(there))), [at + part for at in there for part in (0, 1)]
    return ([*mine, basis.size - 1], [*other, sharper.size - 1]) if basis.mean else (mine, other)


def _floor(scaled: ScaledChain, basis: Basis, x: Floats) -> Floats:
    """What rounding does to the answer x of a feed-forward chain, relative to its largest amplitude; shape (N,)."""
    stiff = np.abs(scaled.k).max(axis=0) + (scaled.omega**2 if basis.order else 0.0)
    resonant: Floats = ROUNDING * (1 + stiff / np.maximum(scaled.delta.min() * scaled.omega, 1e-12))
    if (resonant <= FINE).all():
        return resonant
    size, sharp = np.abs(x).max(axis=1), _sharpness(scaled, basis, x)
    away = np.zeros(scaled.k.shape)
    own = (np.abs(scaled.k) + (scaled.omega**2 if basis.order else 0.0) + 3 * np.abs(scaled.sign) * size**2) * size
    for layer in scaled.layers:
        total = own[layer]
        for links, source in scaled.feeds(layer):
            total += np.abs(links) * np.where((source >= 0)[:, None], away[np.maximum(source, 0)], 0.0)
        away[layer] = np.where(total > 0, total / sharp[layer], 0.0)
    largest = size.max(axis=0)
    relative = ROUNDING * (1 + np.where(largest > 0, away.max(axis=0) / largest, 0.0))
    return np.where(resonant <= FINE, resonant, relative)


def _sharpness(scaled: ScaledChain, basis: Basis, x: Floats) -> Floats:
    """Least force that moves an oscillator by 1 from its answer x, by its harmonics one by one; float64, shape (n, N).

    A small change a of a harmonic of impedance p costs ``p a + q a*``, so at least ``||p| - |q||``.
    """
    still = x[:, -1] ** 2 if basis.mean else 0.0
    square = (x[:, : 2 * len(basis.harmonics)] ** 2).sum(axis=1)
    own = scaled.k + scaled.sign * (3 * still + 1.5 * square)
    sharp = np.abs(own) if basis.mean else np.full(own.shape, np.inf)
    first = np.abs(scaled.sign) * (0.75 * (x[:, 0] ** 2 + x[:, 1] ** 2) if basis.order else 0.0)
    for harmonic in basis.harmonics:
        impedance = np.hypot(own - (harmonic * scaled.omega) ** 2, harmonic * scaled.delta * scaled.omega)
        sharp = np.minimum(sharp, np.abs(impedance - (first if harmonic == 1 else 0.0)))
    return sharp


def response_of(scaled: ScaledChain, rung: str, answer: Answer, work: Stats, began: float) -> Response:
    """The `Response` in the chain's own units: unsolved settings become NaN, unstable ones say so.

    `began` is the reading of `time.perf_counter` when the work started.
    """
    solved = (answer.outcome == Outcome.OK) | (answer.outcome == Outcome.OUT_OF_BUDGET)
    multipliers = answer.multipliers
    if multipliers is None:
        known_only = np.where(solved, answer.x, np.nan)
        multipliers = (joint_multipliers if scaled.joint else chain_multipliers)(scaled, answer.basis, known_only)
    stable = solved & (np.abs(multipliers) < 1 - ROUNDED).all(axis=(1, 2))
    known = np.isfinite(multipliers).all(axis=(1, 2))
    outcome = answer.outcome.copy()
    outcome[solved & ~stable] = Outcome.UNSTABLE
    outcome[solved & ~(known & np.isfinite(answer.estimate))] = Outcome.OUT_OF_BUDGET
    x = np.where(solved, answer.x, np.nan) / scaled.length
    harmonics = answer.basis.phasors(x.transpose(1, 2, 0)).transpose(1, 0, 2)
    if not solved.all():
        harmonics[~solved] = complex(np.nan, np.nan)
    mean = x[:, -1].T.copy() if answer.basis.mean else np.where(solved[:, None], 0.0, np.full((len(scaled), 1), np.nan))
    mean = np.array(np.broadcast_to(mean, (len(scaled), scaled.n)))
    estimate = np.where(solved, answer.estimate, np.inf)
    branch = np.ascontiguousarray(answer.branch.T)
    for array in (harmonics, mean, multipliers, branch, estimate, stable, outcome):
        array.flags.writeable = False
    stats = replace(work, seconds=time.perf_counter() - began)
    return Response(rung, outcome, harmonics, mean, stable, solved, multipliers, branch, estimate, stats)


def stitch(rung: str, size: int, parts: list[tuple[NDArray[np.intp], Response]]) -> Response:
    """One response from responses of disjoint parts of a batch, each with the indices it answers."""
    first = parts[0][1]
    n = first.mean.shape[1]
    depth = max(part.harmonics.shape[1] for _, part in parts)
    outcome = np.empty(size, dtype=object)
    harmonics = np.zeros((size, depth, n), dtype=np.complex128)
    mean, estimate = np.empty((size, n)), np.empty(size)
    stable, locked = np.empty(size, dtype=bool), np.empty(size, dtype=bool)
    multipliers = np.empty((size, n, 2), dtype=np.complex128)
    branch = np.empty((size, n), dtype=np.int8)
    stats = Stats()
    for index, part in parts:
        outcome[index], stable[index], locked[index] = part.outcome, part.stable, part.locked
        harmonics[index, : part.harmonics.shape[1]] = part.harmonics
        mean[index], estimate[index], branch[index] = part.mean, part.error_estimate, part.branch
        multipliers[index] = part.multipliers
        stats = stats + part.stats
    for array in (outcome, harmonics, mean, stable, locked, multipliers, branch, estimate):
        array.flags.writeable = False
    return Response(rung, outcome, harmonics, mean, stable, locked, multipliers, branch, estimate, stats)
