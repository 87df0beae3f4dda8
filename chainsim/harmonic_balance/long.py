"""One setting of an open chain so long that a NumPy call for each oscillator is too dear: plain numbers, or blocks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..equations.basis import Basis, basis_for
from ..equations.scaled_chain import ScaledChain
from .joint import band_step
from .march import March, branches_of
from .single import first_alone, march_alone, still_alone

__all__ = ["LONG", "correct_long", "is_long", "low_alone", "march_long"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

LONG = 2000
"""Oscillators from which a chain counts as long."""

# Oscillators of one banded system.
BLOCK = 10_000
# Of the hilltop, and of the amplitude of a fold, for a transient's peak; as for shorter chains in `rest`.
WELL = FOLD = 0.6


def is_long(scaled: ScaledChain) -> bool:
    """Whether it is one setting of a chain longer than 2000 whose oscillators can be solved in turn."""
    return scaled.n > LONG and len(scaled) == 1 and scaled.law.in_line


def march_long(scaled: ScaledChain, basis: Basis) -> March | None:
    """The lower branch without constant forces, or equilibria; None for another basis or where it does not converge."""
    if scaled.linear:
        return None
    ways = {basis_for(0, True): still_alone, basis_for(1, False): first_alone, basis_for(3, False): march_alone}
    found = ways[basis](scaled) if basis in ways else None
    if found is None:
        return None
    x, steps = found
    return March(basis, x, np.ones(1, dtype=bool), branches_of(scaled, basis, x), steps)


def correct_long(scaled: ScaledChain, basis: Basis, x: Floats, old: Basis) -> Floats:
    """`march.correct`: one Newton step of the whole chain in `basis` from x (n, d, 1) in `old`."""
    moved = np.empty((scaled.n, basis.size, 1))
    for first in range(0, scaled.n, BLOCK):
        rows = slice(first, first + BLOCK)
        delta, sign = (each if len(each) == 1 else each[rows] for each in (scaled.delta, scaled.sign))
        part = replace(
            scaled, delta=delta, sign=sign, k=scaled.k[rows], lam=scaled.lam[rows], force=scaled.force[rows],
            drive=np.zeros(1, dtype=np.complex128) if first else scaled.drive,
        )  # fmt: skip
        before = scaled.lam[first] * moved[first - 1] if first else None
        moved[rows] = band_step(part, basis, x[rows], old, before)
    return moved


def low_alone(scaled: ScaledChain, phasor: Complexes) -> bool:
    """Whether a sudden drive from rest surely leads to the lower answer, whose scaled first harmonics (n,) are given.

    The transient is bounded as if linear, by the integral of |z| after an impulse, oscillator by oscillator. Its peak
    is to stay well inside the softening well, and so low that not even the sharpest fold is near.
    """
    own, omega = scaled.k[:, 0] - 0.25 * scaled.of_each(scaled.delta) ** 2, float(scaled.omega[0])
    delta, sign = scaled.of_each(scaled.delta), scaled.of_each(scaled.sign)
    nu = np.sqrt(np.abs(own))
    swing = np.where(own > 0, 1 / np.tanh(np.pi * delta / (4 * nu)), 1.0) / scaled.k[:, 0]
    gain, peak = (swing * np.abs(scaled.lam[:, 0])).tolist(), np.empty(scaled.n)
    high = float(np.abs(phasor[0]) * (1 + max(1.0, omega / nu[0])))
    for m, each in enumerate(gain):
        high = high * each if m else high
        peak[m] = high
    top = np.where(sign < 0, WELL * np.sqrt(scaled.k[:, 0] / np.maximum(-sign, 1e-300)), np.inf)
    # A fold needs a bend of sqrt(3) delta omega, and lies at a third of it.
    sharpest = delta * omega / np.sqrt(3)
    return bool((peak < top).all() and (0.75 * np.abs(sign) * peak**2 < FOLD**2 * sharpest).all())
