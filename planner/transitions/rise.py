"""Ways into waves: weakly coupled chains, which a constant drive brings to their motion in seconds.

While the motion rises, strong links pass energy on quickly; in the last part of the way they come down to the values
that hold the wave, and the drive, found by `gauss_newton`, brings every actuator to its phasor at one moment. What is
found on the slow flow is then corrected until the full equations arrive, and tried in them for the time after.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import chain as chain_of

import numpy as np
from numpy.typing import NDArray

from chainsim import Chain, Outcome

from ..operating_point import OperatingPoint, setting_of
from ..plan import Ramp
from .check import Orbit, Way
from .limits import WayLimits, checked
from .search import ARRIVES, RampSearch
from .steering import rest

__all__ = ["find_way", "orbit_of", "ramp_of"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

# How far the motion that the settings hold may be from the phasors asked for, relative to the largest.
NEAR = 0.02


def find_way(
    chain: Chain, *, epsilon: complex, lam: Floats, omega: float, phasor: Complexes, limits: WayLimits,
    tau_per_s: float, budget: int,
) -> Ramp:  # fmt: skip
    """The shortest way found from rest to a steady motion; after it the motion stands.

    Parameters
    ----------
    chain : one, of equal actuators over resistors.
    epsilon : steady drive phasor.
    lam : float64, shape (n-1,).
    phasor : complex128, shape (n,), the motion they hold.
    tau_per_s : of the device.
    budget : how many slopes (sensitivities of a whole way, 10..50 ms each) may be taken; 60 are plenty where the links
        may move.

    Returns
    -------
    Ramp whose drive is relative to the carrier ``e^{i omega tau}``, wherever that is when it begins. Its links begin at
    once at their first values: at rest that moves nothing. `lacking` says why when there is no way within the limits.

    Raises
    ------
    WayError
        When an argument does not fit the chain.
    """
    held = checked(chain, epsilon, lam, omega, phasor, limits, tau_per_s)
    orbit, lacking = orbit_of(chain, held)
    if orbit is not None and not lacking:
        held = replace(held, phasor=orbit.harmonics[0])
        lacking = limits.unfit(held.lam)
    search = RampSearch(chain, rest(held.lam, omega), held, omega, limits, tau_per_s, budget)
    if not lacking:
        found = search.shorter_and_shorter()
        longer = search.longer_and_longer(found[0][0]) if found else ()
        for task, unknowns in chain_of(reversed(found), longer):
            way = search.arriving(task, unknowns)
            if way is not None:
                return ramp_of(way, limits, tau_per_s, "")
        lacking = search.lacking or f"no way was found with {search.spent} slopes; raise the budget or lam_max"
    plain = search.task(search.first_length)
    return ramp_of(search.way(plain, np.zeros(plain.size)), limits, tau_per_s, lacking)


def orbit_of(chain: Chain, point: OperatingPoint) -> tuple[Orbit | None, str]:
    """The periodic motion the settings hold near the phasors, and why there is none to go to."""
    from chainsim import balance_near

    answer = balance_near(chain, setting_of(chain, [point]), point.phasor[None, :], tol=ARRIVES / 100)
    if answer.outcome[0] not in (Outcome.OK, Outcome.UNSTABLE):
        return None, f"these settings hold no motion near these phasors ({answer.outcome[0]})"
    orbit = Orbit(answer.harmonics[0], point.lam, point.omega)
    away = float(np.abs(orbit.harmonics[0] - point.phasor).max() / np.abs(point.phasor).max())
    if not away <= NEAR:
        return orbit, f"what these settings hold differs from these phasors by {100 * away:.2g} %"
    if not answer.stable[0]:
        return orbit, "the motion is not stable under these settings, so it would not stand; choose a smaller amplitude"
    return orbit, ""


def ramp_of(way: Way, limits: WayLimits, tau_per_s: float, lacking: str) -> Ramp:
    """The way in seconds; links only where they may move."""
    moves = limits.lam_scope != "fixed" and way.lam.size > 0
    return Ramp(
        t_s=way.tau / tau_per_s,
        epsilon=way.epsilon,
        epsilon_slope=way.epsilon_slope * tau_per_s,
        lam_t_s=way.lam_tau / tau_per_s if moves else None,
        lam=way.lam if moves else None,
        lacking=lacking,
    )
