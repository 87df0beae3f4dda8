"""The envelope as a rung of the ladder: the steady state its slow flow reaches."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from .chain import Chain, Setting
from .envelope import slow_refusal
from .envelope_flow import SlowFlow, effect_of_third
from .envelope_settle import ORDER, Arrival, reached
from .response import Branch, Outcome, Response
from .rung import Rung, Start
from .starts import Cubic

__all__ = ["EnvelopeRung"]

# The joint Newton of the fixed point is dense.
MOST = 64
# Rounding of one oscillator's balance, times its sharpness 1/(delta omega) and the length of the chain.
ROUNDING = 1e-15


class EnvelopeRung(Rung):
    """The slow flow of the complex amplitudes with its third harmonic slaved."""

    name = "envelope"
    order = "order 2: O((delta, lam, detuning, beta a^2)^2) of a transient; a steady state O(beta^3 a^6)"
    valid = "delta, lam, detuning and beta a^2 << 1; transients, frame changes and slow beats, without constant forces"

    def refusal(self, chain: Chain, setting: Setting, start: Start) -> str:
        """Constant forces, strong damping, every branch."""
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
        flow = SlowFlow.of(chain, setting, setting.lam, ORDER)
        ok = arrival.outcome == Outcome.OK
        estimate = np.full(len(setting), np.inf)
        if ok.any():
            # The whole effect of the third harmonic, which is in: a bound of what the fifth can do.
            effect = effect_of_third(flow, np.where(ok[:, None], arrival.phasor, 0))
            rounding = ROUNDING * setting.n * (1 + 1 / np.maximum(chain.deltas.min() * setting.omega, 1e-12))
            estimate[ok] = (effect + rounding)[ok]
        outcome = arrival.outcome.copy()
        outcome[ok & ~(estimate <= tol)] = Outcome.OUT_OF_BUDGET
        harmonics = np.zeros((len(setting), 3, setting.n), dtype=np.complex128)
        harmonics[:, 0] = arrival.phasor
        harmonics[:, 2] = _third(flow, arrival.phasor)
        mean = np.where(ok[:, None], 0.0, np.full(arrival.phasor.shape, np.nan))
        multipliers = np.exp(arrival.rates * setting.period[:, None]).reshape(len(setting), setting.n, 2)
        branch = _branch(chain, setting, flow, arrival)
        for array in (outcome, harmonics, mean, multipliers, branch, estimate, ok):
            array.flags.writeable = False
        stats = replace(arrival.stats, oscillators_solved=len(setting) * setting.n, seconds=time.perf_counter() - began)
        return Response(self.name, outcome, harmonics, mean, ok, ok, multipliers, branch, estimate, stats)


def _third(flow: SlowFlow, amplitude: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Third harmonics, each also driven by the one before it."""
    own = flow.third * amplitude**3
    passed: NDArray[np.complex128] = own + flow.lam * np.roll(own, 1, axis=1) / (flow.stiff - 8 * flow.omega**2)
    return passed


def _branch(chain: Chain, setting: Setting, flow: SlowFlow, arrival: Arrival) -> NDArray[np.int8]:
    """Each oscillator's place among the roots of its cubic: low before the first fold, high past the second."""
    branch = np.zeros(arrival.phasor.shape, dtype=np.int8)
    if not chain.betas.any():
        return branch
    force = setting.lam * np.roll(arrival.phasor, 1, axis=1)
    force[:, 0] += setting.epsilon * np.exp(1j * setting.phase)
    beta = np.broadcast_to(chain.betas, (setting.n,))
    for m in range(setting.n):
        cubic = Cubic.of(flow.stiff[:, m].real, flow.stiff[:, m].imag, beta[m : m + 1], force[:, m])
        v = cubic.measure(arrival.phasor[:, m])
        branch[:, m] = np.where(v < cubic.peak, Branch.LOW, np.where(v > cubic.dip, Branch.HIGH, Branch.MIDDLE))
        branch[~cubic.multiple, m] = Branch.LOW
    return branch
