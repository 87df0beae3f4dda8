"""Rings that never settle: drives under which no motion locks, found on the slow flow, tried in the full equations."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from itertools import product

import numpy as np
from numpy.typing import NDArray

from chainsim import Device, Outcome

from ..drive import felt, play, smooth_step
from ..family import RisingFamily
from ..margins import lacking_of, slew_of
from ..operating_point import Margins, OperatingPoint
from ..plan import Ramp
from ..targets import ChainTarget, UnlockedTarget
from ..transitions.slow import slow_fall
from .beats import DEPTH_OFF, Beats, beats_of, beats_off

__all__ = ["Unlocked"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

# What is tried: drives in units of delta^1.5 / sqrt|beta|, detunings and links in units of delta.
DRIVES, DETUNINGS, LINKS = (0.8, 1.05, 1.3, 1.55, 1.8, 2.1, 2.6), np.linspace(-0.4, 0.8, 9), np.linspace(0.95, 1.17, 9)
# Seconds times f0 delta: the rise of the drive, the time before beats are regular, and the windows they are felt in.
RISE, BEFORE, WINDOW = 1.5, 9.0, 21.0
# Steps of the slow flow in units of 1/delta, and how many make one look.
STEP, LOOK = 0.15, 3
# Beats are regular where so much of their spectrum is one line, and two windows agree this well.
REGULAR, AGREE = 0.75, 0.05
# Samples of a period of the full equations, and how many of the nearest settings are tried in them.
SAMPLES, TRIED = 48, 4
# Of what depth and period may be off so much may be planned; the rest is for other windows.
SURE = 0.8


class Unlocked(RisingFamily):
    """Beats of a ring that is driven where none of its motions is stable."""

    def points(self, targets: Sequence[ChainTarget]) -> list[OperatingPoint]:
        """One by one."""
        return [self._point(target) for target in targets if isinstance(target, UnlockedTarget)]

    def enter(self, point: OperatingPoint, moves: bool) -> Ramp:
        """The drive rises, and beats become regular."""
        return _rise(self.device, point)

    def leave(self, point: OperatingPoint, moves: bool) -> Ramp:
        """The drive is taken away."""
        return slow_fall(self.device, point, moves)

    def _point(self, target: UnlockedTarget) -> OperatingPoint:
        device = self.device
        if not device.chain.law.closed or device.chain.spread is not None:
            return _nothing(device, target, "only a ring of equal actuators beats by itself; it lacks a closing link")
        points, beats = self._known
        if not points:
            return _nothing(device, target, "no drive was found under which it does not lock; it lacks range of lam")
        away = beats_off(beats, target.depth, target.period_s)
        found = list[OperatingPoint]()
        for at in np.argsort(away, kind="stable")[:TRIED].tolist():
            found.append(_tried(device, points[at], target))
            if found[-1].outcome is Outcome.OK:
                break
        return min(found, key=lambda point: (point.outcome is not Outcome.OK, point.error))

    @cached_property
    def _known(self) -> tuple[list[OperatingPoint], Beats]:
        """All settings whose beats are regular on the slow flow."""
        device = self.device
        points = _settings(device)
        if not points:
            return [], beats_of(np.zeros((9, 0, device.chain_length)), 1.0)
        step = STEP / device.delta
        amplitude = _followed(device, points, step)
        every_s, first = LOOK * step / device.tau_per_s, round(BEFORE * 2 * math.pi / STEP / LOOK)
        half = (len(amplitude) - first) // 2
        early, late = (beats_of(part, every_s) for part in (amplitude[first : first + half], amplitude[first + half :]))
        good = (late.share > REGULAR) & (early.share > REGULAR) & (np.abs(early.depth - late.depth) < AGREE)
        good &= (np.abs(early.period_s / late.period_s - 1) < AGREE) & (late.depth > DEPTH_OFF)
        at = np.flatnonzero(good)
        return [points[i] for i in at.tolist()], Beats(*(one[at] for one in late))


def _settings(device: Device) -> list[OperatingPoint]:
    unit = device.delta**1.5 / math.sqrt(abs(device.beta) or 1.0)
    behind = device.chain_length - 1
    tried = product(DRIVES, DETUNINGS.tolist(), LINKS.tolist())
    points = [
        OperatingPoint(complex(drive * unit), np.full(behind, link * device.delta), 1 + off * device.delta)
        for drive, off, link in tried
    ]
    lam, omega = device.coupling.lam, device.omega
    return [
        point for point in points
        if lam.min <= point.lam[0] <= lam.max and omega.min <= point.omega <= omega.max
        and abs(point.epsilon) <= device.epsilon_max
    ]  # fmt: skip


def _followed(device: Device, points: Sequence[OperatingPoint], step: float) -> Floats:
    """Amplitudes in units of full scale on the slow flow of first order, from rest; float64, shape (T, P, n)."""
    epsilon = np.array([point.epsilon for point in points])
    lam, omega = (
        np.array([[one] for one in ones]) for ones in zip(*((p.lam[0], p.omega) for p in points), strict=True)
    )
    damping, still = 2j * omega + device.delta, 1 - omega**2 + 1j * device.delta * omega

    def slope(here: Complexes, share: float) -> Complexes:
        force = lam * (np.roll(here, 1, axis=1) - here) - (still + 0.75 * device.beta * np.abs(here) ** 2) * here
        force[:, 0] += share * epsilon
        return np.asarray(force / damping)

    here, rise = np.zeros((len(points), device.chain_length), dtype=np.complex128), 2 * math.pi * RISE / device.delta
    looks = []
    for k in range(round((BEFORE + 2 * WINDOW) * 2 * math.pi / STEP)):
        share = float(smooth_step(np.array([(k + 0.5) * step / rise])).value[0])
        a = slope(here, share)
        b = slope(here + step / 2 * a, share)
        c = slope(here + step / 2 * b, share)
        here = here + step / 6 * (a + 2 * (b + c) + slope(here + step * c, share))
        if k % LOOK == 0:
            looks.append(np.abs(here) / device.full_scale)
    return np.array(looks)


def _rise(device: Device, point: OperatingPoint) -> Ramp:
    x = np.linspace(0.0, 1.0, 33)
    step, (rise, before) = smooth_step(x), (2 * math.pi / device.delta * np.array([RISE, BEFORE]))
    value, slope = np.append(step.value, 1.0), np.append(step.slope, 0.0) / rise * device.tau_per_s
    t_s = np.append(x * rise, before) / device.tau_per_s
    return Ramp(t_s, np.asarray(point.epsilon * value), np.asarray(point.epsilon * slope))


def _tried(device: Device, point: OperatingPoint, target: UnlockedTarget) -> OperatingPoint:
    """A setting judged by its beats in the full equations."""
    dtau = 2 * math.pi / point.omega / SAMPLES
    periods = round((BEFORE + WINDOW) / device.delta * point.omega)
    tau = np.arange(periods * SAMPLES, dtype=np.float64) * dtau
    z = play(device, point, _rise(device, point), tau)
    amplitude = np.abs(felt(z, np.exp(1j * point.omega * tau)[:, None], SAMPLES)) / device.full_scale
    window = amplitude[round(BEFORE / device.delta * point.omega) :]
    if not np.isfinite(window).all():
        return _nothing(device, target, "its beats leave the well; it lacks depth of the well")
    beats = beats_of(window, SAMPLES * dtau / device.tau_per_s)
    depth, period_s = float(beats.depth), float(beats.period_s)
    margins = Margins(
        volts=abs(point.epsilon) / device.epsilon_max, well=float(np.abs(z).max()) / device.escape_amplitude,
        slew=slew_of(device, abs(point.epsilon), point.omega),
    )  # fmt: skip
    off = float(beats_off(beats, target.depth, target.period_s))
    nearest = f"the nearest found beats {depth:.2g} deep every {period_s:.2g} s; it lacks other actuators"
    lacking = lacking_of(margins) or ("" if off <= SURE else nearest)
    n, loud = device.chain_length, (beats.loud * device.full_scale).astype(np.complex128)
    return replace(
        point, phasor=loud, mean=np.zeros(n), bias=np.zeros(n), target=beats.loud,
        margins=margins, beats=(target.depth, target.period_s), error=0.0 if off <= SURE else off * DEPTH_OFF,
        outcome=Outcome.UNREACHABLE if lacking else Outcome.OK, lacking=lacking,
    )  # fmt: skip


def _nothing(device: Device, target: UnlockedTarget, lacking: str) -> OperatingPoint:
    n = device.chain_length
    return OperatingPoint(
        target=target.levels, epsilon=0j, lam=np.full(n - 1, device.coupling.lam.min), bias=np.zeros(n), omega=1.0,
        phasor=np.zeros(n, dtype=np.complex128), mean=np.zeros(n), error=float(target.levels.max()),
        outcome=Outcome.UNREACHABLE, lacking=lacking,
    )  # fmt: skip
