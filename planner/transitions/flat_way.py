"""Ways under links that stay, backwards from the last actuator: every chain with one drive is flat, whatever its law.

With ``G_m`` as in `envelopes`, links both ways carry ``J_m = G_m + J_{m+1}``, and ``A_{m-1} = A_m + J_m / lam_m``;
links one way carry ``G_m`` alone. The drive is ``J_1``, and where a link closes a ring, what that does is taken from
it. What is found so is tried under the full equations.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from chainsim import Chain, Device

from ..operating_point import OperatingPoint
from ..plan import Ramp
from . import jets
from .check import Orbit, Passage, Way, travel
from .envelopes import SMOOTHEST, force_on, timed
from .jets import Jet
from .limits import WayLimits
from .rise import orbit_of
from .search import MOST_PERIODS, PHASES, STANDS

__all__ = ["flat_fall", "flat_rise"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

# Lengths tried, in seconds times f0; nodes of the drive.
LENGTHS, NODES = (20.0, 27.0, 35.0, 45.0, 60.0, 80.0, 106.0), 401


def flat_rise(device: Device, point: OperatingPoint, limits: WayLimits) -> Ramp | None:
    """The shortest way in of those tried after which the motion stands; None where none does."""
    orbit, lacking = orbit_of(device.chain, point)
    if orbit is None or lacking:
        return None
    for way in _ways(device, point, 1.0):
        passage = _tried(device, point, way, limits, None)
        if passage is not None and _within(passage, point.phasor, point):
            return _ramp(device, way)
    return None


def flat_fall(device: Device, point: OperatingPoint, limits: WayLimits) -> Ramp | None:
    """The shortest way out of those tried after which nothing moves; None where there is none. The links stay."""
    orbit, _ = orbit_of(device.chain, point)
    for way in _ways(device, point, -1.0) if orbit is not None else ():
        passage = _tried(device, point, way, limits, orbit)
        if passage is not None and _within(passage, np.zeros_like(point.phasor), point):
            return _ramp(device, way)
    return None


def _within(passage: Passage, wanted: Complexes, point: OperatingPoint) -> bool:
    """Whether what is felt is right from the end of the way on."""
    away = np.abs(passage.felt - wanted).max(axis=(0, 1))
    return bool(np.all(away <= 0.4 * STANDS * np.abs(point.phasor).max()))


def _tried(device: Device, point: OperatingPoint, way: Way, limits: WayLimits, start: Orbit | None) -> Passage | None:
    """What comes of a way; None where it exceeds a limit."""
    chain = device.chain
    if limits.exceeded(way, point.omega, device.tau_per_s):
        return None
    efold = 2 / max(chain.delta, 1e-9)
    periods = min(MOST_PERIODS, math.ceil(3 * efold * point.omega / (2 * math.pi)))
    passage = travel(chain, point.omega, way, start, periods, PHASES)
    return passage if passage.peak <= limits.hilltop(chain) else None


def _ramp(device: Device, way: Way) -> Ramp:
    """The way in seconds."""
    scale = device.tau_per_s
    return Ramp(way.tau / scale, way.epsilon, way.epsilon_slope * scale, lam_t_s=way.lam_tau / scale, lam=way.lam)


def _ways(device: Device, point: OperatingPoint, sign: float) -> list[Way]:
    return [_way(device.chain, point, 2 * math.pi * length, sign) for length in LENGTHS]


def _way(chain: Chain, point: OperatingPoint, duration: float, sign: float) -> Way:
    """The way that brings every actuator up to its phasor (`sign` 1) or down from it (-1) in `duration` (tau)."""
    x = np.linspace(0.0, 1.0, NODES)
    smooth = sign * jets.smoothstep(SMOOTHEST, NODES, 2 * chain.n + 2)
    smooth[0] += sign < 0
    epsilon = _drive(chain, point, timed(smooth, duration))
    # The settings that hold the motion know its third harmonic too.
    end = -1 if sign > 0 else 0
    share = (point.epsilon / epsilon[0][end]) if epsilon[0][end] else 1.0
    links = np.repeat(point.lam[None, :], 2, axis=0)
    ends = np.array([0.0, duration])
    return Way(x * duration, epsilon[0] * share, epsilon[1] * share, ends, links)


def _drive(chain: Chain, point: OperatingPoint, blend: Floats) -> tuple[Complexes, Complexes]:
    """The drive's envelope and its derivative where the last actuator follows a jet times its phasor."""
    both, last = chain.law.both_ways, np.asarray(blend * point.phasor[-1])[:, None, :]
    envelope: Jet = last
    behind: Jet = np.zeros_like(envelope)
    for m in range(chain.n - 1, -1, -1):
        force = force_on(chain, m, point.omega, envelope, jets.norm2(envelope))
        carried = force + behind[: len(force)] if both else force
        if m:
            envelope, behind = carried / point.lam[m - 1] + envelope[: len(carried)], carried
    if chain.law.closed:
        carried = carried + point.lam[0] * (envelope - last[: len(envelope)])[: len(carried)]
    return carried[0, 0], carried[1, 0]
