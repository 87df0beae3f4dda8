"""The envelope as a rung of the ladder: the steady state its slow flow reaches."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..equations.basis import basis_for
from ..equations.chain import Chain, Setting
from ..equations.scaled_chain import ScaledChain
from ..harmonic_balance.answer import defect
from ..harmonic_balance.march import branches_of
from ..model.response import Outcome, Response
from ..rung import TERMS, Rung, Start
from .envelope import slow_refusal
from .flow import SlowFlow
from .linear import times
from .run import ORDER
from .settle import Arrival, reached

__all__ = ["EnvelopeRung"]

# The matrices of the slow flow are dense.
MOST = 64


class EnvelopeRung(Rung):
    """The slow flow of the complex amplitudes, with its mean, second and third harmonics slaved."""

    name = "envelope"
    order = "2 in delta, lam, detuning and beta a^2 for a transient; a steady state to O(beta^2 a^4), with bias O(a^3)"
    valid = "delta, lam, detuning, beta a^2 << 1, and beta z0 a << 1 about an equilibrium z0; transients and slow beats"
    models = TERMS

    def refusal(self, chain: Chain, setting: Setting, start: Start) -> str:
        """Strong damping, soft oscillators, too many of them, every branch."""
        if start is Start.ALL:
            return "it follows one way in, not every branch; use rung harmonic_balance"
        if setting.n > MOST:
            return f"it takes up to {MOST} oscillators, got {setting.n}; use rung harmonic_balance or ode"
        if not chain.deltas.min() > 0:
            return "without damping nothing settles; use rung harmonic_balance"
        return slow_refusal(chain, setting)

    def steady(self, chain: Chain, setting: Setting, *, tol: float, start: Start) -> Response:
        """What is reached from rest or by a ramp; an answer whose estimate is above `tol` is out of budget."""
        began = time.perf_counter()
        arrival = reached(chain, setting, start=start)
        ok = arrival.outcome == Outcome.OK
        harmonics, mean = _series(chain, setting, arrival)
        scaled = ScaledChain.of(chain, setting)
        basis = basis_for(3, scaled.has_mean)
        x = basis.coordinates(harmonics.transpose(1, 2, 0), mean.T).transpose(1, 0, 2) * scaled.length
        estimate = np.full(len(setting), np.inf)
        if ok.any():
            estimate[ok] = defect(scaled.pick(ok), basis, x[:, :, ok])
        outcome = arrival.outcome.copy()
        outcome[ok & ~(estimate <= tol)] = Outcome.OUT_OF_BUDGET
        multipliers = np.exp(arrival.rates * setting.period[:, None]).reshape(len(setting), setting.n, 2)
        branch = np.ascontiguousarray(branches_of(scaled, basis, x).T)
        for array in (outcome, harmonics, mean, multipliers, branch, estimate, ok):
            array.flags.writeable = False
        stats = replace(arrival.stats, oscillators_solved=len(setting) * setting.n, seconds=time.perf_counter() - began)
        return Response(self.name, outcome, harmonics, mean, ok, ok, multipliers, branch, estimate, stats)


def _series(chain: Chain, setting: Setting, arrival: Arrival) -> tuple[NDArray[np.complex128], NDArray[np.float64]]:
    """Harmonics (N, 3, n) and means (N, n) that go with the amplitudes reached."""
    flow = SlowFlow.of(chain, setting, setting.lam, ORDER)
    mean, second, third = flow.harmonics(arrival.phasor)
    # A third harmonic is also driven by those of the oscillators that feed it.
    each = np.arange(setting.n)
    links = -flow.stiff
    links[:, each, each] = 0
    third = third - flow.third * times(links, third)
    if flow.lean is not None:
        mean = mean + flow.lean.place
    return np.stack([arrival.phasor, second, third], axis=1), np.where(np.isfinite(arrival.phasor), mean, np.nan)
