"""One harmonic: a cubic per oscillator, all branches, with the stability of the slow flow."""

from __future__ import annotations

import time

import numpy as np
from numpy.typing import NDArray

from ..equations.basis import basis_for
from ..equations.scaling import Stages
from ..model.chain import Chain, Setting
from ..model.response import Outcome, Response, Stats
from ..rung import Rung, Start
from .answer import Answer, defect, outcomes, response_of
from .branches import all_branches
from .harmonic_balance import branch_refusal, lower_branch

__all__ = ["OneHarmonicRung"]


class OneHarmonicRung(Rung):
    """``A_m = lam_m A_{m-1} / (k - omega^2 + 3/4 beta |A_m|^2 + i delta omega)``, and a mean under constant forces."""

    name = "one_harmonic"
    order = "O(beta^2 a^4) over the distance to the fold"
    valid = "beta a^2 << 1 (the third harmonic is beta a^2 / 32 of the first)"

    def refusal(self, chain: Chain, setting: Setting, start: Start) -> str:
        """Every branch only of one setting, and only where oscillators can be solved in turn."""
        return branch_refusal(chain, setting, start)

    def steady(self, chain: Chain, setting: Setting, *, tol: float, start: Start) -> Response:
        """The lower branch (rest, ramp) or every branch (all)."""
        began = time.perf_counter()
        stages = Stages.of(chain, setting)
        basis = basis_for(1, stages.has_mean)
        found = all_branches(stages, basis) if start is Start.ALL else lower_branch(stages, basis, start)
        if start is Start.ALL:
            stages = stages.pick(np.zeros(len(found.ok), dtype=np.intp))
        outcome = outcomes(len(stages), Outcome.OK)
        outcome[~found.ok] = Outcome.NO_CONVERGENCE
        flow = None if basis.mean or stages.joint else _slow_flow(stages, found.x)
        answer = Answer(basis, found.x, outcome, found.branch, defect(stages, basis, found.x), flow)
        work = Stats(newton_steps=found.steps, oscillators_solved=stages.n * len(stages))
        return response_of(stages, self.name, answer, work, began)


def _slow_flow(stages: Stages, x: NDArray[np.float64]) -> NDArray[np.complex128]:
    """Multipliers of ``2 i omega A' = F - (kappa + 3/4 sign |A|^2 + i delta omega) A``; shape (N, n, 2).

    The exponents are -delta/2 +- sqrt(-kappa_1 kappa_3)/(2 omega), kappa_j = kappa + j sign 3/4 |A|^2: stable while the
    cubic's slope (delta omega)^2 + kappa_1 kappa_3 is positive.
    """
    kappa = stages.k - stages.omega**2
    v = 0.75 * stages.sign * (x[:, 0] ** 2 + x[:, 1] ** 2)
    spread = np.sqrt(-(kappa + v) * (kappa + 3 * v) + 0j) / (2 * stages.omega)
    exponents = np.stack([-0.5 * stages.delta + spread, -0.5 * stages.delta - spread])
    return np.exp(exponents * (2 * np.pi / stages.omega)).transpose(2, 1, 0)
