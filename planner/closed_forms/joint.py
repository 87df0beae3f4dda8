"""Small deviations of chains whose oscillators act on each other, in one harmonic: all at once, for many settings."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from chainsim import Chain

from .links import stage_constant, stages

__all__ = ["driven", "growth", "sensitivity"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]


def driven(chain: Chain, lam: Floats, omega: Floats) -> Complexes:
    """Small motions under a unit force on the first oscillator.

    Parameters
    ----------
    lam : float64, shape (n,), the first closes a ring and is 0 otherwise.
    omega : float64, shape (W,), frequencies over f0.

    Returns
    -------
    complex128, shape (W, n).
    """
    n, own = chain.n, stages(chain)
    stage = own.stiffness - omega[:, None] ** 2 + 1j * own.delta * omega[:, None]
    system = chain.law.matrix(lam[None, :], None) + np.broadcast_to(stage, (len(omega), n))[:, :, None] * np.eye(n)
    return np.asarray(np.linalg.solve(system, np.eye(n)[:, :1])[:, :, 0])


def growth(chain: Chain, lam: Floats, phasor: Complexes, omega: float) -> Floats:
    """How fast the worst small deviation from each motion grows, per unit of tau; below 0 where the motion is stable.

    Parameters
    ----------
    lam : float64, shape (C, n), as in `driven`.
    phasor : complex128, shape (C, n).

    Returns
    -------
    float64, shape (C,).
    """
    here, turned = _parts(chain, lam, phasor, omega)
    damping = -1 / (2j * omega + stages(chain).delta) * np.ones(chain.n)
    flow = _real(damping[:, None] * here, damping[:, None] * turned)
    return np.asarray(np.linalg.eigvals(flow).real.max(axis=1))


def sensitivity(chain: Chain, lam: Floats, phasor: Complexes, omega: float) -> Floats:
    """Standard deviation of the worst oscillator's amplitude where stiffnesses differ with one of 1, each apart.

    Parameters, returns: as `growth`; dimensionless, infinite at a fold.
    """
    n, system = chain.n, _real(*_parts(chain, lam, phasor, omega))
    singular = np.abs(np.linalg.det(system)) == 0
    inverse = np.linalg.inv(np.where(singular[:, None, None], np.eye(2 * n), system))
    change = inverse[:, :, :n] * phasor.real[:, None, :] + inverse[:, :, n:] * phasor.imag[:, None, :]
    found = np.sqrt((change[:, :n] ** 2 + change[:, n:] ** 2).sum(axis=2)).max(axis=1)
    return np.where(singular, np.inf, found)


def _parts(chain: Chain, lam: Floats, phasor: Complexes, omega: float) -> tuple[Complexes, Complexes]:
    """What a deviation d asks for in force, as ``here d + turned conj(d)``; complex128, shape (C, n, n) each."""
    own, one = stages(chain), np.eye(chain.n)
    bend = 0.75 * own.beta * phasor**2
    stage = stage_constant(chain, np.abs(phasor), omega) + np.abs(bend) * np.sign(own.beta) + 1j * own.delta * omega
    return chain.law.matrix(lam, None) + stage[:, :, None] * one, bend[:, :, None] * one


def _real(here: Complexes, turned: Complexes) -> Floats:
    """The same for real and imaginary parts."""
    above = np.concatenate([here.real + turned.real, turned.imag - here.imag], axis=2)
    below = np.concatenate([here.imag + turned.imag, here.real - turned.real], axis=2)
    return np.concatenate([above, below], axis=1)
