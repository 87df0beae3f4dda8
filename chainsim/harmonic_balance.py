"""Sequential harmonic balance: as many harmonics as the tolerance needs, over a batch of settings."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from .answer import ORDERS, Answer, defect, finer, outcomes, response_of, stitch
from .basis import basis_for, resize
from .branches import all_branches
from .chain import Chain, Closure, Setting
from .march import March, march, means_under, past_fold
from .response import Outcome, Response, Stats
from .rung import Rung, Start
from .scaling import Stages

__all__ = ["HarmonicBalanceRung", "balance_near", "open_refusal"]

Floats = NDArray[np.float64]

FIRST = 3
LAST = ORDERS[-2]


class HarmonicBalanceRung(Rung):
    """Odd harmonics (all and the mean under a constant force) of each oscillator in turn, by Newton's method."""

    name = "harmonic_balance"
    order = "geometric in the number of harmonics; with 1 and 3 alone O(beta^2 a^4)"
    valid = "any response locked to the drive, in an open chain"

    def refusal(self, chain: Chain, setting: Setting, start: Start) -> str:
        """Open chains only; every branch only of one setting."""
        return open_refusal(chain, setting, start)

    def steady(self, chain: Chain, setting: Setting, *, tol: float, start: Start) -> Response:
        """The lower branch (rest, ramp) or every branch (all); for a ramp it must join the branch that starts at 0."""
        began = time.perf_counter()
        stages = Stages.of(chain, setting)
        basis = basis_for(FIRST, stages.has_mean)
        if start is Start.ALL:
            found = all_branches(stages, basis)
            return _refined(stages.pick(np.zeros(len(found.ok), dtype=np.intp)), tol, found, began)
        found = march(stages, basis)
        if start is Start.RAMP:
            found = replace(found, ok=found.ok & ~past_fold(stages, found.basis, found.x))
        return _refined(stages, tol, found, began)


def open_refusal(chain: Chain, setting: Setting, start: Start) -> str:
    """Why a rung that goes oscillator by oscillator cannot answer, or ""."""
    if chain.closure is Closure.RING:
        return "a ring is not solved oscillator by oscillator; use rung ode or auto"
    if start is Start.ALL and len(setting) != 1:
        return f"start all takes one setting, got {len(setting)}"
    return ""


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
        return _refined(stages, tol, march(stages, basis, guide), began)


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
        found = replace(march(here, basis, guide), branch=found.branch[:, left])
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
