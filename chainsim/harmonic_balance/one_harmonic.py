"""One harmonic: a cubic per oscillator, all branches, with the stability of the slow flow."""

from __future__ import annotations

import time

import numpy as np
from numpy.typing import NDArray

from ..equations.basis import basis_for
from ..equations.chain import Chain, Setting
from ..equations.scaled_chain import ScaledChain
from ..model.response import Outcome, Response, Stats
from ..rung import Rung, Start
from .answer import Answer, defect, outcomes, response_of
from .branches import all_branches
from .rung import branch_refusal, lower_branch

__all__ = ["OneHarmonicRung"]


class OneHarmonicRung(Rung):
    """``A_m = lam_m A_{m-1} / (k - omega^2 + 3/4 beta |A_m|^2 + i delta omega)``, and a mean under constant forces."""

    name = "one_harmonic"
    order = "O(beta^2 a^4) over the distance to the fold"
    valid = "beta a^2 << 1 (the third harmonic is beta a^2 / 32 of the first)"
    models = frozenset({"nonlinearity"})
    lists_branches = True

    def refusal(self, chain: Chain, setting: Setting, start: Start) -> str:
        """Every branch only of one setting, and only where oscillators can be solved in turn."""
        return branch_refusal(chain, setting, start)

    def steady(self, chain: Chain, setting: Setting, *, tol: float, start: Start) -> Response:
        """The lower branch (rest, ramp) or every branch (all)."""
        began = time.perf_counter()
        scaled = ScaledChain.of(chain, setting)
        basis = basis_for(1, scaled.has_mean)
        found = all_branches(scaled, basis) if start is Start.ALL else lower_branch(scaled, basis, start)
        if start is Start.ALL:
            scaled = scaled.pick(np.zeros(len(found.ok), dtype=np.intp))
        outcome = outcomes(len(scaled), Outcome.OK)
        outcome[~found.ok] = Outcome.NO_CONVERGENCE
        flow = None if basis.mean or scaled.joint else _slow_flow(scaled, found.x)
        answer = Answer(basis, found.x, outcome, found.branch, defect(scaled, basis, found.x), flow)
        work = Stats(newton_steps=found.steps, oscillators_solved=scaled.n * len(scaled))
        return response_of(scaled, self.name, answer, work, began)


def _slow_flow(scaled: ScaledChain, x: NDArray[np.float64]) -> NDArray[np.complex128]:
    """Multipliers of ``2 i omega A' = F - (kappa + 3/4 sign |A|^2 + i delta omega) A``; shape (N, n, 2).

    The exponents are -delta/2 +- sqrt(-kappa_1 kappa_3)/(2 omega), kappa_j = kappa + j sign 3/4 |A|^2: stable while the
    cubic's slope (delta omega)^2 + kappa_1 kappa_3 is positive.
    """
    kappa = scaled.k - scaled.omega**2
    v = 0.75 * scaled.sign * (x[:, 0] ** 2 + x[:, 1] ** 2)
    spread = np.sqrt(-(kappa + v) * (kappa + 3 * v) + 0j) / (2 * scaled.omega)
    exponents = np.stack([-0.5 * scaled.delta + spread, -0.5 * scaled.delta - spread])
    return np.exp(exponents * (2 * np.pi / scaled.omega)).transpose(2, 1, 0)
