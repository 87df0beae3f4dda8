"""Steady motions of many slightly different open chains at once, in one harmonic, and their derivatives."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["BatchMotion", "BatchParts", "march"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

# The share of the cubic's slope at which Newton's correction of a closed-form root would leave its branch (a fold).
FLAT = 1e-6


@dataclass(frozen=True)
class BatchParts:
    """What the oscillators of a batch of chains are made of, dimensionless.

    Attributes
    ----------
    stiffness : float64, shape (n, ...), natural frequency squared over that of the time unit f0, > 0.
    delta : float64, shape (n, ...), damping, >= 0.
    beta : float64, shape (n, ...), cubic term.
    lam_gain : float64, shape (n, ...), what a link makes of the lam it is set to; the first is not used.
    """

    stiffness: Floats
    delta: Floats
    beta: Floats
    lam_gain: Floats


@dataclass(frozen=True)
class BatchMotion:
    """What a batch of chains does.

    Attributes
    ----------
    phasor : complex128, shape (n, ...), first harmonic, dimensionless; at omega 0 the static deflection.
    escaped : bool, shape (...), some actuator is at or beyond its hilltop ``sqrt((stiffness + lam)/-beta)``. The
        amplitudes beyond it are those of the equations of one harmonic, and mean no more than "very large".
    """

    phasor: Complexes
    escaped: NDArray[np.bool_]
    _lam: Floats
    _direct: Complexes
    _mirror: Complexes

    def tangent(self, own: Complexes) -> Complexes:
        """Derivatives of `phasor` along any directions, by the implicit function theorem, oscillator by oscillator.

        Parameters
        ----------
        own : complex128, shape (n, D, ...), for each direction the derivative of every oscillator's force minus
            impedance times phasor, at fixed phasors: for the drive 1 in the first, for lam_m
            ``phasor_{m-1} - phasor_m`` in m, for the stiffness of m ``-phasor_m`` in m, and so on.

        Returns
        -------
        complex128, shape (n, D, ...).
        """
        out = np.empty(own.shape, dtype=np.complex128)
        before: Complexes = np.zeros(own.shape[1:], dtype=np.complex128)
        for m, (p, q) in enumerate(zip(self._direct, self._mirror, strict=True)):
            right = own[m] + self._lam[m] * before
            before = (np.conj(p) * right - q * np.conj(right)) / (np.abs(p) ** 2 - np.abs(q) ** 2)
            out[m] = before
        return out


def march(
    parts: BatchParts, force: Complexes, lam: Floats, omega: Floats | float, near: Complexes | None = None
) -> BatchMotion:
    """The motion of every chain of a batch.

    ``(k_m + lam_m - omega^2 + (3/4) beta_m |A_m|^2 + i delta_m omega) A_m = f_m + lam_m A_{m-1}``, or for omega = 0
    ``(k_m + lam_m + beta_m A_m^2) A_m = f_m + lam_m A_{m-1}``: theory.md section 2.1. What is left out changes a
    first harmonic by about (beta a^2)^2/40 over its distance to resonance; a static deflection is exact.

    Of several answers it takes the smallest, which a slow rise from rest reaches.

    Parameters
    ----------
    force : complex128, shape (n, ...), on every oscillator: the drive on the first, or the biases.
    lam : float64, shape (n, ...), what links are set to; the first is 0.
    omega : float64, shape (...), drive frequency over f0; a number > 0, or 0 for the static deflection.
    near : complex128, shape (n, ...), of several answers take the stable one nearest to it; NaN: the smallest.
    """
    still = not np.any(omega)
    cubic = parts.beta * (1.0 if still else 0.75)
    links = lam * parts.lam_gain
    stiff = parts.stiffness + links
    size = np.broadcast_shapes(stiff.shape, force.shape, cubic.shape, parts.delta.shape, np.shape(omega))
    phasor, direct, mirror = (np.empty(size, dtype=np.complex128) for _ in range(3))
    before: Complexes | float = 0.0
    for m in range(size[0]):
        push = force[m] + links[m] * before
        linear = stiff[m] - np.square(omega) + 1j * parts.delta[m] * omega
        square = _amplitude2(linear, cubic[m], np.abs(push), None if near is None else (push, near[m]))
        phasor[m] = before = push / (linear + cubic[m] * square)
        direct[m] = linear + 2 * cubic[m] * square
        mirror[m] = cubic[m] * phasor[m] ** 2
    phasor.flags.writeable = False
    escaped = np.any((parts.beta < 0) & (np.abs(phasor) ** 2 * -parts.beta >= stiff), axis=0)
    return BatchMotion(phasor, escaped, np.broadcast_to(links, (size[0], *links.shape[1:])), direct, mirror)


def _amplitude2(linear: Complexes, cubic: Floats, push: Floats, near: tuple[Complexes, Complexes] | None) -> Floats:
    """|A|^2 from ``|linear + cubic |A|^2|^2 |A|^2 = push^2``.

    In s, with |A|^2 = (push/|linear|)^2/s, it is ``s^3 - s^2 - p s - q = 0``: well scaled for every cubic term, also
    none (s = 1). The largest root is the smallest amplitude.
    """
    modulus2 = np.abs(linear) ** 2
    reach = cubic * push**2 / modulus2**2
    p, q = 2 * reach * linear.real, reach**2 * modulus2
    third, half = (1 / 3 + p) / 3, 1 / 27 + p / 6 + q / 2
    several = half**2 <= third**3
    root = np.sqrt(np.maximum(third, 0.0))
    with np.errstate(divide="ignore", invalid="ignore"):
        angle = np.arccos(np.clip(half / root**3, -1.0, 1.0)) / 3
        single = np.cbrt(half + np.copysign(np.sqrt(np.maximum(half**2 - third**3, 0.0)), half))
        s = 1 / 3 + np.where(several, 2 * root * np.cos(angle), single + third / single)
        s = _polished(s, p, q)
        if near is not None:
            # The smallest root is the largest amplitude, also stable, if all three are > 0: of what is left of the
            # cubic without the largest, s^2 + b s + c, with no difference of nearly equal numbers.
            b, c = (p + q / s) / s, q / s
            inside = b**2 - 4 * c
            high = 2 * c / (np.sqrt(np.maximum(inside, 0.0)) - b)
            there = (inside >= 0) & (b < 0) & (c > 0)
            s = np.where(there & _closer(linear, cubic, push**2 / modulus2, high, s, near), high, s)
    return np.asarray(push**2 / modulus2 / s)


def _polished(s: Floats, p: Floats, q: Floats) -> Floats:
    """`s` after one step of Newton's method, except beside a double root."""
    slope = 3 * s**2 - 2 * s - p
    return np.asarray(s - np.where(np.abs(slope) > FLAT, (((s - 1) * s - p) * s - q) / slope, 0.0))


def _closer(
    linear: Complexes, cubic: Floats, reach2: Floats, high: Floats, low: Floats, near: tuple[Complexes, Complexes]
) -> NDArray[np.bool_]:
    """Whether the answer `high` is closer to what was seen than `low`; False where nothing was."""
    push, seen = near
    far = [np.abs(push / (linear + cubic * reach2 / s) - seen) for s in (high, low)]
    return np.asarray(far[0] < far[1])
