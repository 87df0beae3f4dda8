"""Two tones at once: quasi-periodic harmonic balance, oscillator by oscillator.

z_m = Re sum_k Z_km e^{i (k1 omega1 + k2 omega2) tau} over k1 + k2 odd, |k1| + |k2| <= order, one of each pair +-k. On
the torus of both phases z^3 is found on a grid fine enough to be exact.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..equations.chain import Chain, Setting
from ..equations.scaled_chain import ScaledChain
from ..model.response import Outcome
from .effects import TermsError, Tone

__all__ = ["TwoTones", "two_tones"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

LOADS = (0.25, 0.5, 0.75, 1.0)
NEWTON_STEPS = 25
CLOSE = 1e-12


@dataclass(frozen=True)
class TwoTones:
    """The quasi-periodic answer of a chain under two tones.

    Attributes
    ----------
    outcome : ok; escaped (it would pass a hilltop) or no_convergence, then NaN.
    index : int64, shape (H, 2), (k1, k2).
    omega : float64, shape (H,), the lines' frequencies.
    harmonics : complex128, shape (H, n), dimensionless amplitudes of the lines.
    error_estimate : distance to the answer with two orders more, relative to the largest line.
    """

    outcome: Outcome
    index: NDArray[np.int64]
    omega: Floats
    harmonics: Complexes
    error_estimate: float

    def line(self, k1: int, k2: int) -> Complexes:
        """Amplitudes (n,) of the line k1 omega1 + k2 omega2.

        Raises
        ------
        TermsError
            When it is not among the lines.
        """
        there = np.flatnonzero((self.index == (k1, k2)).all(axis=1))
        if not len(there):
            raise TermsError(f"line: ({k1}, {k2}) is not among the lines; k1 + k2 is odd, and k1 > 0 or k1 = 0 < k2")
        found: Complexes = self.harmonics[there[0]]
        return found

    def displacement(self, tau: Floats) -> Floats:
        """z at the instants `tau` (K,); float64, shape (K, n)."""
        moved: Floats = (np.exp(1j * np.outer(tau, self.omega)) @ self.harmonics).real
        return moved


def two_tones(chain: Chain, setting: Setting, tones: tuple[Tone, Tone], *, order: int) -> TwoTones:
    """Solve an open chain under two tones on the first oscillator, on the branch that grows from rest.

    Parameters
    ----------
    setting : one setting; its links count, its own tone does not. No bias or preload.
    order : highest |k1| + |k2|, odd; 5 is usual.

    Raises
    ------
    TermsError
        For a ring, a grid, a bias, equal frequencies, or an even order.
    """
    if not chain.law.in_line:
        raise TermsError("two tones: open chains only; use integrate_terms for the others")
    if len(setting) != 1 or setting.bias.any() or setting.preload.any():
        raise TermsError("two tones: expected one setting without bias or preload; use integrate_terms")
    if order < 1 or order % 2 == 0:
        raise TermsError(f"order: expected an odd number >= 1, got {order}")
    if len(tones) != 2 or tones[0].omega == tones[1].omega or min(t.omega for t in tones) <= 0:
        raise TermsError("tones: expected two of different frequencies > 0")
    answer, finer = (_solved(chain, setting, tones, top) for top in (order, order + 2))
    torus = _Torus(order, (tones[0].omega, tones[1].omega))
    if isinstance(answer, Outcome) or isinstance(finer, Outcome):
        failed = answer if isinstance(answer, Outcome) else Outcome.NO_CONVERGENCE
        nothing = np.full((len(torus.index), chain.n), np.nan, dtype=np.complex128)
        return TwoTones(failed, torus.index, torus.frequency, nothing, np.inf)
    wide = _Torus(order + 2, (tones[0].omega, tones[1].omega))
    shared = [int(np.flatnonzero((wide.index == k).all(axis=1))[0]) for k in torus.index]
    away = float(np.abs(answer - finer[shared]).max() / np.abs(finer).max())
    return TwoTones(Outcome.OK, torus.index, torus.frequency, answer, away)


@dataclass(frozen=True)
class _Torus:
    """The lines up to `order` and the matrices between them (Re, Im in turn) and a grid on the torus of phases."""

    order: int
    omega: tuple[float, float]

    @cached_property
    def index(self) -> NDArray[np.int64]:
        k = range(-self.order, self.order + 1)
        lines = [(a, b) for a in k for b in k if (a + b) % 2 and abs(a) + abs(b) <= self.order and (a, b) > (0, 0)]
        return np.array(sorted(lines, key=lambda line: (abs(line[0]) + abs(line[1]), line[1])), dtype=np.int64)

    @cached_property
    def frequency(self) -> Floats:
        found: Floats = self.index @ np.array(self.omega)
        return found

    @cached_property
    def values(self) -> Floats:
        """float64, shape (P, 2H). z^3 has lines to 3 order: more than 4 order points an axis keep them apart."""
        phase = 2 * np.pi * np.arange(4 * self.order + 1) / (4 * self.order + 1)
        first, second = (grid.ravel() for grid in np.meshgrid(phase, phase, indexing="ij"))
        angle = np.outer(first, self.index[:, 0]) + np.outer(second, self.index[:, 1])
        return np.stack([np.cos(angle), -np.sin(angle)], axis=2).reshape(len(first), -1)

    @cached_property
    def project(self) -> Floats:
        return 2 * self.values.T / len(self.values)

    def linear(self, k: float, delta: float) -> Floats:
        """Matrix of k - Omega^2 + i delta Omega on every line."""
        matrix = np.diag(np.repeat(k - self.frequency**2, 2))
        at = 2 * np.arange(len(self.frequency))
        matrix[at, at + 1], matrix[at + 1, at] = -delta * self.frequency, delta * self.frequency
        return matrix


def _solved(chain: Chain, setting: Setting, tones: tuple[Tone, Tone], order: int) -> Complexes | Outcome:
    """Amplitudes (H, n), or why there are none."""
    torus = _Torus(order, (tones[0].omega, tones[1].omega))
    strongest = max(abs(t.epsilon) for t in tones)
    scaled = ScaledChain.of(chain, Setting.of(chain, epsilon=strongest, lam=0.0, omega=1.0))
    length, sign = scaled.length, np.broadcast_to(scaled.sign, (chain.n, 1))[:, 0]
    stiffness = ScaledChain.of(chain, setting).k[:, 0]
    delta = np.broadcast_to(chain.deltas, (chain.n,))
    force = np.zeros(2 * len(torus.index))
    for tone, k in zip(tones, ((1, 0), (0, 1)), strict=True):
        at = 2 * int(np.flatnonzero((torus.index == k).all(axis=1))[0])
        phasor = tone.epsilon * length * np.exp(1j * tone.phase)
        force[at : at + 2] = phasor.real, phasor.imag
    x = np.zeros((chain.n, len(force)))
    for load in LOADS:
        push: Floats = load * force
        for m in range(chain.n):
            linear = torus.linear(float(stiffness[m]), float(delta[m]))
            begin = x[m]
            if load == LOADS[0]:
                begin = np.asarray(np.linalg.solve(linear, push), dtype=np.float64)
            found = _newton(torus, linear, float(sign[m]), push, begin)
            if found is None:
                return Outcome.NO_CONVERGENCE
            if sign[m] * float(np.abs(torus.values @ found).max()) ** 2 <= -max(float(stiffness[m]), 0.0):
                return Outcome.ESCAPED
            x[m] = found
            if m + 1 < chain.n:
                push = float(setting.lam[0, m + 1]) * found
    answer = np.empty((len(torus.index), chain.n), dtype=np.complex128)
    answer.real, answer.imag = x[:, 0::2].T / length, x[:, 1::2].T / length
    return answer


def _newton(torus: _Torus, linear: Floats, sign: float, push: Floats, start: Floats) -> Floats | None:
    x = start.copy()
    for _ in range(NEWTON_STEPS):
        z = torus.values @ x
        jacobian = linear + 3 * sign * (torus.project * z**2) @ torus.values
        residual = linear @ x + sign * torus.project @ z**3 - push
        step = np.linalg.solve(jacobian, residual)
        x = x - step
        if not np.isfinite(x).all():
            return None
        if np.abs(step).max() <= CLOSE * max(float(np.abs(x).max()), 1e-300):
            return x
    return None
