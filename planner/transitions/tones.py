"""Quick ways into waves of two tones: each tone is steered alone over strong links, and the rest is waited for.

What one tone is to the other's stiffness is lent to it as in the end, so that small motions stand at once; large ones
come to stand by and by, which is followed in the full equations for several places of the beat.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from chainsim import Device

from ..drive import smooth_step
from ..operating_point import OperatingPoint, PointTone
from ..plan import Ramp, ToneRamp
from .gauss_newton import steer
from .hermite import broken_line
from .joining import as_tone
from .limits import WayLimits
from .search import COMING_DOWN, MET, NODES_PER_INTERVAL, PIECE_S, STRONG
from .slow import periods_in, settled, watched
from .steering import LinkCourse, Steering, rest

__all__ = ["quick_rise"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

# Length of the steered part in times that a stage takes to pass energy on; how long it is waited after it, in e-folds
# of a single actuator; places of the beat that are tried, as parts of a turn; steps of Gauss and Newton.
STAGE_TIMES, WAIT, BEATS, STEPS = 1.2, 22.0, (0.0, 0.25, 0.5, 0.75), 3


@dataclass(frozen=True)
class _OneOfTwo(Steering):
    """One tone, under the stiffness that both give it in the end."""

    other: Complexes

    def _lent(self, x: Floats) -> Floats:
        square = np.abs(self.held.phasor) ** 2 + 2 * np.abs(self.other) ** 2
        return np.repeat(square[None, :], len(x), axis=0)


def quick_rise(device: Device, point: OperatingPoint, limits: WayLimits, tolerance: float) -> Ramp | None:
    """The way, or None where it is none within the limits; `tolerance` relative to the largest amplitude."""
    way = _steered(device, point, limits)
    stands = None if way is None else _settled(device, point, way, limits, tolerance)
    if way is None or stands is None or _too_strong(way, limits, device.tau_per_s, point.omega):
        return None
    # The drive stands still while the motion comes to stand.
    return replace(way, t_s=np.append(way.t_s[:-1], max(stands / device.tau_per_s, way.duration_s)))


def _steered(device: Device, point: OperatingPoint, limits: WayLimits) -> Ramp | None:
    """Each tone on its way alone, then for an instant as it stays; None where one does not arrive."""
    mains = [tone for tone in point.every_tone if not tone.side]
    tasks = [_task(device, point, mains[k], mains[1 - k], limits) for k in (0, 1)]
    steered = [steer(task, np.zeros(task.size), 0.0, STEPS) for task in tasks]
    if max(one.missed for one in steered) > MET:
        return None
    task = tasks[0]
    x = np.linspace(0.0, 1.0, NODES_PER_INTERVAL * task.intervals + 1)
    step, step_slope, _ = smooth_step(x)
    own = dict(zip((tone.omega for tone in mains), zip(tasks, steered, strict=True), strict=True))
    tones = []
    for tone in point.every_tone:
        value, slope = tone.epsilon * step, tone.epsilon * step_slope
        if not tone.side:
            one, found = own[tone.omega]
            value, slope = (curve[:, 0] for curve in one.drive(x, found.unknowns[None, :]))
        slope_per_s = np.append(slope / task.duration * device.tau_per_s, 0j)
        tones.append(ToneRamp(tone.omega, np.append(value, tone.epsilon), slope_per_s))
    first, *others = tones
    links, links_slope = task.links.at(x, task.start, task.held)
    pieces = max(8, math.ceil(task.duration / device.tau_per_s / PIECE_S))
    lam = np.clip(broken_line(links[None], links_slope[None], pieces)[0], limits.lam_min, links.max())
    tau, lam_tau = x * task.duration, np.linspace(0.0, task.duration, pieces + 1)
    t_s, lam_t_s = np.append(tau, tau[-1] * (1 + 1e-9)) / device.tau_per_s, lam_tau / device.tau_per_s
    return Ramp(t_s, first.epsilon, first.epsilon_slope, lam_t_s=lam_t_s, lam=lam, tones=tuple(others))


def _task(device: Device, point: OperatingPoint, tone: PointTone, other: PointTone, limits: WayLimits) -> _OneOfTwo:
    top = max(min(limits.lam_max, STRONG), float(point.lam.max()))
    duration = STAGE_TIMES * (device.chain_length + 1) * 2 * tone.omega / max(top, device.delta)
    end = OperatingPoint(tone.epsilon, point.lam, tone.omega, tone.phasor)
    links = LinkCourse(top, COMING_DOWN)
    return _OneOfTwo(device.chain, tone.omega, rest(point.lam, tone.omega), end, links, duration, other.phasor)


def _too_strong(way: Ramp, limits: WayLimits, tau_per_s: float, omega: float) -> bool:
    """Whether the tones together take more than the amplifier gives."""
    drive, change = np.zeros(len(way.t_s)), np.zeros(len(way.t_s))
    for tone in as_tone(way, omega).tones:
        slope = 0.0 if tone.epsilon_slope is None else tone.epsilon_slope
        drive += np.abs(tone.epsilon)
        change += np.abs(slope + 1j * tone.omega * tau_per_s * tone.epsilon)
    return bool(drive.max() > limits.epsilon_max or change.max() > limits.slew_per_s)


def _settled(device: Device, point: OperatingPoint, way: Ramp, limits: WayLimits, tolerance: float) -> float | None:
    """When, in tau, the motion stands for good at every place of the beat; None where it does not."""
    omega, periods = point.omega, periods_in(way.duration_s * device.tau_per_s + WAIT * 2 / device.delta, point.omega)
    gap = next(tone.omega for tone in point.tones if not tone.side) - omega
    restless = 0
    for beat in BEATS:
        seen = watched(device, point, way, periods, beat * 2 * math.pi / abs(gap))
        if not seen.peak <= limits.hilltop(device.chain):
            return None
        restless = max(restless, seen.restless(tolerance))
    return settled(restless, periods, omega)
