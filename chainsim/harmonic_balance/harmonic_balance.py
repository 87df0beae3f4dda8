"""Sequential harmonic balance: as many harmonics as the tolerance needs, over a batch of settings."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..equations.basis import Basis, basis_for, resize
from ..equations.scaling import Stages
from ..model.chain import Chain, Setting
from ..model.response import Outcome, Response, Stats
from ..rung import Rung, Start
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

    def refusal(self, chain: Chain, setting: Setting, start: Start) -> str:
        """Every branch only of one setting, and only where oscillators can be solved in turn."""
        return branch_refusal(chain, setting, start)

    def steady(self, chain: Chain, setting: Setting, *, tol: float, start: Start) -> Response:
        """The lower branch (rest, ramp) or every branch (all); for a ramp it must join the branch that starts at 0."""
        began = time.perf_counter()
        stages = Stages.of(chain, setting)
        basis = basis_for(FIRST, stages.has_mean)
        if start is Start.ALL:
            found = all_branches(stages, basis)
            return _refined(stages.pick(np.zeros(len(found.ok), dtype=np.intp)), tol, found, began)
        # Few harmonics may have no answer where more have one; a hardening oscillator always has one.
        again = start is Start.REST and not (stages.softens or stages.joint)
        return _refined(stages, tol, lower_branch(stages, basis, start), began, again=again)


def branch_refusal(chain: Chain, setting: Setting, start: Start) -> str:
    """Why a steady rung cannot answer, or ""."""
    if start is not Start.ALL:
        return ""
    if not chain.feed_forward:
        return f"the branches of a {chain.closure} chain are found together: use joint_branches, or solve"
    return f"start all takes one setting, got {len(setting)}" if len(setting) != 1 else ""


def lower_branch(stages: Stages, basis: Basis, start: Start) -> March:
    """The lower branch; past its end the answer that is left. For a ramp it must join the branch that starts at 0."""
    still = (stages.drive == 0) & stages.force.any(axis=0)
    if basis.order and still.any():
        rest = np.flatnonzero(still)
        found = undriven(stages.pick(rest), basis, _from_zero)
        if still.all():
            return found
        driven = np.flatnonzero(~still)
        other = lower_branch(stages.pick(driven), basis, start)
        return filled(filled(blank(stages, basis), rest, found), driven, other)
    found = _from_zero(stages, basis)
    lost = np.flatnonzero(~found.ok)
    # A ramp of oscillators that act on each other has been followed to where its branch ends.
    if basis.order and len(lost) and not (stages.joint and start is Start.RAMP):
        found = filled(found, lost, _left(stages.pick(lost), basis))
    if start is Start.RAMP and not stages.joint:
        found = replace(found, ok=found.ok & ~past_fold(stages, basis, found.x))
    return found


def _left(stages: Stages, basis: Basis) -> March:
    """An answer past the end of the lower branch: beside that of the chain fed forward, or by damping let down."""
    whole = blank(stages, basis)
    if stages.joint:
        forward = march(replace(stages, joint=False, other=None, stride=0), basis)
        known = np.flatnonzero(forward.ok)
        whole = filled(whole, known, _solved(stages.pick(known), basis, forward.x[:, :, known]))
    lost = np.flatnonzero(~whole.ok)
    return filled(whole, lost, let_down(stages.pick(lost), basis, _solved)) if len(lost) else whole


def _from_zero(stages: Stages, basis: Basis) -> March:
    alone = march_long(stages, basis) if is_long(stages) else None
    if alone is not None:
        return alone
    return follow_load(stages, basis) if stages.joint else march(stages, basis)


def _solved(stages: Stages, basis: Basis, guide: Floats) -> March:
    return newton_joint(stages, basis, guide) if stages.joint else march(stages, basis, guide)


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
    stages = Stages.of(chain, setting)
    series = phasor if phasor.ndim == 3 else phasor[:, None]
    broken = bool(series[:, 1::2].any()) or (mean is not None and bool(mean.any()))
    order = min(order for order in ORDERS if order >= min(max(series.shape[1], FIRST), LAST))
    basis = basis_for(order, stages.has_mean or broken)
    scaled = series.transpose(1, 2, 0) * stages.length
    with np.errstate(all="ignore"):
        still = np.zeros(scaled.shape[1:]) if mean is None else mean.T * stages.length
        if mean is None and basis.mean:
            still = means_under(stages, scaled[0])
        guide = np.ascontiguousarray(basis.coordinates(scaled, still).transpose(1, 0, 2))
        return _refined(stages, tol, _solved(stages, basis, guide), began)


def _refined(stages: Stages, tol: float, first: March, began: float, again: bool = False) -> Response:
    """March with ever more harmonics, from `first`, until the estimate of each setting is under `tol`.

    `again` : whether settings without an answer are tried with more harmonics.
    """
    todo, here, found = np.arange(len(stages)), stages, first
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
    whole = parts[0][1] if len(parts) == 1 else stitch(HarmonicBalanceRung.name, len(stages), parts)
    work = Stats(newton_steps=steps, oscillators_solved=stages.n * len(stages), seconds=time.perf_counter() - began)
    return replace(whole, stats=work)


def _response(
    stages: Stages,
    found: March,
    estimate: Floats,
    enough: NDArray[np.bool_],
    done: NDArray[np.intp] | slice,
    began: float,
) -> Response:
    outcome = outcomes(len(enough), Outcome.OK)
    outcome[~enough] = Outcome.OUT_OF_BUDGET
    outcome[~found.ok] = Outcome.NO_CONVERGENCE
    picked = stages if isinstance(done, slice) else stages.pick(done)
    answer = Answer(found.basis, found.x[:, :, done], outcome[done], found.branch[:, done], estimate[done])
    return response_of(picked, HarmonicBalanceRung.name, answer, Stats(), began)
