"""Sequential harmonic balance: as many harmonics as the tolerance needs, over a batch of settings."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..equations.basis import Basis, basis_for, resize
from ..equations.chain import Chain, Setting
from ..equations.scaled_chain import ScaledChain
from ..model.response import Outcome, Response, Stats
from ..rung import TERMS, Rung, Start
from .answer import ORDERS, Answer, defect, finer, outcomes, response_of, stitch
from .branches import all_branches
from .homotopy import blank, filled, let_down, undriven
from .joint import follow_load, newton_joint
from .long import is_long, march_long
from .march import March, march, means_under, past_fold

__all__ = ["HarmonicBalanceRung", "balance_near", "branch_refusal", "lower_branch"]

Floats = NDArray[np.float64]

FIRST = 3
LAST = ORDERS[-2]


class HarmonicBalanceRung(Rung):
    """Odd harmonics (all and the mean under a constant force), by Newton's method.

    Each oscillator in turn, or all at once where they act on each other.
    """

    name = "harmonic_balance"
    order = "geometric in the number of harmonics; with 1 and 3 alone O(beta^2 a^4)"
    valid = "any response locked to the drive"
    models = TERMS
    lists_branches = True
    adjustable = True

    def refusal(self, chain: Chain, setting: Setting, start: Start) -> str:
        """Every branch only of one setting, and only where oscillators can be solved in turn."""
        return branch_refusal(chain, setting, start)

    def steady(self, chain: Chain, setting: Setting, *, tol: float, start: Start) -> Response:
        """The lower branch (rest, ramp) or every branch (all); for a ramp it must join the branch that starts at 0."""
        began = time.perf_counter()
        scaled = ScaledChain.of(chain, setting)
        basis = basis_for(FIRST, scaled.has_mean)
        if start is Start.ALL:
            found = all_branches(scaled, basis)
            return _refined(scaled.pick(np.zeros(len(found.ok), dtype=np.intp)), tol, found, began)
        # Few harmonics may have no answer where more have one; a hardening oscillator always has one.
        again = start is Start.REST and not (scaled.softens or scaled.joint)
        return _refined(scaled, tol, lower_branch(scaled, basis, start), began, again=again)


def branch_refusal(chain: Chain, setting: Setting, start: Start) -> str:
    """Why a steady rung cannot answer, or ""."""
    if start is not Start.ALL:
        return ""
    if not chain.feed_forward:
        return f"the branches of a {chain.law.name} are found together: use joint_branches, or solve"
    return f"start all takes one setting, got {len(setting)}" if len(setting) != 1 else ""


def lower_branch(scaled: ScaledChain, basis: Basis, start: Start) -> March:
    """The lower branch; past its end the answer that is left. For a ramp it must join the branch that starts at 0."""
    still = (scaled.drive == 0) & scaled.force.any(axis=0)
    if basis.order and still.any():
        rest = np.flatnonzero(still)
        found = undriven(scaled.pick(rest), basis, _from_zero)
        if still.all():
            return found
        driven = np.flatnonzero(~still)
        other = lower_branch(scaled.pick(driven), basis, start)
        return filled(filled(blank(scaled, basis), rest, found), driven, other)
    found = _from_zero(scaled, basis)
    lost = np.flatnonzero(~found.ok)
    # A ramp of oscillators that act on each other has been followed to where its branch ends.
    if basis.order and len(lost) and not (scaled.joint and start is Start.RAMP):
        found = filled(found, lost, _left(scaled.pick(lost), basis))
    if start is Start.RAMP and not scaled.joint:
        found = replace(found, ok=found.ok & ~past_fold(scaled, basis, found.x))
    return found


def _left(scaled: ScaledChain, basis: Basis) -> March:
    """An answer past the end of the lower branch: beside that of the chain fed forward, or by damping let down."""
    whole = blank(scaled, basis)
    if scaled.joint:
        forward = march(scaled.forward(), basis)
        known = np.flatnonzero(forward.ok)
        whole = filled(whole, known, _solved(scaled.pick(known), basis, forward.x[:, :, known]))
    lost = np.flatnonzero(~whole.ok)
    return filled(whole, lost, let_down(scaled.pick(lost), basis, _solved)) if len(lost) else whole


def _from_zero(scaled: ScaledChain, basis: Basis) -> March:
    alone = march_long(scaled, basis) if is_long(scaled) else None
    if alone is not None:
        return alone
    return follow_load(scaled, basis) if scaled.joint else march(scaled, basis)


def _solved(scaled: ScaledChain, basis: Basis, guide: Floats) -> March:
    return newton_joint(scaled, basis, guide) if scaled.joint else march(scaled, basis, guide)


def balance_near(
    chain: Chain, setting: Setting, phasor: NDArray[np.complex128], *, tol: float, mean: Floats | None = None
) -> Response:
    """The answer beside a known motion.

    Parameters
    ----------
    phasor : complex128, shape (N, n), first harmonics from a coarser look, or (N, K, n), harmonics 1..K.
    mean : float64, shape (N, n), of the known motion. With it, or with even harmonics, the answer may be one of a pair
        that breaks the symmetry of the equations, z(tau) -> -z(tau + T/2): then every harmonic is taken.
    """
    began = time.perf_counter()
    scaled = ScaledChain.of(chain, setting)
    series = phasor if phasor.ndim == 3 else phasor[:, None]
    broken = bool(series[:, 1::2].any()) or (mean is not None and bool(mean.any()))
    order = min(order for order in ORDERS if order >= min(max(series.shape[1], FIRST), LAST))
    basis = basis_for(order, scaled.has_mean or broken)
    phasors = series.transpose(1, 2, 0) * scaled.length
    with np.errstate(all="ignore"):
        still = np.zeros(phasors.shape[1:]) if mean is None else mean.T * scaled.length
        if mean is None and basis.mean:
            still = means_under(scaled, phasors[0])
        guide = np.ascontiguousarray(basis.coordinates(phasors, still).transpose(1, 0, 2))
        return _refined(scaled, tol, _solved(scaled, basis, guide), began)


def _refined(scaled: ScaledChain, tol: float, first: March, began: float, again: bool = False) -> Response:
    """March with ever more harmonics, from `first`, until the estimate of each setting is under `tol`.

    `again` : whether settings without an answer are tried with more harmonics.
    """
    todo, here, found = np.arange(len(scaled)), scaled, first
    parts: list[tuple[NDArray[np.intp], Response]] = []
    steps = found.steps
    while True:
        estimate = defect(here, found.basis, found.x)
        enough = ~found.ok | (estimate <= tol)
        if again and found.basis.order < LAST:
            enough &= found.ok
        left = np.flatnonzero(~enough) if found.basis.order < LAST else np.empty(0, dtype=np.intp)
        done = np.setdiff1d(np.arange(len(todo)), left, assume_unique=True) if len(left) else slice(None)
        parts.append((todo[done], _response(here, found, estimate, enough, done, began)))
        if not len(left):
            break
        todo, here = todo[left], here.pick(left)
        basis = finer(found.basis)
        guide = np.stack([resize(x, found.basis, basis) for x in found.x[:, :, left]])
        found = replace(_solved(here, basis, guide), branch=found.branch[:, left])
        if again and not found.ok.all():
            lost = np.flatnonzero(~found.ok)
            found = filled(found, lost, let_down(here.pick(lost), basis, _solved))
        steps += found.steps
    whole = parts[0][1] if len(parts) == 1 else stitch(HarmonicBalanceRung.name, len(scaled), parts)
    work = Stats(newton_steps=steps, oscillators_solved=scaled.n * len(scaled), seconds=time.perf_counter() - began)
    return replace(whole, stats=work)


def _response(
    scaled: ScaledChain,
    found: March,
    estimate: Floats,
    enough: NDArray[np.bool_],
    done: NDArray[np.intp] | slice,
    began: float,
) -> Response:
    outcome = outcomes(len(enough), Outcome.OK)
    outcome[~enough] = Outcome.OUT_OF_BUDGET
    outcome[~found.ok] = Outcome.NO_CONVERGENCE
    picked = scaled if isinstance(done, slice) else scaled.pick(done)
    answer = Answer(found.basis, found.x[:, :, done], outcome[done], found.branch[:, done], estimate[done])
    return response_of(picked, HarmonicBalanceRung.name, answer, Stats(), began)
