"""Ways between vibrating patterns, computed backwards from the last actuator (the chain is flat).

With z_m = Re(A_m e^{i omega tau}), one stage of the chain reads
``lam_m A_{m-1} = G_m + lam_m A_m``, ``G_m = kappa_m A_m + (2 i omega + delta) A_m' + A_m''``
with ``kappa_m = 1 - omega^2 + i delta omega + (3/4) beta |A_m|^2`` (physics.md section 4). All functions work
on Taylor jets over P ramps at once: shape (K, P, nodes).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chainsim import Chain

from . import jets
from .links import links_for

__all__ = ["ROUGHEST", "SMOOTHEST", "EnvelopeRamp", "change", "fall", "rise"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
Jet = NDArray[Any]

# Smoothness of the blends. Rougher ones leave a residue that later stages magnify, smoother ones are
# steeper in the middle; these were the best of C^5..C^13 under the full equations.
ROUGHEST = 9
SMOOTHEST = 11


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
    length = 2 * n + 2
    scale = duration ** -np.arange(length, dtype=np.float64)
    return jets.smoothstep(order, nodes, length) * scale[:, None]


def _force(chain: Chain, omega: float, envelope: Jet, modulus2: Jet) -> Jet:
    """G_m, two orders shorter than the envelope."""
    first = jets.derivative(envelope)
    second = jets.derivative(first)
    length = len(second)
    stiffness = 0.75 * chain.beta * modulus2[:length] + 0j
    stiffness[0] += 1.0 - omega**2 + 1j * chain.delta * omega
    return jets.multiply(stiffness, envelope[:length]) + (2j * omega + chain.delta) * first[:length] + second


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
        force = _force(chain, omega, envelope, jets.norm2(envelope))
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
        kappa = 1.0 - omega**2 + 1j * chain.delta * omega + 0.75 * chain.beta * amplitude[:, m] ** 2
        phasor[:, m - 1] = phasor[:, m] * (1.0 + kappa / links[:, m - 1])
    return phasor


def change(chain: Chain, before: Floats, after: Floats, omega: float, duration: float, nodes: int) -> EnvelopeRamp:
    """From amplitude profiles to others without passing silence, with links that vary in time.

    Every modulus follows a blend of its old and new value; then ``A_{m-1} = A_m + mu G_m`` with
    ``|G|^2 mu^2 + 2 Re(A conj(G)) mu + |A|^2 - r_{m-1}^2 = 0``, mu = 1/lam_m(tau).

    Parameters
    ----------
    before, after : float64, shape (P, n), dimensionless, > 0 (or n = 1, where 0 is allowed).
    duration : in tau.
    """
    count, n = before.shape
    blend = _blend(duration, nodes, n, ROUGHEST)
    modulus = (after - before).T[:, None, :, None] * blend[None, :, None, :]
    modulus[:, 0] += before.T[:, :, None]
    lam = np.empty((count, nodes, n - 1))
    slope = np.empty_like(lam)
    possible = np.ones(count, dtype=np.bool_)
    envelope: Jet = modulus[-1] + 0j
    for m in range(n - 1, -1, -1):
        squared = jets.multiply(modulus[m], modulus[m])
        force = _force(chain, omega, envelope, squared)
        if m:
            here = envelope[: len(force)]
            gap = squared - jets.multiply(modulus[m - 1], modulus[m - 1])
            mu, feasible = _link(here, force, gap)
            possible &= feasible
            lam[:, :, m - 1] = 1.0 / mu[0]
            slope[:, :, m - 1] = -mu[1] / mu[0] ** 2
            envelope = here + jets.multiply(mu + 0j, force)
    peak = np.maximum(before, after)
    return EnvelopeRamp(force[0], force[1], lam, slope, peak, possible)


def _link(envelope: Jet, force: Jet, gap: Jet) -> tuple[Jet, NDArray[np.bool_]]:
    """mu = 1/lam as a jet (the root that joins the steady links at both ends), and where it exists."""
    size = jets.norm2(force)
    along = jets.product_real(envelope, force)
    inside = jets.multiply(along, along) - jets.multiply(size, gap)
    feasible = np.all(inside[0] > 0, axis=1)
    inside[:, ~feasible] = 0.0
    inside[0, ~feasible] = 1.0
    return jets.divide(jets.square_root(inside) - along, size), feasible
