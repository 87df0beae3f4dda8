"""Quick ways into waves of two tones: each tone is steered alone over strong links, and the rest is waited for.

What one tone is to the other's stiffness is lent to it as in the end, so that small motions stand at once; large ones
come to stand by and by, which is followed in the full equations for several places of the beat.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from chainsim import Device

from ..drive import FirstOrderHold, felt, full_motion, smooth_step
from ..operating_point import OperatingPoint, Tone
from ..plan import Ramp, ToneRamp
from .gauss_newton import steer
from .hermite import broken_line
from .limits import WayLimits
from .search import COMING_DOWN, MET, NODES_PER_INTERVAL, PIECE_S, STRONG
from .slow import SAMPLES, STAYS
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
    settled = _settled(device, point, _Played(tau, lam_tau, lam, tuple(tones)), limits, tolerance)
    if settled is None or _too_strong(tones, limits, device.tau_per_s):
        return None
    t_s = np.append(tau, max(settled, tau[-1] * (1 + 1e-9))) / device.tau_per_s
    return Ramp(
        t_s, first.epsilon, first.epsilon_slope, lam_t_s=lam_tau / device.tau_per_s, lam=lam, tones=tuple(others)
    )


def _task(device: Device, point: OperatingPoint, tone: Tone, other: Tone, limits: WayLimits) -> _OneOfTwo:
    top = max(min(limits.lam_max, STRONG), float(point.lam.max()))
    duration = STAGE_TIMES * (device.chain_length + 1) * 2 * tone.omega / max(top, device.delta)
    end = OperatingPoint(tone.epsilon, point.lam, tone.omega, tone.phasor)
    links = LinkCourse(top, COMING_DOWN)
    return _OneOfTwo(device.chain, tone.omega, rest(point.lam, tone.omega), end, links, duration, other.phasor)


def _too_strong(tones: list[ToneRamp], limits: WayLimits, tau_per_s: float) -> bool:
    """Whether the tones together take more than the amplifier gives."""
    drive = np.sum([np.abs(tone.epsilon) for tone in tones], axis=0)
    change = np.zeros(len(drive))
    for tone in tones:
        slope = 0.0 if tone.epsilon_slope is None else tone.epsilon_slope
        change += np.abs(slope + 1j * tone.omega * tau_per_s * tone.epsilon)
    return bool(drive.max() > limits.epsilon_max or change.max() > limits.slew_per_s)


@dataclass(frozen=True)
class _Played:
    """Drive nodes at `tau`, and one behind the end; links."""

    tau: Floats
    lam_tau: Floats
    lam: Floats
    tones: tuple[ToneRamp, ...]

    def envelope(self, tone: ToneRamp, tau: Floats) -> Complexes:
        """Of a tone at instants."""
        here = np.interp(tau, self.tau, tone.epsilon[:-1].real) + 1j * np.interp(tau, self.tau, tone.epsilon[:-1].imag)
        return np.where(tau < self.tau[-1], here, tone.epsilon[-1])


def _settled(device: Device, point: OperatingPoint, way: _Played, limits: WayLimits, tolerance: float) -> float | None:
    """When, in tau, the motion stands for good at every place of the beat; None where it does not."""

    n, omega = device.chain_length, point.omega
    dtau = 2 * math.pi / omega / SAMPLES
    periods = math.ceil((float(way.tau[-1]) + WAIT * 2 / device.delta) / dtau / SAMPLES)
    tau = np.arange(periods * SAMPLES, dtype=np.float64) * dtau
    gap = next(tone.omega for tone in point.tones if not tone.side) - omega
    lam = np.zeros((len(tau), 1, n))
    for link in range(n - 1):
        lam[:, 0, link + 1] = np.interp(tau, way.lam_tau, way.lam[:, link])
    envelopes = [way.envelope(tone, tau) for tone in way.tones]
    carrier, last = np.exp(1j * omega * tau)[:, None], 0
    for beat in BEATS:
        force, wanted = np.zeros((len(tau), 1)), np.zeros((len(tau), n))
        for tone, envelope in zip(point.every_tone, envelopes, strict=True):
            turning = np.exp(1j * (tone.omega * tau + 2 * math.pi * beat * round((tone.omega - omega) / gap)))
            force[:, 0] += (envelope * turning).real / FirstOrderHold.of(tone.omega, dtau).passed
            wanted += (turning[:, None] * tone.phasor).real
        z = full_motion(device.chain, dtau, force, lam)[:, 0]
        if not np.abs(z).max() <= limits.hilltop(device.chain):
            return None
        scale = sum(float(np.abs(tone.phasor).max()) for tone in point.every_tone)
        away = np.abs(felt(z, carrier, SAMPLES) - felt(wanted, carrier, SAMPLES)).max(axis=1)
        bad = np.flatnonzero(~(away <= tolerance * scale))
        last = max(last, int(bad[-1]) + 1 if len(bad) else 0)
    return float(tau[(last + 1) * SAMPLES - 1]) if last < (1 - STAYS) * periods else None
