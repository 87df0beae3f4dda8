"""Linear response: a product of stage gains, or one coupled linear system where oscillators act on each other."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..equations.basis import Basis, basis_for
from ..equations.chain import Chain, Setting
from ..equations.scaled_chain import ScaledChain
from ..floquet.monodromy import rest_multipliers
from ..model.response import Outcome, Response, Stats
from ..rung import DEFLECTION, VIBRATION, Rung, Start
from .answer import Answer, defect, outcomes, response_of
from .joint import correct_joint, rounding_of
from .long import is_long
from .single import linear_alone

__all__ = ["LinearRung"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]


class LinearRung(Rung):
    """The chain without its cubic term: exact for beta = 0, else the limit of small amplitude."""

    name = "linear"
    order = "O(beta a^2) over the distance to resonance"
    valid = "beta a^2 << max(delta, lam)"
    models = frozenset[str]()
    answers = frozenset({DEFLECTION, VIBRATION})

    def refusal(self, chain: Chain, setting: Setting, start: Start) -> str:
        """It answers every chain."""
        return ""

    def steady(self, chain: Chain, setting: Setting, *, tol: float, start: Start) -> Response:
        """The one answer a linear chain has, whatever the start. Without bound at a resonance without damping."""
        began = time.perf_counter()
        scaled = ScaledChain.of(chain, setting)
        basis = basis_for(1, scaled.has_mean)
        straight = replace(scaled, sign=np.zeros((1, 1)))
        if scaled.joint:
            x = correct_joint(straight, basis, np.zeros((scaled.n, basis.size, len(scaled))), basis)
        else:
            x = linear_alone(straight, basis.mean) if is_long(scaled) else _forward(straight, basis)
        finite = np.isfinite(x).all(axis=(0, 1))
        multipliers = rest_multipliers(scaled) if scaled.joint else _open_multipliers(scaled)
        outcome = outcomes(len(scaled), Outcome.OK)
        outcome[~finite] = Outcome.ESCAPED if scaled.linear else Outcome.NO_CONVERGENCE
        if scaled.linear:
            outcome[(np.abs(multipliers) > 1).any(axis=(1, 2))] = Outcome.ESCAPED
        if scaled.linear and scaled.joint:
            size = np.abs(x).max(axis=(0, 1))
            estimate = rounding_of(scaled, basis, x / np.where(size > 0, size, 1.0))
        else:
            estimate = defect(scaled, basis, x)
        answer = Answer(basis, x, outcome, np.zeros((scaled.n, len(scaled)), dtype=np.int8), estimate, multipliers)
        return response_of(scaled, self.name, answer, Stats(oscillators_solved=scaled.n * len(scaled)), began)


def _forward(scaled: ScaledChain, basis: Basis) -> Floats:
    """Coordinates (n, d, N) of ``impedance_m A_m = F_m + links``, each oscillator after those that feed it."""
    impedance: Complexes = scaled.k - scaled.omega**2 + 1j * scaled.delta * scaled.omega
    phasor, x = np.zeros(scaled.k.shape, dtype=np.complex128), np.zeros((scaled.n, basis.size, len(scaled)))
    still: Floats = np.array(scaled.force)
    phasor[0] = scaled.drive
    for layer in scaled.layers:
        for links, source in scaled.feeds(layer):
            there = source >= 0
            fed, source, link = layer[there], source[there], links[there]
            phasor[fed] += link * phasor[source]
            still[fed] += link * still[source]
        phasor[layer] /= impedance[layer]
        still[layer] /= scaled.k[layer]
    x[:, 0], x[:, 1] = phasor.real, phasor.imag
    if basis.mean:
        x[:, -1] = still
    return x


def _open_multipliers(scaled: ScaledChain) -> Complexes:
    root: Complexes = np.sqrt(0.25 * scaled.delta**2 - scaled.k + 0j)
    exponents = np.stack([-0.5 * scaled.delta + root, -0.5 * scaled.delta - root])
    pairs: Complexes = np.exp(exponents * (2 * np.pi / scaled.omega)).transpose(2, 1, 0)
    return pairs
