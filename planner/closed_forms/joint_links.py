"""Closed forms of chains whose oscillators act on each other: which links hold amplitudes, and which can be held.

Links of a ring are those of an open chain, whose drive the closing link adds to. Where links act both ways, with
``s_m = kappa_m + i delta omega`` (theory.md section 2.1) the balance of oscillator m is
``s_m A_m = lam_m (A_{m-1} - A_m) - lam_{m+1} (A_m - A_{m+1})``. Summed from m to the end,

    lam_m (A_{m-1} - A_m) = J_m,    J_m = s_m A_m + ... + s_n A_n,

so the amplitudes say what each link carries, and ``A_{m-1} = A_m + mu J_m`` with a real ``mu = 1 / lam_m``: what lies
before a link is on a ray. J_1 is the drive.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from chainsim import Chain

from .links import links_for, stage_constant, stages

__all__ = ["HeldLinks", "links_between", "links_both_ways", "links_round"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
Wholes = NDArray[np.intp]


class HeldLinks(NamedTuple):
    """C settings that hold amplitudes, in one harmonic.

    Attributes
    ----------
    profile : int, shape (C,), which of the wanted profiles each is for.
    lam : float64, shape (C, n-1).
    phasor : complex128, shape (C, n), the last one real.
    epsilon : complex128, shape (C,), the drive.
    """

    profile: Wholes
    lam: Floats
    phasor: Complexes
    epsilon: Complexes

    def part(self, at: Wholes | NDArray[np.bool_]) -> HeldLinks:
        """Some of them."""
        return HeldLinks(self.profile[at], self.lam[at], self.phasor[at], self.epsilon[at])


def links_round(chain: Chain, amplitude: Floats, omega: float, lam_max: float) -> HeldLinks:
    """The links up to `lam_max` of a ring that hold profiles of amplitudes; as `links_both_ways`.

    The closing link is set like the first.
    """
    lam = links_for(chain, amplitude, omega)
    profile = np.flatnonzero(np.isfinite(lam).all(axis=1) & (lam.max(axis=1) <= lam_max))
    lam, here = lam[profile], amplitude[profile]
    stage = stage_constant(chain, here, omega) + 1j * stages(chain).delta * omega
    phasor = here.astype(np.complex128)
    for m in range(chain.n - 1, 0, -1):
        phasor[:, m - 1] = phasor[:, m] * (1 + stage[:, m] / lam[:, m - 1])
    epsilon = stage[:, 0] * phasor[:, 0] - lam[:, 0] * (phasor[:, -1] - phasor[:, 0])
    return HeldLinks(profile, lam, phasor, epsilon)


def links_both_ways(chain: Chain, amplitude: Floats, omega: float, lam_max: float) -> HeldLinks:
    """All links up to `lam_max` that hold profiles of amplitudes at `omega`, whatever the phases.

    From the last oscillator up, ``|A_m + mu J_m| = a_{m-1}`` is a quadratic for mu. A step down towards the end has
    one root, a step up has two or none. Where it has none the nearest amplitude on the ray is taken, if there is one.

    Parameters
    ----------
    amplitude : float64, shape (P, n), dimensionless, > 0.
    """
    count, n = amplitude.shape
    stage = stage_constant(chain, amplitude, omega) + 1j * stages(chain).delta * omega
    profile, lam = np.arange(count), np.zeros((count, n - 1))
    phasor = np.zeros((count, n), dtype=np.complex128)
    phasor[:, -1] = amplitude[:, -1]
    carried = stage[:, -1] * phasor[:, -1]
    for m in range(n - 1, 0, -1):
        nearest, root = _roots(phasor[:, m], carried, amplitude[profile, m - 1])
        mu = np.concatenate([nearest - root, nearest + root])
        # Where there is no root both are the nearest.
        good = np.isfinite(mu) & (mu * lam_max >= 1)
        good[len(root) :] &= root > 0
        at = np.tile(np.arange(len(profile)), 2)[good]
        profile, lam, phasor = profile[at], lam[at], phasor[at]
        lam[:, m - 1] = 1 / mu[good]
        phasor[:, m - 1] = phasor[:, m] + mu[good] * carried[at]
        carried = carried[at] + stage[profile, m - 1] * phasor[:, m - 1]
    return HeldLinks(profile, lam, phasor, carried)


def _roots(here: Complexes, carried: Complexes, wanted: Floats) -> tuple[Floats, Floats]:
    """Middle and half the distance of the two mu with ``|here + mu carried| = wanted``; 0 apart where there is none."""
    size, along = np.abs(carried) ** 2, np.real(here * np.conj(carried))
    inside = along**2 - size * (np.abs(here) ** 2 - wanted**2)
    with np.errstate(divide="ignore", invalid="ignore"):
        return -along / size, np.sqrt(np.maximum(inside, 0.0)) / size


def links_between(
    chain: Chain, phasor: Complexes, omega: float, lam_min: float, lam_max: float
) -> tuple[Floats, float]:
    """The real links nearest to those that phasors ask for, and how much they leave of what is to be carried.

    ``lam_m (A_{m-1} - A_m) = J_m`` is linear in the links; each is its own least squares.

    Parameters
    ----------
    phasor : complex128, shape (n,), neighbours apart.

    Returns
    -------
    Links, float64, shape (n-1,), and the largest part of any J_m that no link in the range carries.
    """
    stage = stage_constant(chain, np.abs(phasor), omega) + 1j * stages(chain).delta * omega
    carried = np.cumsum((stage * phasor)[::-1])[::-1][1:]
    step = phasor[:-1] - phasor[1:]
    lam = np.real(carried * np.conj(step)) / np.maximum(np.abs(step) ** 2, 1e-300)
    lam = np.clip(lam, lam_min, lam_max)
    left = np.abs(carried - lam * step) / np.maximum(np.abs(carried), 1e-300)
    return lam, float(left.max(initial=0.0))
