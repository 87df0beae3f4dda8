"""Sequential harmonic balance: as many harmonics as the tolerance needs, over a batch of settings."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from .answer import ORDERS, Answer, defect, finer, outcomes, response_of, stitch
from .basis import Basis, basis_for, resize
from .branches import all_branches
from .chain import Chain, Setting
from .joint import follow_load, newton_joint
from .march import March, march, means_under, past_fold
from .response import Outcome, Response, Stats
from .rung import Rung, Start
from .scaling import Stages

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
        return _refined(stages, tol, lower_branch(stages, basis, start), began)


def branch_refusal(chain: Chain, setting: Setting, start: Start) -> str:
    """Why a steady rung cannot answer, or ""."""
    if start is not Start.ALL:
        return ""
    if not chain.feed_forward:
        return f"the branches of a {chain.closure} chain cannot be counted one by one; use start rest or ramp"
    return f"start all takes one setting, got {len(setting)}" if len(setting) != 1 else ""


def lower_branch(stages: Stages, basis: Basis, start: Start) -> March:
    """The lower branch; for a ramp it must join the one that starts at 0. Joint oscillators are always followed."""
    if stages.joint:
        return follow_load(stages, basis)
    found = march(stages, basis)
    return replace(found, ok=found.ok & ~past_fold(stages, basis, found.x)) if start is Start.RAMP else found


def _solved(stages: Stages, basis: Basis, guide: Floats) -> March:
    return newton_joint(stages, basis, guide) if stages.joint else march(stages, basis, guide)


def balance_near(chain: Chain, setting: Setting, phasor: NDArray[np.complex128], *, tol: float) -> Response:
    """The answer beside a known motion.

    Parameters
    ----------
    phasor : complex128, shape (N, n), first harmonics from a coarser look.
    """
    began = time.perf_counter()
    stages = Stages.of(chain, setting)
    basis = basis_for(FIRST, stages.has_mean)
    scaled = phasor.T * stages.length
    guide = np.zeros((stages.n, basis.size, len(stages)))
    guide[:, 0], guide[:, 1] = scaled.real, scaled.imag
    if basis.mean:
        with np.errstate(all="ignore"):
            guide[:, -1] = means_under(stages, scaled)
    with np.errstate(all="ignore"):
        return _refined(stages, tol, _solved(stages, basis, guide), began)


def _refined(stages: Stages, tol: float, first: March, began: float) -> Response:
    """March with ever more harmonics, from `first`, until the estimate of each setting is under `tol`."""
    todo, here, found = np.arange(len(stages)), stages, first
    parts: list[tuple[NDArray[np.intp], Response]] = []
    steps = found.steps
    while True:
        estimate = defect(here, found.basis, found.x)
        enough = ~found.ok | (estimate <= tol)
        left = np.flatnonzero(~enough) if found.basis.order < LAST else np.empty(0, dtype=np.intp)
        done = np.setdiff1d(np.arange(len(todo)), left, assume_unique=True) if len(left) else slice(None)
        parts.append((todo[done], _response(here, found, estimate, enough, done, began)))
        if not len(left):
            break
        todo, here = todo[left], here.pick(left)
        basis = finer(found.basis)
        guide = np.stack([resize(x, found.basis, basis) for x in found.x[:, :, left]])
        found = replace(_solved(here, basis, guide), branch=found.branch[:, left])
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
