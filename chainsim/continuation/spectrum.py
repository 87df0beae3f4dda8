"""The chain at rest: eigenvalues, the coupling at which a ring starts by itself, and the gain of one stage.

The linearised ring of n equal oscillators has waves z_m ~ e^{mu tau - i m phi}, phi = 2 pi k/n, with

    mu^2 + delta mu + 1 + lam = lam e^{i phi}.

One grows when lam^2 sin^2 phi > delta^2 (1 + lam (1 - cos phi)). As n grows the phases fill the circle and the
eigenvalues a curve, the asymptotic continuous spectrum (Yanchuk and Wolfrum, SIAM J. Appl. Dyn. Syst. 9, 2010). See
theory.md section 3.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..equations.chain import Chain, Setting
from ..equations.scaled_chain import ScaledChain
from ..errors import ChainError
from ..floquet.monodromy import rest_matrix

__all__ = [
    "SpectrumError",
    "critical_lam",
    "delta_from_critical_lam",
    "gain_per_stage",
    "peak_gain",
    "rest_eigenvalues",
    "spectrum_curve",
]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]


class SpectrumError(ChainError, ValueError):
    """The spectrum was asked for a system that has none of this form.

    Examples: a damping below 0; a ring of no oscillator; the damping behind a critical coupling of a ring of two.
    """


def rest_eigenvalues(chain: Chain, setting: Setting) -> Complexes:
    """Eigenvalues mu of the chain linearised at z = 0 (drive and bias play no part).

    Returns
    -------
    complex128, shape (N, 2n), per unit of tau, sorted by real part, the largest first.
    """
    scaled = replace(ScaledChain.of(chain, setting), omega=np.ones(len(setting)))
    if scaled.law.feed_forward:
        # Triangular: the roots of each oscillator alone, without the rounding of a defective matrix.
        root = np.sqrt(0.25 * scaled.delta**2 - scaled.k + 0j)
        found = np.concatenate([-0.5 * scaled.delta + root, -0.5 * scaled.delta - root]).T
    else:
        found = np.linalg.eigvals(rest_matrix(scaled)).astype(np.complex128)
    order = np.argsort(-found.real, axis=1, kind="stable")
    return np.take_along_axis(found, order, axis=1)


def spectrum_curve(delta: float, lam: ArrayLike, phi: ArrayLike) -> Complexes:
    """Both eigenvalues of the wave with phase lag `phi` per oscillator in a ring.

    Parameters
    ----------
    lam : float64, any shape.
    phi : float64, radians, broadcast against `lam`.

    Returns
    -------
    complex128, shape (..., 2), per unit of tau; the one with positive imaginary part first.
    """
    _check_delta(delta)
    coupling, lag = np.broadcast_arrays(np.asarray(lam, dtype=np.float64), np.asarray(phi, dtype=np.float64))
    root = np.sqrt(0.25 * delta**2 - 1 - coupling * (1 - np.exp(1j * lag)))
    root = np.where(root.imag < 0, -root, root)
    both: Complexes = np.stack([-0.5 * delta + root, -0.5 * delta - root], axis=-1)
    return both


def critical_lam(delta: float, n: int | None = None) -> float:
    """The smallest lam >= 0 at which a ring of `n` oscillates by itself; None for the continuous spectrum.

    The threshold of mode phi is the positive root of ``sin^2 phi lam^2 - delta^2 (1 - cos phi) lam - delta^2 = 0``. Its
    smallest value over all phi is ``delta + delta^2/2``, at ``cos phi = delta^2/(2 lam)``. Infinite for n = 1 and 2,
    whose modes have no sine.

    Raises
    ------
    SpectrumError
        When `delta` is below 0 or not finite, or `n` below 1.
    """
    _check_delta(delta)
    if n is None:
        return delta + 0.5 * delta**2
    if n < 1:
        raise SpectrumError(f"n: expected a ring of 1 or more oscillators, got {n}")
    return min((_threshold(delta, 2 * math.pi * k / n) for k in range(1, (n + 1) // 2)), default=math.inf)


def delta_from_critical_lam(lam: float, n: int) -> float:
    """The damping of the ring of `n` that loses its rest at `lam`: the inverse of `critical_lam` for n >= 3.

    Raises
    ------
    SpectrumError
        When `lam` is not a finite number > 0, or `n` below 3.
    """
    if not (math.isfinite(lam) and lam > 0):
        raise SpectrumError(f"lam: expected a finite number > 0, got {lam}")
    if n < 3:
        raise SpectrumError(f"n: a ring of {n} never loses its rest; expected 3 or more")
    phis = [2 * math.pi * k / n for k in range(1, (n + 1) // 2)]
    return max(lam * math.sin(phi) / math.sqrt(1 + lam * (1 - math.cos(phi))) for phi in phis)


def gain_per_stage(delta: float, lam: ArrayLike, omega: ArrayLike) -> Floats:
    """Amplitude of an undriven oscillator over that of the one that feeds it, ``|lam/(1 + lam - omega^2 + i delta
    omega)|``, at small amplitude; float64, broadcast from `lam` and `omega`.
    """
    _check_delta(delta)
    coupling, w = np.asarray(lam, dtype=np.float64), np.asarray(omega, dtype=np.float64)
    return np.abs(coupling / (1 + coupling - w * w + 1j * delta * w))


def peak_gain(delta: float, lam: ArrayLike) -> Floats:
    """The largest gain of a stage over all frequencies; float64, shape of `lam`.

    It is above 1 exactly beyond the critical lam of the continuous spectrum: what grows in time on a ring grows along
    an open chain.
    """
    _check_delta(delta)
    coupling = np.asarray(lam, dtype=np.float64)
    # |impedance|^2 = (k - w2)^2 + delta^2 w2 is least at w2 = k - delta^2/2.
    best = np.maximum(1 + coupling - 0.5 * delta**2, 0.0)
    return gain_per_stage(delta, coupling, np.sqrt(best))


def _threshold(delta: float, phi: float) -> float:
    square, bend = math.sin(phi) ** 2, delta**2 * (1 - math.cos(phi))
    return (bend + math.sqrt(bend**2 + 4 * delta**2 * square)) / (2 * square)


def _check_delta(delta: float) -> None:
    if not (math.isfinite(delta) and delta >= 0):
        raise SpectrumError(f"delta: expected a finite number >= 0, got {delta}")
