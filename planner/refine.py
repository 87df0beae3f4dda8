"""From the closed form to harmonic balance: Gauss-Newton on drive and links with the exact gradient."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from chainsim import Chain, Outcome, Setting, gradient, solve

from .links import drive_for, links_for

__all__ = ["Refined", "refine"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

# Relative to the profile's largest amplitude: far below what is asked of a plan, well above round-off.
GOAL = 1e-9
STEPS = 6
# The largest share of a setting by which one step may change it: farther away the gradient says nothing.
LONGEST_STEP = 0.5


@dataclass(frozen=True)
class Refined:
    """Settings that hold P amplitude profiles, and what they give.

    Attributes
    ----------
    epsilon : complex128, shape (P,), drive phasors that make the last actuator's phasor real and positive.
    lam : float64, shape (P, n-1). phasor : complex128, shape (P, n), from harmonic balance.
    error : float64, shape (P,), worst deviation of an amplitude plus the solver's own error estimate.
    outcome : object, shape (P,).
    """

    epsilon: Complexes
    lam: Floats
    phasor: Complexes
    error: Floats
    outcome: NDArray[np.object_]


def refine(chain: Chain, amplitude: Floats, omega: float) -> Refined:
    """Settings whose harmonic-balance response has the wanted moduli.

    Parameters
    ----------
    amplitude : float64, shape (P, n), dimensionless, > 0, for which `links_for` has an answer.
    """
    epsilon: Floats = drive_for(chain, amplitude[:, 0], omega)
    lam = links_for(chain, amplitude, omega)
    scale = amplitude.max(axis=1)
    for _ in range(STEPS):
        setting = Setting.of(chain, epsilon=epsilon, lam=lam, omega=omega)
        response = solve(chain, setting, tol=GOAL / 10, rung="harmonic_balance", start="rest")
        modulus = np.abs(response.phasor)
        deviation = modulus - amplitude
        if not np.any(np.abs(deviation) > GOAL * scale[:, None]):
            break
        slope = gradient(chain, setting, response)
        towards = (np.conj(response.phasor) / modulus)[:, :, None]
        jacobian = np.real(towards * np.concatenate([slope.epsilon[:, :, None], slope.lam], axis=2))
        present = np.concatenate([epsilon[:, None], lam], axis=1)
        moved = present - _step(jacobian, deviation, present)
        epsilon, lam = moved[:, 0], moved[:, 1:]
    worst = np.abs(deviation).max(axis=1) + response.error_estimate * scale
    turn = np.exp(-1j * np.angle(response.phasor[:, -1]))
    outcome = response.outcome.copy()
    outcome[(outcome == Outcome.OK) & ~(worst <= 100 * GOAL * scale)] = Outcome.NO_CONVERGENCE
    return Refined((epsilon * turn).astype(np.complex128), lam, response.phasor * turn[:, None], worst, outcome)


def _step(jacobian: Floats, deviation: Floats, present: Floats) -> Floats:
    """Newton steps, shape (P, n), shortened to `LONGEST_STEP`; zero for a profile that has no answer here."""
    known = np.asarray(np.isfinite(jacobian).all(axis=(1, 2)) & np.isfinite(deviation).all(axis=1))
    solvable = np.where(known[:, None, None], jacobian, np.eye(present.shape[1]))
    step = np.linalg.solve(solvable, np.where(known[:, None], deviation, 0.0)[:, :, None])[:, :, 0]
    longest = np.max(np.abs(step / present), axis=1)
    return np.asarray(step * np.minimum(1.0, LONGEST_STEP / np.maximum(longest, LONGEST_STEP))[:, None])
