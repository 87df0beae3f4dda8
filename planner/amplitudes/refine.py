"""From the closed form to harmonic balance: Gauss-Newton on drive and links with the exact gradient."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from chainsim import Chain, Outcome, Setting, gradient, solve

from ..closed_forms.links import links_for, stages

__all__ = ["Refined", "refine"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

# Relative to the profile's largest amplitude: far below what is asked of a plan, well above round-off.
GOAL = 1e-9
STEPS = 6
# Sweeps along the chain that the closed form takes to know the third harmonic's part: each is a thousand times better.
SWEEPS = 2
# The largest share of a setting by which one step may change it: farther away the gradient says nothing.
LONGEST_STEP = 0.5


@dataclass(frozen=True)
class Refined:
    """Settings that hold P amplitude profiles, and what they give.

    Attributes
    ----------
    epsilon : complex128, shape (P,), drive phasors that make the last actuator's phasor real and positive.
    lam : float64, shape (P, n-1).
    phasor : complex128, shape (P, n), from harmonic balance.
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
    epsilon, lam = _with_third(chain, amplitude, omega)
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


def _with_third(chain: Chain, amplitude: Floats, omega: float) -> tuple[Floats, Floats]:
    """Drives and links in closed form, the third harmonic C with them.

    ``(kappa_m + lam_m + 3 i delta omega - 8 omega^2 + (3/4) beta a_m^2) C_m = lam_m C_{m-1} - (beta/4) A_m^3``, and
    back on the first harmonic: ``kappa_m + (3/4) beta (conj(A_m)^2 C_m/A_m + 2 |C_m|^2)`` in place of kappa_m.
    """
    links = links_for(chain, amplitude, omega)
    stage = [_own(chain, m, amplitude[:, m], omega) for m in range(chain.n)]
    for _ in range(SWEEPS):
        before: Complexes = np.zeros(len(amplitude), dtype=np.complex128)
        third, phasor, found = before, before, []
        for m in range(chain.n):
            a, beta = amplitude[:, m], 0.75 * stages(chain, m).beta
            lam = links[:, m - 1] if m else np.zeros(len(a))
            phasor = np.asarray(a * np.exp(1j * np.angle(phasor / (stage[m] + lam))) if m else a + 0j)
            stiff = stage[m].real + 3j * stage[m].imag - 8 * omega**2 + beta * a**2 + lam
            third = (lam * third - beta / 3 * phasor**3) / stiff
            back = np.conj(phasor) ** 2 * third / phasor + 2 * np.abs(third) ** 2
            stage[m] = _own(chain, m, a, omega) + beta * back
            if m:
                found.append(_link(stage[m], amplitude[:, m - 1] / a, lam))
        links = np.array(found).T.reshape(links.shape)
    return amplitude[:, 0] * np.abs(stage[0]), links


def _own(chain: Chain, m: int, amplitude: Floats, omega: float) -> Complexes:
    """kappa_m + i delta omega of one harmonic."""
    own = stages(chain, m)
    return np.asarray(own.stiffness - omega**2 + 0.75 * own.beta * amplitude**2 + 1j * own.delta * omega)


def _link(stage: Complexes, ratio: Floats, otherwise: Floats) -> Floats:
    """The link under which ``|1 + stage/lam|`` is `ratio`: of two the smaller, as `links_for` has it."""
    size = np.abs(stage) ** 2
    soft = np.sqrt(np.maximum(stage.real**2 + size * (ratio**2 - 1), 0.0)) - stage.real
    return np.where(soft > 0, size / np.where(soft > 0, soft, 1.0), otherwise)


def _step(jacobian: Floats, deviation: Floats, present: Floats) -> Floats:
    """Newton steps, shape (P, n), shortened to `LONGEST_STEP`; zero for a profile that has no answer here."""
    known = np.asarray(np.isfinite(jacobian).all(axis=(1, 2)) & np.isfinite(deviation).all(axis=1))
    solvable = np.where(known[:, None, None], jacobian, np.eye(present.shape[1]))
    step = np.linalg.solve(solvable, np.where(known[:, None], deviation, 0.0)[:, :, None])[:, :, 0]
    longest = np.max(np.abs(step / present), axis=1)
    return np.asarray(step * np.minimum(1.0, LONGEST_STEP / np.maximum(longest, LONGEST_STEP))[:, None])
