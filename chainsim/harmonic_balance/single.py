"""One setting of an open chain alone, up to harmonics 1 and 3: complex numbers in place of arrays of length one.

With ``z = Re(A e^{i theta} + B e^{3 i theta})`` the harmonics of z^3 are ``3/4 |A|^2 A + 3/4 A*^2 B + 3/2 |B|^2 A`` and
``1/4 A^3 + 3/2 |A|^2 B + 3/4 |B|^2 B``: the same equations as those of the basis of order 3, at a tenth of the time.
"""

from __future__ import annotations

import cmath
import math

import numpy as np
from numpy.typing import NDArray

from ..equations.scaled_chain import ScaledChain
from .starts import newton_of_one

__all__ = ["first_alone", "linear_alone", "march_alone", "still_alone"]

MAX_STEPS = 25
SMALL_STEP = 1e-10


def march_alone(scaled: ScaledChain) -> tuple[NDArray[np.float64], int] | None:
    """Lower branch of the one setting: x (n, 4, 1) and the Newton steps; None where it does not converge."""
    omega = float(scaled.omega[0])
    deltas, signs = scaled.of_each(scaled.delta).tolist(), scaled.of_each(scaled.sign).tolist()
    first, third = complex(scaled.drive[0]), 0j
    x, steps = np.empty((scaled.n, 4, 1)), 0
    for m, (k, lam) in enumerate(zip(scaled.k[:, 0].tolist(), scaled.lam[:, 0].tolist(), strict=True)):
        if m:
            first, third = lam * first, lam * third
        near = complex(k - omega * omega, deltas[m] * omega)
        far = complex(k - 9 * omega * omega, 3 * deltas[m] * omega)
        try:
            first, third, done = _oscillator(near, far, signs[m], first, third)
        except (OverflowError, ZeroDivisionError):
            return None
        if not done:
            return None
        steps += done
        x[m, :, 0] = first.real, first.imag, third.real, third.imag
    return x, steps


def first_alone(scaled: ScaledChain) -> tuple[NDArray[np.float64], int] | None:
    """The same with the first harmonic alone: x (n, 2, 1)."""
    omega = float(scaled.omega[0])
    deltas, signs = scaled.of_each(scaled.delta).tolist(), scaled.of_each(scaled.sign).tolist()
    first, x = complex(scaled.drive[0]), np.empty((scaled.n, 2, 1))
    for m, (k, lam) in enumerate(zip(scaled.k[:, 0].tolist(), scaled.lam[:, 0].tolist(), strict=True)):
        near = complex(k - omega * omega, deltas[m] * omega)
        try:
            first = _first(near, signs[m], lam * first if m else first)
        except (OverflowError, ZeroDivisionError):
            return None
        x[m, :, 0] = first.real, first.imag
    return (x, scaled.n) if np.isfinite(x).all() else None


def linear_alone(scaled: ScaledChain, mean: bool) -> NDArray[np.float64]:
    """First harmonic, and the mean last where there is one, without the cubic term: x (n, 2 or 3, 1)."""
    omega = float(scaled.omega[0])
    near = (scaled.k[:, 0] - omega * omega + 1j * scaled.of_each(scaled.delta) * omega).tolist()
    first, still, x = complex(scaled.drive[0]), 0.0, np.empty((scaled.n, 2 + mean, 1))
    each = zip(near, scaled.k[:, 0].tolist(), scaled.lam[:, 0].tolist(), scaled.force[:, 0].tolist(), strict=True)
    for m, (impedance, k, lam, force) in enumerate(each):
        push, still = lam * first if m else first, force + lam * still
        first = push / impedance if impedance else complex(math.nan, math.nan)
        still = still / k if k else math.nan
        x[m, :2, 0] = first.real, first.imag
        if mean:
            x[m, 2, 0] = still
    return x


def still_alone(scaled: ScaledChain) -> tuple[NDArray[np.float64], int] | None:
    """Equilibria that grow from rest with their force: x (n, 1, 1); None past a fold."""
    signs, still, x, steps = scaled.of_each(scaled.sign).tolist(), 0.0, np.zeros((scaled.n, 1, 1)), 0
    each = zip(scaled.k[:, 0].tolist(), scaled.lam[:, 0].tolist(), scaled.force[:, 0].tolist(), signs, strict=True)
    for m, (k, lam, force, sign) in enumerate(each):
        push, still = force + lam * still, 0.0
        for _ in range(MAX_STEPS):
            slope = k + 3 * sign * still * still
            if not slope > 0:
                return None
            move = (push - still * (k + sign * still * still)) / slope
            still, steps = still + move, steps + 1
            if abs(move) <= SMALL_STEP * abs(still):
                break
        else:
            return None
        x[m] = still
    return x, steps


def _first(near: complex, sign: float, first: complex) -> complex:
    """First harmonic on the lower branch under a force `first`."""
    v = _lowest_root(near.real, near.imag, math.copysign(1.0, sign), 0.75 * abs(sign) * abs(first) ** 2)
    return first / complex(near.real + math.copysign(v, sign), near.imag)


def _oscillator(
    near: complex, far: complex, sign: float, first: complex, third: complex
) -> tuple[complex, complex, int]:
    """Both harmonics and the Newton steps (0: not converged) of an oscillator with impedances `near` and `far`."""
    a = _first(near, sign, first)
    b = (third - 0.25 * sign * a**3) / far
    for step in range(1, MAX_STEPS):
        aa, bb, turned = abs(a) ** 2, abs(b) ** 2, a.conjugate()
        b = (third - 0.25 * sign * a**3) / (far + sign * (1.5 * aa + 0.75 * bb))
        left = (near + sign * (0.75 * aa + 1.5 * bb)) * a + 0.75 * sign * turned**2 * b - first
        p, q = near + 1.5 * sign * (aa + bb), sign * (0.75 * a * a + 1.5 * turned * b)
        move = (p.conjugate() * left - q * left.conjugate()) / (abs(p) ** 2 - abs(q) ** 2)
        a -= move
        if abs(move) <= SMALL_STEP * abs(a):
            return a, b, step
        if not cmath.isfinite(a):
            break
    return a, b, 0


def _lowest_root(kappa: float, g: float, sign: float, c: float) -> float:
    """`Cubic.lowest` of one setting."""
    bend, gg = -sign * kappa, g * g
    spread = kappa * kappa - 3 * gg
    turn = 2 * max(bend, 0.0) / 3
    if bend > 0 and spread > 0:
        turn = (kappa * kappa + gg) / (2 * bend + math.sqrt(spread))
    at_turn = turn * ((kappa + sign * turn) ** 2 + gg)
    cube, linear = math.cbrt(c), kappa * kappa + gg
    v = 0.0
    if not (bend > 0 and c <= at_turn):
        v = abs(kappa) + cube if bend > 0 else min(cube, c / linear if linear > 0 else math.inf)
    return newton_of_one(kappa, gg, c, sign, v)
