"""The single-harmonic cubic of one oscillator: every root, each from a start that Newton cannot miss."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["Cubic", "mean_of", "mean_starts", "newton_of_one"]

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Complexes = NDArray[np.complex128]

MAX_STEPS = 80
# Amplitudes looked at when a mean makes the amplitude equation transcendental.
SCAN = 96
HALVINGS = 24


@dataclass(frozen=True)
class Cubic:
    """``p(v) = v ((kappa + sign v)^2 + g^2) = c`` with v = 3/4 strength |A|^2, kappa = k - omega^2, g = delta omega.

    c = 3/4 strength |F|^2. One or three roots; with three, the middle one is unstable. All arrays float64, shape (N,),
    sign (of beta) and strength (|beta|, scaled) the same or shape (1,).

    `peak`, `dip` : v at the local maximum and minimum of p (the two folds) where `folded`, else 0.
    """

    kappa: Floats
    g: Floats
    sign: Floats
    strength: Floats
    c: Floats
    folded: Bools
    peak: Floats
    dip: Floats

    @classmethod
    def of(cls, kappa: Floats, g: Floats, beta: Floats | float, force: Complexes) -> Cubic:
        """The cubic under a force of complex amplitude `force`, shape (N,)."""
        each = np.atleast_1d(np.asarray(beta, dtype=np.float64))
        sign, strength = np.sign(each), np.abs(each)
        c = 0.75 * strength * (force.real * force.real + force.imag * force.imag)
        bend = -sign * kappa
        spread = kappa * kappa - 3 * g * g
        folded = (bend > 0) & (spread > 0)
        if not folded.any():
            none = np.zeros(kappa.shape)
            return cls(kappa, g, sign, strength, c, folded, none, none)
        root = np.sqrt(np.where(folded, spread, 0.0))
        # The smaller critical point by Vieta, which does not cancel: peak * dip = (kappa^2 + g^2) / 3.
        dip = np.where(folded, (2 * bend + root) / 3, 0.0)
        peak = np.where(folded, (kappa * kappa + g * g) / np.where(folded, 3 * dip, 1.0), 0.0)
        return cls(kappa, g, sign, strength, c, folded, peak, dip)

    def measure(self, phasor: Complexes) -> Floats:
        """v of the amplitude |phasor|."""
        return 0.75 * self.strength * (phasor.real * phasor.real + phasor.imag * phasor.imag)

    def value(self, v: Floats) -> Floats:
        """p(v)."""
        stiff = self.kappa + self.sign * v
        return v * (stiff * stiff + self.g * self.g)

    def slope(self, v: Floats) -> Floats:
        """p'(v); its sign decides the slow-flow stability of a root."""
        stiff = self.kappa + self.sign * v
        return stiff * (stiff + 2 * self.sign * v) + self.g * self.g

    @property
    def multiple(self) -> Bools:
        """Whether there are three roots."""
        return self.folded & (self.c <= self.value(self.peak)) & (self.c >= self.value(self.dip))

    def lowest(self) -> Floats:
        """The smallest root; float64, shape (N,)."""
        bend = np.maximum(-self.sign * self.kappa, 0.0)
        turn = np.where(self.folded, self.peak, 2 * bend / 3)
        # Left of the turn p is concave: Newton climbs to the root from 0. Right of it p is convex: it descends.
        from_zero = (bend > 0) & (self.c <= self.value(turn))
        return self._newton(np.where(from_zero, 0.0, self._above()))

    def highest(self) -> Floats:
        """The largest root where there are three; NaN elsewhere."""
        return np.where(self.multiple, self._newton(self._above()), np.nan)

    def middle(self) -> Floats:
        """The unstable root where there are three; NaN elsewhere."""
        inflection = -2 * self.sign * self.kappa / 3
        return np.where(self.multiple, self._newton(np.maximum(inflection, 0.0)), np.nan)

    def amplitude(self, v: Floats, force: Complexes) -> Complexes:
        """The phasor A that belongs to a root."""
        return force / (self.kappa + self.sign * v + 1j * self.g)

    def _above(self) -> Floats:
        """An upper bound of every root."""
        cube = np.cbrt(self.c)
        linear = self.kappa * self.kappa + self.g * self.g
        tame = np.minimum(cube, np.where(linear > 0, self.c / linear, np.inf))
        return np.where(self.sign * self.kappa >= 0, tame, np.abs(self.kappa) + cube)

    def _newton(self, v: Floats) -> Floats:
        if v.size == 1:
            return np.full(v.shape, self._newton_of_one(float(v.flat[0])))
        for _ in range(MAX_STEPS):
            stiff = self.kappa + self.sign * v
            slope = stiff * (stiff + 2 * self.sign * v) + self.g * self.g
            step = (v * (stiff * stiff + self.g * self.g) - self.c) / slope
            step = np.where(np.isfinite(step), step, 0.0)
            v = v - step
            if (np.abs(step) <= 1e-9 * np.abs(v)).all():
                break
        return v

    def _newton_of_one(self, v: float) -> float:
        """The same for one setting alone, where a NumPy call costs more than the arithmetic."""
        kappa, gg, c, sign = float(self.kappa[0]), float(self.g[0]) ** 2, float(self.c[0]), float(self.sign[0])
        return newton_of_one(kappa, gg, c, sign, v)


def newton_of_one(kappa: float, gg: float, c: float, sign: float, v: float) -> float:
    """A root of ``v ((kappa + sign v)^2 + gg) = c`` from the start `v`, in plain numbers."""
    for _ in range(MAX_STEPS):
        stiff = kappa + sign * v
        slope = stiff * (stiff + 2 * sign * v) + gg
        if slope == 0 or not math.isfinite(slope):
            break
        step = (v * (stiff * stiff + gg) - c) / slope
        v -= step
        if abs(step) <= 1e-9 * abs(v):
            break
    return v


def mean_starts(
    kappa: Floats, g: Floats, k: Floats, sign: Floats, force: Complexes, constant: Floats
) -> tuple[Complexes, Floats]:
    """Starts (phasor, mean) of an oscillator under a constant force, both of shape (3, N), NaN where fewer.

    For a given y = |A|^2 the mean c solves ``c (k + 3/2 sign y + sign c^2) = constant`` and the first harmonic sees
    ``kappa + 3 sign c^2 + 3/4 sign y - 9/2 sign^2 c^2 y / D`` with the second harmonic's impedance D slaved to it.
    Sign changes of the amplitude equation over a scan of y are the starts.
    """
    strength = np.abs(sign)
    c34 = 0.75 * strength * np.abs(force) ** 2
    linear = np.abs(force) ** 2 / (kappa**2 + g**2)
    top = np.where(strength > 0, (np.abs(kappa) + np.cbrt(c34)) / (0.75 * strength), linear)
    omega2 = k - kappa

    def equation(y: Floats) -> tuple[Floats, Floats, Floats]:
        mean = mean_of(k + 1.5 * sign * y, sign, constant)
        second = k + 3 * sign * mean**2 + 1.5 * sign * y - 4 * omega2
        stiff = kappa + 3 * sign * mean**2 + 0.75 * sign * y - 4.5 * (sign * mean) ** 2 * y / second
        return y * (stiff**2 + g**2) - np.abs(force) ** 2, stiff, mean

    fractions = np.linspace(0.0, 1.05, SCAN)[:, None] ** 3
    scan = fractions * top
    value = equation(scan)[0]
    crossing = np.isfinite(value[1:]) & np.isfinite(value[:-1]) & ((value[1:] > 0) != (value[:-1] > 0))
    rank = np.cumsum(crossing, axis=0)
    phasors = np.full((3, len(k)), np.nan, dtype=np.complex128)
    means = np.full((3, len(k)), np.nan)
    for which in range(3):
        cell = (crossing & (rank == which + 1)).argmax(axis=0)
        there = rank[-1] > which
        low, high = np.take_along_axis(scan, cell[None], 0)[0], np.take_along_axis(scan, cell[None] + 1, 0)[0]
        rising = equation(high)[0] > 0
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            above = (equation(middle)[0] > 0) == rising
            low, high = np.where(above, low, middle), np.where(above, middle, high)
        _, stiff, mean = equation(0.5 * (low + high))
        phasors[which] = np.where(there, force / (stiff + 1j * g), np.nan)
        means[which] = np.where(there, mean, np.nan)
    return phasors, means


def mean_of(stiffness: Floats, sign: Floats, constant: Floats) -> Floats:
    """Root of ``c (stiffness + sign c^2) = constant`` that grows from 0 with it; NaN past its fold."""
    c = np.zeros(np.broadcast_shapes(stiffness.shape, constant.shape))
    for _ in range(MAX_STEPS):
        step = (c * (stiffness + sign * c * c) - constant) / (stiffness + 3 * sign * c * c)
        c = c - step
        if np.all(np.abs(step) <= 1e-9 * np.abs(c)):
            break
    held = (np.abs(step) <= 1e-6 * np.abs(c)) & (stiffness + 3 * sign * c * c > 0)
    return np.where(held, c, np.nan)
