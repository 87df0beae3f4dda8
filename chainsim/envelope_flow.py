"""The slow flow of the complex amplitudes: its right side, its fixed points, its steps.

With z_m = Re(A_m e^{i omega tau}) and the third harmonic B_m slaved, every oscillator obeys

    A'' + (2 i omega + delta) A' + (1 + lam - omega^2 + i delta omega) A + N(A) = lam A_{m-1} + F,
    N = 3/4 beta |A|^2 A + 3/4 beta conj(A)^2 B,    B = -(beta/4) A^3 / (1 + lam - 9 omega^2 + 3 i delta omega).

Order 1 drops A'' and B. Order 2 keeps both roots of the linear part exactly: A = a + c, where a turns slowly
(a' = s a + G/(s - r), s near 0) and c, which turns at r near -2 i omega, follows its drive: c = G/((s - r) r). G is all
that is not in the linear part. Nothing faster than the detuning is left to integrate, and both orders have the exact
fixed points of their balance.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .chain import Chain, CouplingKind, Setting

__all__ = ["SlowFlow", "Steps", "effect_of_third", "fixed_point", "pick", "rates_at"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

# The slaved part feeds on itself with a factor of about lam/4. Each round leaves one power more of it: two are enough
# where it is faint, three elsewhere.
ROUNDS = (2, 3)
FAINT = 0.01
NEWTON_STEPS = 30


@dataclass(frozen=True)
class SlowFlow:
    """The flow of N settings of a chain.

    Attributes
    ----------
    beta : float64, shape (n,) or (1,), of the chain. omega : float64, shape (N, 1).
    back : 1 where a link also pulls its receiver back (resistor), 0 where not (amplifier).
    lam : float64, shape (N, n), links about which the linear part is exact; ``lam[:, 0]`` closes a ring.
    rate : complex128, shape (N, n), s. weight : complex128, shape (N, n), what turns G into a'.
    slave : complex128, shape (N, n), what turns G into c; 0 in order 1.
    third : complex128, shape (N, n), what turns A^3 into B; 0 in order 1.
    stiff : complex128, shape (N, n), k - omega^2 + i delta omega with k = 1 + lam, or what the chain has instead.
    rounds : how often the slaved part is found from itself; 0 in order 1.
    """

    beta: Floats
    back: float
    omega: Floats
    lam: Floats
    rate: Complexes
    weight: Complexes
    slave: Complexes
    third: Complexes
    stiff: Complexes
    rounds: int

    @classmethod
    def of(cls, chain: Chain, setting: Setting, lam: Floats, order: int) -> SlowFlow:
        """The flow of `order` 1 or 2 about the links `lam`, shape (N, n)."""
        delta, omega, beta = chain.deltas, setting.omega[:, None], chain.betas
        back = float(chain.kind is CouplingKind.RESISTOR)
        k = chain.stiffness + back * lam
        stiff = (k - omega**2).astype(np.complex128) + 1j * delta * omega
        if order == 1:
            weight = np.broadcast_to(1 / (2j * omega + delta), lam.shape)
            nothing = np.zeros(lam.shape, dtype=np.complex128)
            return cls(beta, back, omega, lam, -stiff * weight, weight, nothing, nothing, stiff, 0)
        root = 1j * np.sqrt(k - 0.25 * delta**2)
        slow, fast = -1j * omega - 0.5 * delta + root, -1j * omega - 0.5 * delta - root
        weight = 0.5 / root
        slave = weight / fast
        third = -0.25 * beta.astype(np.complex128) / (stiff - 8 * omega**2 + 2j * delta * omega)
        strength = float(np.max(np.abs(slave) * (np.abs(lam) + np.abs(stiff))))
        return cls(beta, back, omega, lam, slow, weight, slave, third, stiff, ROUNDS[strength > FAINT])

    def cubic(self, amplitude: Complexes) -> Complexes:
        """N(A)."""
        square = (amplitude * amplitude.conj()).real
        if not self.rounds:
            return 0.75 * self.beta * square * amplitude
        return 0.75 * self.beta * (square + self.third * square**2) * amplitude

    def force(self, amplitude: Complexes, drive: Complexes, lam: Floats) -> Complexes:
        """G: everything but the linear part about `self.lam`, under the links `lam`; shape (N, n)."""
        push = lam * amplitude[:, np.arange(-1, lam.shape[1] - 1)] - self.cubic(amplitude)
        if lam is not self.lam:
            push -= self.back * (lam - self.lam) * amplitude
        push[:, 0] += drive
        return push

    def amplitude(self, slow: Complexes, drive: Complexes, lam: Floats) -> Complexes:
        """A = a + c of the slow part a."""
        whole = slow
        for _ in range(self.rounds):
            whole = slow + self.slave * self.force(whole, drive, lam)
        return whole

    def slow_part(self, amplitude: Complexes, drive: Complexes, lam: Floats) -> Complexes:
        """The slow part of a motion that follows its drive with amplitude A."""
        return amplitude - self.slave * self.force(amplitude, drive, lam)

    def at_rest(self, drive: Complexes, lam: Floats) -> Complexes:
        """The slow part of z = z' = 0 under a drive that has just set in: a = -conj(c), so that both vanish."""
        whole = np.zeros(self.rate.shape, dtype=np.complex128)
        follows = whole
        for _ in range(self.rounds):
            follows = self.slave * self.force(whole, drive, lam)
            whole = follows - follows.conj()
        return -follows.conj()

    def driven(self, slow: Complexes, drive: Complexes, lam: Floats) -> Complexes:
        """What drives the slow part: a' = rate a + driven."""
        return self.weight * self.force(self.amplitude(slow, drive, lam), drive, lam)


@dataclass(frozen=True)
class Steps:
    """Coefficients of one step of the fourth-order exponential Runge-Kutta method of Cox and Matthews (J. Comput. Phys.
    176, 2002, eq. 26-29), which has the linear part exactly; each complex128, shape (N, n).
    """

    whole: Complexes
    half: Complexes
    stage: Complexes
    first: Complexes
    middle: Complexes
    last: Complexes

    @classmethod
    def of(cls, rate: Complexes, h: Floats) -> Steps:
        """For steps `h`, shape (N, 1)."""
        one, two, three = _phi(rate * h)
        return cls(
            np.exp(rate * h), np.exp(0.5 * rate * h), 0.5 * h * _phi(0.5 * rate * h)[0],
            h * (one - 3 * two + 4 * three), 2 * h * (two - 2 * three), h * (4 * three - two),
        )  # fmt: skip

    def take(
        self, flow: SlowFlow, slow: Complexes, drive: tuple[Complexes, Complexes], lam: tuple[Floats, Floats]
    ) -> Complexes:
        """One step; `drive` and `lam` are given at its start and end and are linear between."""
        (f0, f1), (l0, l1) = drive, lam
        fm, lm = 0.5 * (f0 + f1), 0.5 * (l0 + l1)
        n0 = flow.driven(slow, f0, l0)
        a = self.half * slow + self.stage * n0
        na = flow.driven(a, fm, lm)
        b = self.half * slow + self.stage * na
        nb = flow.driven(b, fm, lm)
        c = self.half * a + self.stage * (2 * nb - n0)
        return self.whole * slow + self.first * n0 + self.middle * (na + nb) + self.last * flow.driven(c, f1, l1)


def fixed_point(flow: SlowFlow, drive: Complexes, start: Complexes) -> tuple[Complexes, NDArray[np.bool_]]:
    """Amplitudes (N, n) at rest in the slow flow near `start`, by Newton, and where they were found."""
    found = start.copy()
    ok = np.zeros(len(start), dtype=bool)
    todo = np.flatnonzero(np.isfinite(start).all(axis=1))
    for _ in range(NEWTON_STEPS):
        if not len(todo):
            break
        part, here = pick(flow, todo), found[todo]
        residual = part.stiff * here + part.cubic(here) - part.lam * np.roll(here, 1, axis=1)
        residual[:, 0] -= drive[todo]
        step = _solve(_jacobian(part, here), residual)
        found[todo] = here - step
        size = np.abs(step).max(axis=1) / np.maximum(np.abs(found[todo]).max(axis=1), 1e-300)
        still = ~(size <= 1e-13)
        ok[todo[~still | (size <= 1e-11)]] = True
        todo = todo[still & np.isfinite(size)]
    return found, ok


def rates_at(flow: SlowFlow, amplitude: Complexes) -> Complexes:
    """Eigenvalues of the slow flow about `amplitude`, shape (N, 2n), per unit of tau.

    With dG = (stiff - J) dA, the slaving dA = da + slave dG gives da' = rate da + weight dG (1 - slave dG)^-1 da.
    """
    values = np.full((len(amplitude), 2 * amplitude.shape[1]), np.nan, dtype=np.complex128)
    known = np.flatnonzero(np.isfinite(amplitude).all(axis=1))
    if len(known):
        here = pick(flow, known)
        force = _real(here.stiff) - _jacobian(here, amplitude[known])
        whole = np.linalg.inv(np.eye(values.shape[1]) - _real(here.slave) @ force)
        values[known] = np.linalg.eigvals(_real(here.rate) + _real(here.weight) @ force @ whole)
    return values


def effect_of_third(flow: SlowFlow, amplitude: Complexes) -> Floats:
    """How far the third harmonics move the fixed point, relative to its largest amplitude; float64, shape (N,)."""
    third = -0.25 * flow.beta * amplitude**3
    faint = flow.stiff - 8 * flow.omega**2
    third = (third + flow.lam * np.roll(third / faint, 1, axis=1)) / faint
    moved = _solve(_jacobian(flow, amplitude), 0.75 * flow.beta * amplitude.conj() ** 2 * third)
    effect: Floats = np.abs(moved).max(axis=1) / np.maximum(np.abs(amplitude).max(axis=1), 1e-300)
    return effect


def pick(flow: SlowFlow, index: NDArray[np.intp] | NDArray[np.bool_]) -> SlowFlow:
    """The flow of some settings."""
    return SlowFlow(
        flow.beta, flow.back, flow.omega[index], flow.lam[index], flow.rate[index], flow.weight[index],
        flow.slave[index], flow.third[index], flow.stiff[index], flow.rounds,
    )  # fmt: skip


def _jacobian(flow: SlowFlow, amplitude: Complexes) -> Floats:
    """Of the balance by (Re A, Im A), shape (N, 2n, 2n): dZ = P dA + Q conj(dA) - lam dA_before."""
    n = amplitude.shape[1]
    square = (amplitude * amplitude.conj()).real
    by = flow.stiff + 1.5 * flow.beta * square + 2.25 * flow.beta * flow.third * square**2
    against = (0.75 + 1.5 * flow.third * square) * flow.beta * amplitude**2
    matrix = np.zeros((len(amplitude), 2 * n, 2 * n))
    m, before = np.arange(n), (np.arange(n) - 1) % n
    matrix[:, m, m], matrix[:, m, n + m] = (by + against).real, -(by - against).imag
    matrix[:, n + m, m], matrix[:, n + m, n + m] = (by + against).imag, (by - against).real
    matrix[:, m, before] -= flow.lam
    matrix[:, n + m, n + before] -= flow.lam
    return matrix


def _real(factor: Complexes) -> Floats:
    """Multiplication by `factor` (N, n) as matrices on (Re, Im), shape (N, 2n, 2n)."""
    n = factor.shape[1]
    matrix = np.zeros((len(factor), 2 * n, 2 * n))
    m = np.arange(n)
    matrix[:, m, m] = matrix[:, n + m, n + m] = factor.real
    matrix[:, m, n + m], matrix[:, n + m, m] = -factor.imag, factor.imag
    return matrix


def _solve(matrix: Floats, right: Complexes) -> Complexes:
    n = right.shape[1]
    both = np.concatenate([right.real, right.imag], axis=1)[..., None]
    wild = ~(np.isfinite(matrix).all(axis=(1, 2)) & np.isfinite(both).all(axis=(1, 2)))
    if wild.any():
        matrix, both = matrix.copy(), both.copy()
        matrix[wild], both[wild] = np.eye(2 * n), np.nan
    try:
        step = np.linalg.solve(matrix, both)[..., 0]
    except np.linalg.LinAlgError:
        # One setting exactly at a fold must not stop the others.
        step = (np.linalg.pinv(matrix) @ both)[..., 0]
    answer: Complexes = step[:, :n] + 1j * step[:, n:]
    return answer


def _phi(z: Complexes) -> tuple[Complexes, Complexes, Complexes]:
    """phi_1, phi_2, phi_3: (e^z - 1)/z and so on, by their series where the formulas cancel."""
    series: list[Complexes] = []
    for k in (1, 2, 3):
        term = np.full(z.shape, 1 / (1, 1, 2, 6)[k], dtype=np.complex128)
        total = term.copy()
        for j in range(1, 20):
            term = term * z / (j + k)
            total = total + term
        series.append(total)
    small = np.abs(z) < 1
    safe = np.where(small, 1.0, z)
    one = np.where(small, series[0], (np.exp(safe) - 1) / safe)
    two = np.where(small, series[1], (one - 1) / safe)
    three = np.where(small, series[2], (two - 0.5) / safe)
    return one, two, three
