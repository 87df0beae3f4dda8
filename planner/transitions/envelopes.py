"""Ways between vibrating patterns, computed backwards from the last actuator (the chain is flat).

With z_m = Re(A_m e^{i omega tau}), one stage of the chain reads
``lam_m A_{m-1} = G_m + lam_m A_m``, ``G_m = kappa_m A_m + (2 i omega + delta) A_m' + A_m''``
with ``kappa_m = 1 - omega^2 + i delta omega + (3/4) beta |A_m|^2`` (theory.md section 4.2). All functions work
on Taylor jets over P ramps at once: shape (K, P, nodes).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from chainsim import Chain

from ..closed_forms.links import links_for, stages
from . import jets
from .blending import blended
from .jets import Jet
from .resample import chebyshev_points, converged, resampled

__all__ = ["ROUGHEST", "SMOOTHEST", "EnvelopeRamp", "change", "fall", "force_on", "rise", "timed"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

# Smoothness of the blends. Rougher ones leave a residue that later stages magnify, smoother ones are
# steeper in the middle; these were the best of C^5..C^13 under the full equations.
ROUGHEST = 9
SMOOTHEST = 11
# Points at which the links and the drive of most changes are known to nine digits.
POINTS = 97


@dataclass(frozen=True)
class EnvelopeRamp:
    """P ramps at equally spaced nodes over [0, duration] (in tau).

    Attributes
    ----------
    epsilon, epsilon_slope : complex128, shape (P, nodes), drive envelope and its derivative in tau.
    lam, lam_slope : float64, shape (P, nodes, n-1).
    peak : float64, shape (P, n), largest amplitude of each actuator on the way.
    possible : bool, shape (P,); False where no links can make the change in this time.
    """

    epsilon: Complexes
    epsilon_slope: Complexes
    lam: Floats
    lam_slope: Floats
    peak: Floats
    possible: NDArray[np.bool_]


def _blend(duration: float, nodes: int, n: int, order: int) -> Floats:
    return timed(jets.smoothstep(order, nodes, 2 * n + 2), duration)


@cache
def _at_points(n: int) -> Floats:
    """The blend at Chebyshev's points over [0, 1]."""
    return jets.smoothstep_at(ROUGHEST, chebyshev_points(POINTS), 2 * n + 2)


def timed(blend: Floats, duration: float) -> Floats:
    """A jet over [0, 1] as one over `duration` in tau."""
    return np.asarray(blend * (duration ** -np.arange(len(blend), dtype=np.float64))[:, None])


def force_on(chain: Chain, m: int, omega: float, envelope: Jet, modulus2: Jet) -> Jet:
    """G_m, two orders shorter than the envelope."""
    own = stages(chain, m)
    first = jets.derivative(envelope)
    second = jets.derivative(first)
    length = len(second)
    stiffness = 0.75 * own.beta * modulus2[:length] + 0j
    stiffness[0] += own.stiffness - omega**2 + 1j * own.delta * omega
    return jets.multiply(stiffness, envelope[:length]) + (2j * omega + own.delta) * first[:length] + second


def rise(chain: Chain, amplitude: Floats, omega: float, duration: float, nodes: int) -> EnvelopeRamp:
    """From rest to amplitude profiles, with the profile's own links held constant.

    The last actuator follows a smoothstep; every other one, and the drive, follow from it.

    Parameters
    ----------
    amplitude : float64, shape (P, n), dimensionless; all zero means stay at rest.
    duration : in tau.
    """
    return _flat(chain, amplitude, omega, _blend(duration, nodes, amplitude.shape[1], SMOOTHEST))


def fall(chain: Chain, amplitude: Floats, omega: float, duration: float, nodes: int) -> EnvelopeRamp:
    """From amplitude profiles to rest, with the profile's own links held constant; as `rise`."""
    blend = -_blend(duration, nodes, amplitude.shape[1], SMOOTHEST)
    blend[0] += 1.0
    return _flat(chain, amplitude, omega, blend)


def _flat(chain: Chain, amplitude: Floats, omega: float, blend: Floats) -> EnvelopeRamp:
    count, n = amplitude.shape
    idle = ~np.any(amplitude > 0, axis=1)
    held = np.where(idle[:, None], 1.0, amplitude)
    links = links_for(chain, held, omega)
    possible = np.all(np.isfinite(links), axis=1)
    # Any number, so that what cannot be made does not spoil the arithmetic of what can.
    links = np.where(possible[:, None], links, 1.0)
    phasor = _steady_phasor(chain, held, links, omega) * ~idle[:, None]
    envelope: Jet = blend[:, None, :] * phasor[None, :, -1:]
    peak = np.empty((count, n))
    for m in range(n - 1, -1, -1):
        peak[:, m] = np.abs(envelope[0]).max(axis=1)
        force = force_on(chain, m, omega, envelope, jets.norm2(envelope))
        if m:
            envelope = force / links[:, m - 1, None] + envelope[: len(force)]
    nodes = blend.shape[1]
    lam = np.repeat(links[:, None, :], nodes, axis=1)
    return EnvelopeRamp(force[0], force[1], lam, np.zeros_like(lam), peak, possible)


def _steady_phasor(chain: Chain, amplitude: Floats, links: Floats, omega: float) -> Complexes:
    """Phasors of a profile with the last one real, one harmonic."""
    phasor = np.empty(amplitude.shape, dtype=np.complex128)
    phasor[:, -1] = amplitude[:, -1]
    for m in range(amplitude.shape[1] - 1, 0, -1):
        own = stages(chain, m)
        kappa = own.stiffness - omega**2 + 1j * own.delta * omega + 0.75 * own.beta * amplitude[:, m] ** 2
        phasor[:, m - 1] = phasor[:, m] * (1.0 + kappa / links[:, m - 1])
    return phasor


def change(chain: Chain, before: Floats, after: Floats, omega: float, duration: float, nodes: int) -> EnvelopeRamp:
    """From amplitude profiles to others without passing silence, with links that vary in time.

    Every modulus follows a blend of its old and new value; links and drive follow from it (`blending`). They are
    worked out at `POINTS` of Chebyshev's where these describe them, else at every node.

    Parameters
    ----------
    before, after : float64, shape (P, n), dimensionless, > 0 (or n = 1, where 0 is allowed).
    duration : in tau.
    """
    count, n = before.shape
    drive, lam, slope = np.empty((count, nodes, 4)), np.empty((count, nodes, n - 1)), np.empty((count, nodes, n - 1))
    possible, rest = np.ones(count, dtype=np.bool_), np.arange(count)
    if nodes > POINTS:
        few = blended(chain, before, after, omega, timed(_at_points(n), duration))
        good = few.possible & converged(np.concatenate([few.drive[:, :, :2], few.lam], axis=2))
        # One by one: products this small are done by one core, which others at work do not hold up.
        drive[good], lam[good], slope[good] = (
            resampled(curves[good], nodes) for curves in (few.drive, few.lam, few.slope)
        )
        rest = np.flatnonzero(~good)
    if len(rest):
        every = blended(chain, before[rest], after[rest], omega, _blend(duration, nodes, n, ROUGHEST))
        drive[rest], lam[rest], slope[rest], possible[rest] = every.drive, every.lam, every.slope, every.possible
    epsilon, epsilon_slope = (drive[:, :, part] + 1j * drive[:, :, part + 1] for part in (0, 2))
    return EnvelopeRamp(epsilon, epsilon_slope, lam, slope, np.maximum(before, after), possible)
