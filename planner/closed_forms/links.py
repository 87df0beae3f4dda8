"""Closed forms of an open chain with a lam on every link: the settings that hold an amplitude profile."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from chainsim import Chain

__all__ = ["Stage", "detuning_gain", "drive_for", "links_for", "stage_constant", "stages"]

Floats = NDArray[np.float64]


class Stage(NamedTuple):
    """Natural frequency squared, damping and cubic term of oscillators: a number for all, or one for each."""

    stiffness: Floats | float
    delta: Floats | float
    beta: Floats | float


def stages(chain: Chain, part: slice | int = slice(None)) -> Stage:
    """Those of `part` of a chain."""
    if chain.spread is None:
        return Stage(1.0, chain.delta, chain.beta)
    return Stage(chain.stiffness[part], chain.deltas[part], chain.betas[part])


def stage_constant(chain: Chain, amplitude: Floats, omega: float, part: slice | int = slice(None)) -> Floats:
    """kappa_m = 1 - omega^2 + (3/4) beta a_m^2 of theory.md section 2.1 (one harmonic), the 1 its own stiffness.

    `part` : which oscillators the last axis of `amplitude` stands for.
    """
    own = stages(chain, part)
    return np.asarray(own.stiffness - omega**2 + 0.75 * own.beta * amplitude**2)


def links_for(chain: Chain, amplitude: Floats, omega: float) -> Floats:
    """The links that hold an amplitude profile at `omega`, in one harmonic.

    ``(a_{m-1}^2 - a_m^2) lam^2 - 2 kappa_m a_m^2 lam - a_m^2 (kappa_m^2 + delta^2 omega^2) = 0``; of two
    positive roots the smaller, which alone joins rising and falling steps continuously.

    Parameters
    ----------
    amplitude : float64, shape (..., n), dimensionless, > 0.

    Returns
    -------
    float64, shape (..., n-1); NaN where no link can make the step.
    """
    before, here = amplitude[..., :-1], amplitude[..., 1:]
    later = slice(1, None)
    kappa = stage_constant(chain, here, omega, later)
    stiffness2 = kappa**2 + (stages(chain, later).delta * omega) ** 2
    # In mu = 1/lam: stiffness2 mu^2 + 2 kappa mu + 1 - (a_{m-1}/a_m)^2 = 0; the larger root.
    inside = kappa**2 - stiffness2 * (1.0 - (before / here) ** 2)
    with np.errstate(invalid="ignore", divide="ignore"):
        mu = (np.sqrt(inside) - kappa) / stiffness2
        return np.where(mu > 0, 1.0 / mu, np.nan)


def drive_for(chain: Chain, amplitude: Floats, omega: float) -> Floats:
    """Drive amplitude epsilon = a_1 |kappa_1 + i delta omega|; `amplitude` is the first actuator's."""
    kappa = stage_constant(chain, amplitude, omega, 0)
    return np.asarray(amplitude * np.hypot(kappa, stages(chain, 0).delta * omega))


def detuning_gain(chain: Chain, amplitude: Floats, lam: Floats, omega: float) -> Floats:
    """How much more than the drive a disturbance on it is magnified (`Margins.noise_gain`).

    Linear response of every actuator at the resonance of every stage, over its response at `omega`;
    small motions about rest, so an estimate once the pattern is large.

    Parameters
    ----------
    amplitude : float64, shape (P, n), dimensionless, >= 0 (actuators at 0 do not count), the first > 0.
    lam : float64, shape (P, n-1), the links that hold it.

    Returns
    -------
    float64, shape (P,).
    """
    open_end = np.zeros((len(amplitude), 1))
    own = stages(chain)
    stiffness = own.stiffness + np.concatenate([open_end, lam], axis=1)
    at = np.sqrt(stiffness - own.delta**2 / 2)[:, :, None]
    stage = np.abs(stiffness[:, None, :] - at**2 + 1j * own.delta * at)
    forward = np.concatenate([open_end + 1.0, lam], axis=1)
    gains = np.cumprod(forward[:, None, :] / stage, axis=2)
    standing = (amplitude / drive_for(chain, amplitude[:, :1], omega))[:, None, :]
    silent = standing == 0
    return np.asarray(np.max(np.where(silent, 0.0, gains / np.where(silent, 1.0, standing)), axis=(1, 2)))
