"""Equilibria under constant forces: ``k c + beta c^3 = b + lam c_before``, oscillator by oscillator."""

from __future__ import annotations

import time

import numpy as np

from ..equations.basis import basis_for
from ..equations.chain import Chain, Setting
from ..equations.scaled_chain import ScaledChain
from ..model.response import Outcome, Response, Stats
from ..rung import DEFLECTION, TERMS, Rung, Start
from .answer import Answer, defect, outcomes, response_of
from .branches import all_branches
from .rung import branch_refusal, lower_branch

__all__ = ["StaticRung"]


class StaticRung(Rung):
    """The deflection under bias and preload; what the drive does is left to the error estimate.

    For beta < 0 the equilibrium that grows from rest ends at |b| = 2/3 k sqrt(k/(3 |beta|)): beyond it the outcome is
    escaped.
    """

    name = "static"
    order = "exact without a drive; else O(epsilon)"
    valid = "bias and preload only"
    models = TERMS
    lists_branches = True
    answers = frozenset({DEFLECTION})

    def refusal(self, chain: Chain, setting: Setting, start: Start) -> str:
        """Every branch only of one setting, and only where oscillators can be solved in turn."""
        return branch_refusal(chain, setting, start)

    def steady(self, chain: Chain, setting: Setting, *, tol: float, start: Start) -> Response:
        """The equilibrium that grows from rest, or every equilibrium (all)."""
        began = time.perf_counter()
        scaled = ScaledChain.of(chain, setting)
        basis = basis_for(0, True)
        found = all_branches(scaled, basis) if start is Start.ALL else lower_branch(scaled, basis, Start.REST)
        if start is Start.ALL:
            scaled = scaled.pick(np.zeros(len(found.ok), dtype=np.intp))
        outcome = outcomes(len(scaled), Outcome.OK)
        if start is not Start.ALL:
            # Newton from 0 climbs to the equilibrium in the well and finds none, or one outside it, past the fold.
            held = (scaled.k + 3 * scaled.sign * found.x[:, 0] ** 2 > 0).all(axis=0)
            outcome[~(found.ok & held)] = Outcome.ESCAPED if scaled.softens else Outcome.NO_CONVERGENCE
        answer = Answer(basis, found.x, outcome, found.branch, defect(scaled, basis, found.x))
        work = Stats(newton_steps=found.steps, oscillators_solved=scaled.n * len(scaled))
        return response_of(scaled, self.name, answer, work, began)
