"""The slow flow of the complex amplitudes: its right side, and how it begins from rest.

About the equilibrium z0 under constant forces (0 without them), with z_m = z0_m + Re(A_m e^{i omega tau}) + slaved
mean C, second harmonic E and third harmonic B, every oscillator obeys

    A'' + (2 i omega + delta) A' + (k + 3 beta z0^2 - omega^2 + i delta omega) A + N(A) = links + F,
    N = 3/4 beta |A|^2 A + 3 beta z0 (2 C A + E conj(A)) + 3/4 beta conj(A)^2 B,
    C = -(k + ..)^-1 (3/2) beta z0 |A|^2, E = -(.. - 4 omega^2 + 2 i delta omega)^-1 (3/2) beta z0 A^2,
    B = -((beta/4) A^3 + 3 beta z0 A E)/(k + .. - 9 omega^2 + 3 i delta omega).

Order 1 drops A'' and B. Order 2 splits A = a + c as `linear` does, exactly in all that is linear: a turns
slowly, c follows its drive. Nothing faster than the detuning is left to integrate, and both orders have the exact fixed
points of their balance.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..equations.chain import Chain, Setting
from ..equations.coupling import CouplingLaw
from .linear import diagonal, inverse, solvent, times

__all__ = ["Lean", "SlowFlow"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

ROUNDS = 2  # How often the nonlinear slaved part is found from itself; each leaves one power of beta a^2/4 more.
STARTS = 6  # The same for the state of rest, which is found once.
STEPS = 40


@dataclass(frozen=True)
class Lean:
    """What a constant force adds: the cubic term seen from the equilibrium beside it.

    Attributes
    ----------
    place : float64, shape (N, n), z0; NaN where the force holds none in the well.
    kappa : float64, shape (N, n), 3 beta z0.
    mean : float64, shape (N, n, n), what turns kappa |A|^2/2 into -C.
    second : complex128, shape (N, n, n), what turns kappa A^2/2 into -E.
    """

    place: Floats
    kappa: Floats
    mean: Floats
    second: Complexes


@dataclass(frozen=True)
class SlowFlow:
    """The flow of N settings of a chain.

    Attributes
    ----------
    beta : float64, shape (n,) or (1,), of the chain.
    omega : float64, shape (N, 1).
    law : who feeds whom.
    lam : float64, shape (N, n), links about which the linear part is exact.
    rate, weight, fast, slave : complex128, shape (N, n, n), S, W, R and R^-1 W (0 in order 1).
    stiff : complex128, shape (N, n, n), Z.
    third : complex128, shape (N, n), what turns the drive of B into B; 0 in order 1.
    lean : None without constant forces.
    rounds : how often the slaved part is found from itself; 0 in order 1.
    """

    beta: Floats
    law: CouplingLaw
    omega: Floats
    lam: Floats
    rate: Complexes
    weight: Complexes
    fast: Complexes
    slave: Complexes
    stiff: Complexes
    third: Complexes
    lean: Lean | None
    rounds: int

    @classmethod
    def of(cls, chain: Chain, setting: Setting, lam: Floats, order: int) -> SlowFlow:
        """The flow of `order` 1 or 2 about the links `lam`, shape (N, n)."""
        n = lam.shape[1]
        delta, beta = np.broadcast_to(chain.deltas, lam.shape), chain.betas
        omega = setting.omega[:, None]
        spring = chain.law.matrix(lam, setting.lam_y) + diagonal(np.broadcast_to(chain.stiffness, lam.shape).copy())
        lean = _lean(setting, spring, beta, delta)
        if lean is not None:
            spring = spring + diagonal(lean.kappa * lean.place)
        each = np.arange(n)
        own, damping = spring[:, each, each], np.asarray(2j * omega + delta, dtype=np.complex128)
        stiff = spring + diagonal(np.asarray(1j * delta * omega - omega**2, dtype=np.complex128))
        third = np.asarray((order == 2) / (9 * omega**2 - own - 3j * delta * omega), dtype=np.complex128)
        head = (beta, chain.law, omega, lam)
        if order == 1:
            weight, none = diagonal(1 / damping), np.zeros(spring.shape, dtype=np.complex128)
            return cls(*head, -weight @ stiff, weight, none, none, stiff, third, lean, 0)
        root: Complexes = 1j * np.sqrt(own - 0.25 * delta**2)
        slow = solvent(damping, stiff, root - 0.5 * damping)
        fast = solvent(damping, stiff, -root - 0.5 * damping)
        weight = inverse(slow - fast)
        return cls(*head, slow, weight, fast, inverse(fast) @ weight, stiff, third, lean, ROUNDS)

    @cached_property
    def bend(self) -> Floats:
        """3/4 beta."""
        return 0.75 * self.beta

    @cached_property
    def back_bend(self) -> Complexes:
        """What the third harmonic gives back: 3/16 beta^2 times `third`."""
        back: Complexes = 0.1875 * self.beta**2 * self.third
        return back

    @property
    def firm(self) -> Floats:
        """The least stiffness of any oscillator about its equilibrium; float64, shape (N,)."""
        own = np.diagonal(self.stiff, axis1=1, axis2=2).real + self.omega**2
        return np.asarray(own.min(axis=1))

    def cubic(self, amplitude: Complexes) -> Complexes:
        """N(A)."""
        square = amplitude.real**2 + amplitude.imag**2
        if self.lean is None:
            return self.gain(square) * amplitude
        mean, second, third = self.harmonics(amplitude)
        bent: Complexes = self.lean.kappa * (2 * mean * amplitude + second * amplitude.conj())
        return 0.75 * self.beta * (square * amplitude + amplitude.conj() ** 2 * third) + bent

    def gain(self, square: Floats) -> Complexes:
        """N(A)/A by |A|^2, without constant forces: 3/4 beta |A|^2, and what B = third beta/4 A^3 gives back."""
        return (self.bend + self.back_bend * square) * square

    def harmonics(self, amplitude: Complexes) -> tuple[Floats, Complexes, Complexes]:
        """C, E and B that go with A, shape (N, n) each."""
        own = 0.25 * self.beta * amplitude**3
        if self.lean is None:
            nothing = np.zeros(amplitude.shape)
            return nothing, nothing.astype(np.complex128), self.third * own
        kappa = self.lean.kappa
        mean = -0.5 * times(self.lean.mean, kappa * (amplitude.real**2 + amplitude.imag**2))
        second = -0.5 * times(self.lean.second, kappa * amplitude**2)
        return mean, second, self.third * (own + kappa * amplitude * second)

    def force(self, amplitude: Complexes, drive: Complexes, lam: Floats) -> Complexes:
        """G: everything but the linear part about `self.lam`, under the links `lam`; shape (N, n)."""
        push = self.pull(amplitude, lam)
        push[:, 0] += drive
        return push

    def pull(self, amplitude: Complexes, lam: Floats) -> Complexes:
        """G without the drive."""
        push = -self.cubic(amplitude)
        if lam is not self.lam:
            self.law.pull(push, amplitude, lam - self.lam)
        return push

    def amplitude(self, slow: Complexes, drive: Complexes, lam: Floats) -> Complexes:
        """A = a + c of the slow part a."""
        if not self.rounds:
            return slow
        return self.slaved(slow + self.slave[:, :, 0] * drive[:, None], lam)

    def slaved(self, base: Complexes, lam: Floats) -> Complexes:
        """A from a and the part of c that belongs to the drive."""
        whole = base
        for _ in range(self.rounds):
            whole = base + times(self.slave, self.pull(whole, lam))
        return whole

    def slow_part(self, amplitude: Complexes, drive: Complexes, lam: Floats) -> Complexes:
        """The slow part of a motion that follows its drive with amplitude A."""
        if not self.rounds:
            return amplitude
        return amplitude - times(self.slave, self.force(amplitude, drive, lam))

    def at_rest(self, drive: Complexes, lam: Floats) -> Complexes:
        """The slow part of z = z' = 0 under forces that have just set in.

        With a = p + i y, z = 0 gives p, and z' = Re((S + i omega) a + (R + i omega) c) + (that of the harmonics) = 0
        gives y; what is not linear in them is known from the round before.
        """
        omega, one = self.omega, 1j * self.omega[:, :, None] * np.eye(self.lam.shape[1])
        place = np.zeros(self.lam.shape) if self.lean is None else self.lean.place
        if not self.rounds:
            return -place.astype(np.complex128)
        turn = self.rate + one
        back = inverse(turn.imag)
        slow = -place.astype(np.complex128)
        for _ in range(STARTS):
            whole = self.amplitude(slow, drive, lam)
            follows, (mean, second, third) = whole - slow, self.harmonics(whole)
            at = -place - mean - (follows + second + third).real
            speed = times(self.fast + one, follows) + 1j * omega * (2 * second + 3 * third)
            slow = np.asarray(at + 1j * times(back, times(turn.real, at) + speed.real), dtype=np.complex128)
        return slow

    def driven(self, slow: Complexes, drive: Complexes, lam: Floats) -> Complexes:
        """What drives the slow part: a' = rate a + driven."""
        return times(self.weight, self.force(self.amplitude(slow, drive, lam), drive, lam))

    def pick(self, index: NDArray[np.intp] | NDArray[np.bool_]) -> SlowFlow:
        """The flow of some settings."""
        lean = self.lean
        if lean is not None:
            lean = Lean(*(getattr(lean, each.name)[index] for each in fields(lean)))
        each = ("omega", "lam", "rate", "weight", "fast", "slave", "stiff", "third")
        return replace(self, lean=lean, **{name: getattr(self, name)[index] for name in each})


def _lean(setting: Setting, spring: Floats, beta: Floats, delta: Floats) -> Lean | None:
    """The equilibrium under constant forces by Newton from 0, and what hangs on it."""
    load = np.array(setting.bias)
    load[:, 0] += setting.preload
    if not load.any():
        return None
    place = np.zeros(load.shape)
    for _ in range(STEPS):
        residual = times(spring, place) + beta * place**3 - load
        step = times(inverse(spring + diagonal(3 * beta * place**2)), residual)
        place = place - step
        if not (np.abs(step) > 1e-14 * np.abs(place)).any():
            break
    # Newton from 0 climbs to the equilibrium in the well; past its fold it finds none, or one beyond the hill.
    stiffness = np.diagonal(spring, axis1=1, axis2=2) + 3 * beta * place**2
    held = (np.abs(step) <= 1e-9 * np.abs(place) + 1e-300) & (stiffness > 0)
    place[~held.all(axis=1)] = np.nan
    kappa = 3 * beta * place
    firm = spring + diagonal(kappa * place)
    omega = setting.omega[:, None]
    second = inverse(firm + diagonal(np.asarray(2j * delta * omega - 4 * omega**2, dtype=np.complex128)))
    return Lean(place, kappa, inverse(firm), second)
