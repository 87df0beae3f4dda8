"""Steady motions of many slightly different rings at once, in one harmonic."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .batch_march import BatchMotion, BatchParts

__all__ = ["march_ring"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

# From the ring all are drawn around to each of them in so many steps, with so many of Newton's at each.
STEPS, NEWTON = 8, 6
# A motion is found when its forces balance to this share of the largest.
MET = 1e-8


def march_ring(
    parts: BatchParts, centre: BatchParts, force: Complexes, lam: Floats, omega: Floats, near: Complexes
) -> BatchMotion:
    """The motion of every ring of a batch on the branch of the one they are drawn around.

    ``(k_m + lam_m - omega^2 + (3/4) beta_m |A_m|^2 + i delta_m omega) A_m = f_m + lam_m A_{m-1}``, the first after the
    last: theory.md section 2.1. Where the branch ends on the way to a ring, so does its motion: it counts as escaped,
    with nothing felt. Whether a motion is stable is not asked.

    Parameters
    ----------
    parts : the rings;
    centre : those they are drawn around, which broadcast against them.
    force, lam, omega : as in `march`; the first lam closes the ring.
    near : complex128, shape (n, ...), the motion of `centre` under them. `BatchMotion.tangent` of the answer is NaN.
    """
    size = np.broadcast_shapes(parts.stiffness.shape, force.shape, np.shape(omega))
    phasor = np.array(np.broadcast_to(near, size), dtype=np.complex128)
    scale = np.abs(force).max(axis=0) + 1e-300
    for step in range(1, STEPS + 1):
        share = step / STEPS
        here = BatchParts(*((1 - share) * getattr(centre, name) + share * getattr(parts, name) for name in _NAMES))
        for _ in range(NEWTON):
            left, solved = _newton(here, force, lam, omega, phasor)
            with np.errstate(invalid="ignore", over="ignore"):
                phasor = phasor + solved
    left, _ = _newton(parts, force, lam, omega, phasor)
    links = lam * parts.lam_gain
    with np.errstate(invalid="ignore", over="ignore"):
        lost = ~(np.abs(left).max(axis=0) <= MET * scale)
        lost |= np.any((parts.beta < 0) & (np.abs(phasor) ** 2 * -parts.beta >= parts.stiffness + links), axis=0)
    phasor = np.where(lost, 0.0, phasor)
    phasor.flags.writeable = False
    unknown = np.full(size, np.nan + 0j)
    return BatchMotion(phasor, lost, np.broadcast_to(links, size), unknown, unknown)


_NAMES = ("stiffness", "delta", "beta", "lam_gain")


def _newton(
    parts: BatchParts, force: Complexes, lam: Floats, omega: Floats, phasor: Complexes
) -> tuple[Complexes, Complexes]:
    """What is left of the forces, and the step that removes it to first order, both of the shape of `phasor`.

    Each stage asks ``p x_m + q conj(x_m) = r_m + lam_m x_{m-1}``; all of them in turn make the first unknown
    ``a x + b conj(x) + c`` of itself.
    """
    links = lam * parts.lam_gain
    with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
        linear = parts.stiffness + links - np.square(omega) + 1j * parts.delta * omega
        square, cubic = np.abs(phasor) ** 2, 0.75 * parts.beta
        left = force + links * np.roll(phasor, 1, axis=0) - (linear + cubic * square) * phasor
        p, q = linear + 2 * cubic * square, cubic * phasor**2
        size = np.abs(p) ** 2 - np.abs(q) ** 2

        def answer(m: int, push: Complexes) -> Complexes:
            return np.asarray((np.conj(p[m]) * push - q[m] * np.conj(push)) / size[m])

        # What the last oscillator is, in terms of itself: the images of 0, 1 and i under all stages.
        ends = []
        for last in (0.0, 1.0, 1j):
            x: Complexes = np.full(phasor.shape[1:], last, dtype=np.complex128)
            for m in range(len(phasor)):
                x = answer(m, left[m] + links[m] * x)
            ends.append(x)
        c, by_one, by_i = ends[0], ends[1] - ends[0], ends[2] - ends[0]
        a, b = (by_one - 1j * by_i) / 2, (by_one + 1j * by_i) / 2
        x = (np.conj(1 - a) * c + b * np.conj(c)) / (np.abs(1 - a) ** 2 - np.abs(b) ** 2)
        step = np.empty_like(phasor)
        for m in range(len(phasor)):
            step[m] = x = answer(m, left[m] + links[m] * x)
    return left, step
