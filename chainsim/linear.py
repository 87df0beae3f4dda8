"""Linear response: a product of stage gains, closed by one division in a ring."""

from __future__ import annotations

import time

import numpy as np
from numpy.typing import NDArray

from .answer import Answer, defect, outcomes, response_of
from .basis import basis_for
from .chain import Chain, Closure, Setting
from .response import Outcome, Response, Stats
from .rung import Rung, Start
from .scaling import Stages

__all__ = ["LinearRung"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]


class LinearRung(Rung):
    """The chain without its cubic term: exact for beta = 0, else the limit of small amplitude."""

    name = "linear"
    order = "O(beta a^2) over the distance to resonance"
    valid = "beta a^2 << max(delta, lam)"

    def refusal(self, chain: Chain, setting: Setting, start: Start) -> str:
        """A ring only without the cubic term, since nothing here can say how wrong it is."""
        if chain.closure is Closure.RING and chain.beta:
            return "a ring with beta other than 0 needs rung ode or auto"
        return ""

    def steady(self, chain: Chain, setting: Setting, *, tol: float, start: Start) -> Response:
        """The one answer a linear chain has, whatever the start. Without bound at a resonance without damping."""
        began = time.perf_counter()
        stages = Stages.of(chain, setting)
        basis = basis_for(1, stages.has_mean)
        ring = chain.closure is Closure.RING
        x = np.empty((stages.n, basis.size, len(stages)))
        impedance: Complexes = stages.k - stages.omega**2 + 1j * stages.delta * stages.omega
        phasor = _through(impedance, stages.lam, stages.drive, None, ring)
        x[:, 0], x[:, 1] = phasor.real, phasor.imag
        if basis.mean:
            still = np.zeros(len(stages), dtype=np.complex128)
            means = _through(stages.k.astype(np.complex128), stages.lam, still, stages.force, ring)
            x[:, -1] = means.real
        finite = np.isfinite(x).all(axis=(0, 1))
        multipliers = _ring_multipliers(stages) if ring else _open_multipliers(stages)
        outcome = outcomes(len(stages), Outcome.OK)
        outcome[~finite] = Outcome.ESCAPED if not chain.beta else Outcome.NO_CONVERGENCE
        if not chain.beta:
            outcome[(np.abs(multipliers) > 1).any(axis=(1, 2))] = Outcome.ESCAPED
        estimate = _rounding(impedance, stages) if ring else defect(stages, basis, x)
        answer = Answer(basis, x, outcome, np.zeros((stages.n, len(stages)), dtype=np.int8), estimate, multipliers)
        return response_of(stages, self.name, answer, Stats(oscillators_solved=stages.n * len(stages)), began)


def _through(impedance: Complexes, lam: Floats, drive: Complexes, force: Floats | None, ring: bool) -> Complexes:
    """Amplitudes (n, N) of ``impedance_m A_m = lam_m A_{m-1} + F_m``, A_0 = A_n in a ring, else lam_1 = 0.

    Without closing, A_n = forced + (product of gains) A_0; a ring asks for A_n = A_0 and so divides once by
    1 - product (the determinant of a circulant when the links are equal).
    """
    forced = np.empty(impedance.shape, dtype=np.complex128)
    carried = np.empty(impedance.shape, dtype=np.complex128)
    previous, product = np.zeros(impedance.shape[1], dtype=np.complex128), np.ones(impedance.shape[1]) + 0j
    for m in range(len(impedance)):
        load = drive if m == 0 else 0.0
        load = load + (force[m] if force is not None else 0.0)
        previous = (lam[m] * previous + load) / impedance[m]
        product = product * (lam[m] / impedance[m])
        forced[m], carried[m] = previous, product
    if not ring:
        return forced
    closing = forced[-1] / (1 - carried[-1])
    closed: Complexes = forced + carried * closing
    return closed


def _open_multipliers(stages: Stages) -> Complexes:
    root: Complexes = np.sqrt(0.25 * stages.delta**2 - stages.k + 0j)
    exponents = np.stack([-0.5 * stages.delta + root, -0.5 * stages.delta - root])
    pairs: Complexes = np.exp(exponents * (2 * np.pi / stages.omega)).transpose(2, 1, 0)
    return pairs


def _ring_multipliers(stages: Stages) -> Complexes:
    """exp(s T) of the eigenvalues s of the ring's first-order system; shape (N, n, 2)."""
    n, size = stages.n, len(stages)
    system = np.zeros((size, 2 * n, 2 * n))
    m = np.arange(n)
    system[:, m, n + m] = 1.0
    system[:, n + m, n + m] = -stages.delta
    system[:, n + m, m] -= stages.k.T
    system[:, n + m, (m - 1) % n] += stages.lam.T
    exponents = np.linalg.eigvals(system).astype(np.complex128)
    turned: Complexes = np.exp(exponents * (2 * np.pi / stages.omega)[:, None])
    return turned.reshape(size, n, 2)


def _rounding(impedance: Complexes, stages: Stages) -> Floats:
    """Rounding of a ring's answer, enlarged by how nearly its loop gain is 1; float64, shape (N,)."""
    loop = np.prod(stages.lam / impedance, axis=0)
    sharpness = (np.abs(stages.k) + stages.omega**2).max(axis=0) / np.abs(impedance).min(axis=0)
    bound: Floats = 1e-15 * stages.n * sharpness * (1 + np.abs(loop)) / np.abs(1 - loop)
    return bound
