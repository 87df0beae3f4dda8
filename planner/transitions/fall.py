"""Ways out of waves: the chain is opened, its motion dies away for a while, and a drive over strong links stops it.

To stop a wave its lags are turned round, from the first actuator to the last, and until that has come through, those
behind go on rising. So the motion is let down by its own damping first, with the links open, as far as the stop needs
it to be.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from chainsim import Chain

from ..drive import closed, smooth_step
from ..operating_point import OperatingPoint
from ..plan import Ramp
from .check import Orbit, Way, travel
from .limits import WayLimits, checked
from .rise import orbit_of, ramp_of
from .search import MET, MOST_PERIODS, STANDS, RampSearch
from .slow_flow import DriveCourse, follow_course
from .steering import Steering, rest

__all__ = ["find_fall"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

# The drive and, where they move, the links are taken away in so many periods; dying away is given up after so many
# e-folds per actuator.
PERIODS, EFOLDS = 8, 12
# E-folds of a single actuator before the stop, tried first, then less and less by so many of its lengths; its length in
# first lengths.
WAITS, LESS, STOP = (2.25, 4.0), 0.3, 0.75
# Radians of the carrier in an interval of a stop's drive, at least: what the next way magnifies has to be small.
INTERVAL = 16.0
# Largest amplitude in a stop, relative to that of the wave: more would magnify every error of drive and device.
CALM = 3.0
# Steps of slow flow in a radian of its fastest rate.
STEP = 0.25


def find_fall(
    chain: Chain, *, epsilon: complex, lam: Floats, omega: float, phasor: Complexes, limits: WayLimits,
    tau_per_s: float, budget: int,
) -> Ramp:  # fmt: skip
    """The shortest way found to rest; after it every actuator has fallen, for good, below 1/1000 of its amplitude.

    Parameters, errors: as `find_way`.
    """
    held = checked(chain, epsilon, lam, omega, phasor, limits, tau_per_s)
    orbit, lacking = orbit_of(chain, held)
    if orbit is None or lacking:
        return ramp_of(_let_go(held, omega, limits, 0.0), limits, tau_per_s, lacking)
    stopped = _stopped(chain, held, orbit, omega, limits, tau_per_s, budget)
    if stopped is not None:
        return ramp_of(stopped, limits, tau_per_s, "")
    return _died(chain, held, orbit, limits, tau_per_s)


def _stopped(
    chain: Chain, held: OperatingPoint, orbit: Orbit, omega: float, limits: WayLimits, tau_per_s: float, budget: int
) -> Way | None:
    """The shortest way found whose end is stopped by the drive."""
    held = replace(held, phasor=orbit.harmonics[0])
    calm = CALM * float(np.abs(held.phasor).max())
    found: list[tuple[RampSearch, Steering, Floats]] = []
    longest = MOST_PERIODS * 2 * math.pi / omega
    spent, waits = 0, [min(efolds * 2 / max(chain.delta, 1e-9), longest) for efolds in WAITS]
    while waits:
        wait = waits.pop(0)
        ahead = _let_go(held, omega, limits, wait)
        start = replace(rest(ahead.lam[-1], omega), phasor=_left(chain, held, omega, ahead))
        search = RampSearch(
            chain, start, rest(ahead.lam[-1], omega), omega, limits, tau_per_s, budget, orbit, ahead, spent
        )
        task = search.task(STOP * search.first_length)
        task = search.task(max(task.duration, INTERVAL * task.intervals / omega))
        unknowns = _after(search, task, found)
        spent = search.spent
        if unknowns is not None and search.allowed(task, unknowns, calm):
            found.append((search, task, unknowns))
            waits = [wait - LESS * task.duration] if wait >= LESS * task.duration else []
    for search, task, unknowns in reversed(found):
        way = search.arriving(task, unknowns)
        if way is not None:
            return way
    return None


def _after(search: RampSearch, task: Steering, found: list[tuple[RampSearch, Steering, Floats]]) -> Floats | None:
    """The stop after less waiting from that after more: as much stronger and turned as what is to be stopped."""
    if not found:
        return search.from_nothing(task)
    _, before, unknowns = found[-1]
    turn = np.vdot(before.start.phasor, task.start.phasor)
    real, imaginary = np.split(unknowns, 2)
    # Drives are measured in what they stop, which has grown as much as they have.
    turned = (real + 1j * imaginary) * turn / abs(turn)
    steered = search.steer(task, np.concatenate([turned.real, turned.imag]), 1.0)
    return steered.unknowns if steered.missed <= MET else None


def _let_go(held: OperatingPoint, omega: float, limits: WayLimits, wait: float) -> Way:
    """Drive and links taken away, and so long a wait (tau) after it."""
    length = 2 * math.pi / omega * PERIODS
    x = np.linspace(0.0, 1.0, 4 * PERIODS + 1)
    step, slope, _ = smooth_step(x)
    open_to = held.lam if limits.lam_scope == "fixed" else np.full_like(held.lam, limits.lam_min)
    lam = held.lam + (open_to - held.lam) * step[:, None]
    drive, drive_slope = np.asarray(held.epsilon * (1 - step)), np.asarray(-held.epsilon * slope / length)
    way = Way(x * length, drive, drive_slope, x * length, lam)
    return way if wait <= 0 else way.then(_still(np.array([0.0, wait]), lam[-1]))


def _still(tau: Floats, lam: Floats) -> Way:
    """No drive, and links that stay."""
    nothing = np.zeros(len(tau), dtype=np.complex128)
    return Way(tau, nothing, nothing, tau, np.repeat(lam[None, :], len(tau), axis=0))


def _left(chain: Chain, held: OperatingPoint, omega: float, way: Way) -> Complexes:
    """Amplitudes at the end of a way on the slow flow."""
    duration = float(way.tau[-1])
    rate = abs(1 - omega**2) + chain.delta + float(held.lam.max(initial=0.0))
    rate += 0.75 * abs(chain.beta) * float(np.abs(held.phasor).max()) ** 2
    steps = math.ceil(duration * max(rate / (2 * omega) / STEP, 4 / (2 * math.pi / omega)))
    tau = np.linspace(0.0, duration, 2 * steps + 1)
    epsilon, epsilon_slope = way.drive(tau)
    lam = closed(chain, way.links(tau))
    slope = np.gradient(lam, tau, axis=0)
    course = DriveCourse(epsilon[:, None], epsilon_slope[:, None], lam, slope, np.zeros_like(lam))
    return np.asarray(follow_course(chain, omega, duration, course, held.phasor, 1.0)[-1, :, 0])


def _died(chain: Chain, held: OperatingPoint, orbit: Orbit, limits: WayLimits, tau_per_s: float) -> Ramp:
    """The way on which the motion dies away by itself."""
    omega, lacking = orbit.omega, ""
    way = _let_go(held, omega, limits, 0.0)
    periods = min(MOST_PERIODS, math.ceil((chain.n + 1) * EFOLDS * omega / (math.pi * max(chain.delta, 1e-9))))
    left = np.abs(travel(chain, omega, way, orbit, periods, (0.0,)).felt[0])
    loud = np.flatnonzero((left > STANDS * np.abs(held.phasor)).any(axis=1))
    over = int(loud[-1]) + 1 if len(loud) else 0
    still = way.then(_still(np.array([0.0, 2 * math.pi / omega * (over + 1)]), way.lam[-1]))
    if over >= periods:
        lacking = f"its motion has not died away after {periods} periods; it lacks damping"
    return ramp_of(still, limits, tau_per_s, lacking)
