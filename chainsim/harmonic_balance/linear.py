"""Linear response: a product of stage gains, or one coupled linear system where oscillators act on each other."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..equations.basis import Basis, basis_for
from ..equations.scaling import Stages
from ..floquet.monodromy import rest_multipliers
from ..model.chain import Chain, Setting
from ..model.response import Outcome, Response, Stats
from ..rung import Rung, Start
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

    def refusal(self, chain: Chain, setting: Setting, start: Start) -> str:
        """It answers every chain."""
        return ""

    def steady(self, chain: Chain, setting: Setting, *, tol: float, start: Start) -> Response:
        """The one answer a linear chain has, whatever the start. Without bound at a resonance without damping."""
        began = time.perf_counter()
        stages = Stages.of(chain, setting)
        basis = basis_for(1, stages.has_mean)
        straight = replace(stages, sign=np.zeros((1, 1)))
        if stages.joint:
            x = correct_joint(straight, basis, np.zeros((stages.n, basis.size, len(stages))), basis)
        else:
            x = linear_alone(straight, basis.mean) if is_long(stages) else _forward(straight, basis)
        finite = np.isfinite(x).all(axis=(0, 1))
        multipliers = rest_multipliers(stages) if stages.joint else _open_multipliers(stages)
        outcome = outcomes(len(stages), Outcome.OK)
        outcome[~finite] = Outcome.ESCAPED if stages.linear else Outcome.NO_CONVERGENCE
        if stages.linear:
            outcome[(np.abs(multipliers) > 1).any(axis=(1, 2))] = Outcome.ESCAPED
        if stages.linear and stages.joint:
            size = np.abs(x).max(axis=(0, 1))
            estimate = rounding_of(stages, basis, x / np.where(size > 0, size, 1.0))
        else:
            estimate = defect(stages, basis, x)
        answer = Answer(basis, x, outcome, np.zeros((stages.n, len(stages)), dtype=np.int8), estimate, multipliers)
        return response_of(stages, self.name, answer, Stats(oscillators_solved=stages.n * len(stages)), began)


def _forward(stages: Stages, basis: Basis) -> Floats:
    """Coordinates (n, d, N) of ``impedance_m A_m = F_m + links``, each oscillator after those that feed it."""
    impedance: Complexes = stages.k - stages.omega**2 + 1j * stages.delta * stages.omega
    phasor, x = np.zeros(stages.k.shape, dtype=np.complex128), np.zeros((stages.n, basis.size, len(stages)))
    still: Floats = np.array(stages.force)
    phasor[0] = stages.drive
    for layer in stages.layers:
        for links, source in ((stages.lam, layer - 1), (stages.other, layer + stages.stride)):
            fed, source = layer[source >= 0], source[source >= 0]
            if links is not None and len(fed):
                phasor[fed] += links[fed] * phasor[source]
                still[fed] += links[fed] * still[source]
        phasor[layer] /= impedance[layer]
        still[layer] /= stages.k[layer]
    x[:, 0], x[:, 1] = phasor.real, phasor.imag
    if basis.mean:
        x[:, -1] = still
    return x


def _open_multipliers(stages: Stages) -> Complexes:
    root: Complexes = np.sqrt(0.25 * stages.delta**2 - stages.k + 0j)
    exponents = np.stack([-0.5 * stages.delta + root, -0.5 * stages.delta - root])
    pairs: Complexes = np.exp(exponents * (2 * np.pi / stages.omega)).transpose(2, 1, 0)
    return pairs
