"""The slow way: a drive that rises smoothly and is then waited for, in the full equations.

For motions nothing quicker is known for: rings, waves of several tones, and waves whose lam may not move.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from chainsim import Device

from ..drive import closed, felt, play, smooth_step
from ..operating_point import OperatingPoint, PointTone
from ..plan import Ramp, ToneRamp

__all__ = ["Watched", "periods_in", "settled", "slow_fall", "slow_rise", "watched"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

# Lengths of the rise tried, in e-folds of a single actuator; how long it is waited after each, in e-folds of the
# motion's slowest disturbance, or where that is not known, of a single actuator: every stage passes on, magnified,
# what has not yet died in those before it.
RISES, WAIT, LONGER_WAIT = (1.0, 3.0), 30.0, 30.0
# The motion must stay right for the last part of the wait.
STAYS = 0.2
SAMPLES, NODES = 64, 33
# A fall takes the drive away in so many periods.
FALL_PERIODS = 8
LEFT = 1e-3


def slow_rise(device: Device, point: OperatingPoint, tolerance: float) -> Ramp:
    """The shortest of the slow ways from rest; `tolerance` relative to the largest amplitude.

    The drive of the first tone is the ramp's own, the others are its `tones`.
    """
    efold = 2 / device.delta
    found = [(rise, _settled(device, point, rise * efold, tolerance)) for rise in RISES]
    known = [(end, rise) for rise, end in found if end is not None]
    if not known:
        lacking = "the motion does not come to stand from rest; it lacks damping, or a lam that can move on the way"
        return _rise_ramp(device, point, RISES[-1] * efold, RISES[-1] * efold, lacking)
    end, rise = min(known)
    return _rise_ramp(device, point, rise * efold, end, "")


def _rise_ramp(device: Device, point: OperatingPoint, rise: float, end: float, lacking: str) -> Ramp:
    x = np.linspace(0.0, 1.0, NODES)
    # After the rise the drive stands still while the motion comes to stand.
    tau = np.append(x * rise, max(end, rise * (1 + 1e-9)))
    size = smooth_step(x)
    step, slope = np.append(size.value, 1.0), np.append(size.slope, 0.0) / rise * device.tau_per_s
    first, *others = [_tone_ramp(tone, step, slope) for tone in point.every_tone]
    return Ramp(tau / device.tau_per_s, first.epsilon, first.epsilon_slope, lacking=lacking, tones=tuple(others))


def _tone_ramp(tone: PointTone, size: Floats, slope: Floats) -> ToneRamp:
    return ToneRamp(tone.omega, np.asarray(tone.epsilon * size), np.asarray(tone.epsilon * slope))


def _settled(device: Device, point: OperatingPoint, rise: float, tolerance: float) -> float | None:
    """When, in tau, the motion stands for good; None where it does not."""
    periods = periods_in(rise + _wait(device, point), point.omega)
    seen = watched(device, point, _rise_ramp(device, point, rise, rise, ""), periods)
    return settled(seen.restless(tolerance), periods, point.omega)


@dataclass(frozen=True)
class Watched:
    """What comes of a ramp.

    Attributes
    ----------
    away : float64, shape (periods,), worst deviation from the point, relative to its largest amplitudes together.
    peak : largest |z| of all.
    """

    away: Floats
    peak: float

    def restless(self, tolerance: float) -> int:
        """Periods until the motion stands for good."""
        bad = np.flatnonzero(~(self.away <= tolerance))
        return int(bad[-1]) + 1 if len(bad) else 0


def periods_in(tau: float, omega: float) -> int:
    """Whole periods that cover a time."""
    return math.ceil(tau / (2 * math.pi / omega / SAMPLES * SAMPLES))


def settled(restless: int, periods: int, omega: float) -> float | None:
    """The end, in tau, of the first period that stands; None where that is too late in those that were watched."""
    last = ((restless + 1) * SAMPLES - 1) * (2 * math.pi / omega / SAMPLES)
    return last if restless < (1 - STAYS) * periods else None


def watched(device: Device, point: OperatingPoint, ramp: Ramp, periods: int, start: float = 0.0) -> Watched:
    """Follow a ramp from rest in the full equations; `start` : of the ramp, tau from that of the whole plan."""
    tau = np.arange(periods * SAMPLES, dtype=np.float64) * (2 * math.pi / point.omega / SAMPLES)
    z = play(device, point, ramp, tau, start=start)
    turning = {tone.omega: np.exp(1j * tone.omega * (start + tau))[:, None] for tone in point.every_tone}
    wanted = np.zeros_like(z)
    for tone in point.every_tone:
        wanted += (turning[tone.omega] * tone.phasor).real
    scale = sum(float(np.abs(tone.phasor).max()) for tone in point.every_tone)
    ours, theirs = (felt(motion, turning[point.omega], SAMPLES) for motion in (z, wanted))
    return Watched(np.abs(ours - theirs).max(axis=1) / scale, float(np.abs(z).max()))


def _wait(device: Device, point: OperatingPoint) -> float:
    """How long to wait at most, in tau; a disturbance shrinks by the largest Floquet multiplier in every period."""
    multiplier = point.margins.multiplier
    if not 0 < multiplier < 1:
        return LONGER_WAIT * 2 / device.delta
    return -WAIT * 2 * math.pi / point.omega / math.log(multiplier)


def slow_fall(device: Device, point: OperatingPoint, opens: bool) -> Ramp:
    """The drive is taken away, the links are opened where they may be, and the motion dies away by itself.

    It ends when small motions, which the largest amplitude bounds, have fallen to 1/1000.
    """
    length = 2 * math.pi * FALL_PERIODS
    x = np.linspace(0.0, 1.0, NODES)
    step = smooth_step(x)
    lam = point.lam + ((device.coupling.lam.min if opens else point.lam) - point.lam) * step.value[:, None]
    end = length + _dying(device, lam[-1])
    still, slope = 1 - step.value, -step.slope / length * device.tau_per_s
    still, slope, lam = np.append(still, 0.0), np.append(slope, 0.0), np.vstack([lam, lam[-1:]])
    t_s = np.append(x * length, end) / device.tau_per_s
    moves = opens and lam.size > 0
    return Ramp(
        t_s=t_s,
        lam_t_s=t_s if moves else None,
        lam=lam if moves else None,
        tones=tuple(_tone_ramp(tone, still, slope) for tone in point.every_tone),
    )


def _dying(device: Device, lam: Floats) -> float:
    """Time in tau after which a chain without drive has lost all but 1/1000, whatever its motion was."""
    n = device.chain_length
    law = device.chain.law
    # Slow flow of small motions, in the frame of f0: 2 i A' = -i delta A - (what links add to the stiffness) A.
    flow = 0.5j * law.matrix(closed(device.chain, lam)[None], None)[0] - device.delta / 2 * np.eye(n)
    step = 0.1 / device.delta
    # Matrix exponential by squaring of a short Taylor step.
    short = flow * (step / 1024)
    once = np.linalg.matrix_power(np.eye(n) + short + short @ short / 2 + short @ short @ short / 6, 1024)
    left, tau = np.eye(n, dtype=np.complex128), 0.0
    while np.abs(left).sum(axis=1).max() > LEFT and tau < 400 / device.delta:
        left, tau = once @ left, tau + step
    return tau
