"""Ways in and out for waves: weakly coupled chains, which a constant drive brings to their motion in seconds.

While the motion rises, strong links pass energy on quickly; in the last part of the way they come down to the values
that hold the wave, and the drive, found by `gauss_newton`, brings every actuator to its phasor at one moment. What is
found on the slow flow is then corrected until the full equations arrive, and tried in them for the time after.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from chainsim import Chain, Outcome, Setting

from .plan import Ramp
from .steering import Standing
from .way_check import Orbit, Way, travel
from .way_limits import WayLimits, checked
from .way_search import ARRIVES, MOST_PERIODS, STANDS, Search

__all__ = ["find_fall", "find_way"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

# How far the motion that the settings hold may be from the phasors asked for, relative to the largest.
NEAR = 0.02
# A fall takes its drive and links away in so many periods and is given up after so many e-folds per actuator.
FALL_PERIODS, FALL_EFOLDS = 8, 12


def find_way(
    chain: Chain, *, epsilon: complex, lam: Floats, omega: float, phasor: Complexes, limits: WayLimits,
    tau_per_s: float, budget: int,
) -> Ramp:  # fmt: skip
    """The shortest way found from rest to a steady motion; after it the motion stands.

    Parameters
    ----------
    chain : open, of equal actuators over resistors.
    epsilon : steady drive phasor. lam : float64, shape (n-1,). phasor : complex128, shape (n,), the motion they hold.
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
    orbit, lacking = _orbit(chain, held, omega)
    if orbit is not None and not lacking:
        held = Standing(held.epsilon, held.lam, orbit.harmonics[0])
        lacking = limits.unfit(held.lam)
    search = Search(chain, held, omega, limits, tau_per_s, budget)
    if not lacking:
        for task, unknowns in reversed(search.shorter_and_shorter()):
            way = search.arriving(task, unknowns)
            if way is not None:
                return _ramp(way, limits, tau_per_s, "")
        lacking = search.lacking or f"no way was found with {search.spent} slopes; raise the budget or lam_max"
    plain = search.task(search.first_length)
    return _ramp(search.way(plain, np.zeros(plain.size)), limits, tau_per_s, lacking)


def find_fall(
    chain: Chain, *, epsilon: complex, lam: Floats, omega: float, phasor: Complexes, limits: WayLimits, tau_per_s: float
) -> Ramp:
    """The way out: the drive is taken away, the links are opened where they may move, and the motion dies away.

    Braking by the drive is no help: every stage magnifies what is left in those before it. The ramp ends when every
    actuator has fallen, for good, to 1/1000 of its amplitude. Parameters, errors: as `find_way`.
    """
    held = checked(chain, epsilon, lam, omega, phasor, limits, tau_per_s)
    orbit, lacking = _orbit(chain, held, omega)
    way = _let_go(held, omega, limits)
    if orbit is None or lacking:
        return _ramp(way, limits, tau_per_s, lacking)
    periods = min(MOST_PERIODS, math.ceil((chain.n + 1) * FALL_EFOLDS * omega / (math.pi * max(chain.delta, 1e-9))))
    left = np.abs(travel(chain, omega, way, orbit, periods, 0.0).felt)
    loud = np.flatnonzero((left > STANDS * np.abs(held.phasor)).any(axis=1))
    over = int(loud[-1]) + 1 if len(loud) else 0
    end = float(way.tau[-1]) + 2 * math.pi / omega * (over + 1)
    still = Way(
        np.append(way.tau, end), np.append(way.epsilon, 0j), np.append(way.epsilon_slope, 0j),
        np.append(way.lam_tau, end), np.vstack([way.lam, way.lam[-1:]]),
    )  # fmt: skip
    if over >= periods:
        lacking = f"its motion has not died away after {periods} periods; it lacks damping"
    return _ramp(still, limits, tau_per_s, lacking)


def _let_go(held: Standing, omega: float, limits: WayLimits) -> Way:
    length = 2 * math.pi / omega * FALL_PERIODS
    x = np.linspace(0.0, 1.0, 4 * FALL_PERIODS + 1)
    step, slope = x**3 * (10 - 15 * x + 6 * x**2), 30 * (x * (1 - x)) ** 2
    open_to = held.lam if limits.lam_scope == "fixed" else np.full_like(held.lam, limits.lam_min)
    lam = held.lam + (open_to - held.lam) * step[:, None]
    drive, drive_slope = np.asarray(held.epsilon * (1 - step)), np.asarray(-held.epsilon * slope / length)
    return Way(x * length, drive, drive_slope, x * length, lam)


def _orbit(chain: Chain, held: Standing, omega: float) -> tuple[Orbit | None, str]:
    """The periodic motion the settings hold near the phasors, and why there is none to go to."""
    from chainsim import balance_near

    setting = Setting.of(
        chain, epsilon=abs(held.epsilon), phase=float(np.angle(held.epsilon)), lam=held.lam, omega=omega
    )
    answer = balance_near(chain, setting, held.phasor[None, :], tol=ARRIVES / 100)
    if answer.outcome[0] not in (Outcome.OK, Outcome.UNSTABLE):
        return None, f"these settings hold no motion near these phasors ({answer.outcome[0]})"
    orbit = Orbit(answer.harmonics[0], held.lam)
    away = float(np.abs(orbit.harmonics[0] - held.phasor).max() / np.abs(held.phasor).max())
    if not away <= NEAR:
        return orbit, f"what these settings hold differs from these phasors by {100 * away:.2g} %"
    if not answer.stable[0]:
        return orbit, "the motion is not stable under these settings, so it would not stand; choose a smaller amplitude"
    return orbit, ""


def _ramp(way: Way, limits: WayLimits, tau_per_s: float, lacking: str) -> Ramp:
    moves = limits.lam_scope != "fixed" and way.lam.size > 0
    return Ramp(
        t_s=way.tau / tau_per_s,
        epsilon=way.epsilon,
        epsilon_slope=way.epsilon_slope * tau_per_s,
        lam_t_s=way.lam_tau / tau_per_s if moves else None,
        lam=way.lam if moves else None,
        lacking=lacking,
    )
