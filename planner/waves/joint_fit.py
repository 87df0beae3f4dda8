"""Patterns on chains whose actuators act on each other: one drive and the links, in closed form, then fitted."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from chainsim import Device

from ..closed_forms.joint import driven, growth, sensitivity
from ..closed_forms.joint_links import links_between, links_both_ways, links_round
from ..closed_forms.wave_fit import FittedPoint, Freedom, MotionTarget, fit
from ..drive import closed
from ..operating_point import OperatingPoint
from .wave_fit import WaveFit

__all__ = ["JointFit", "with_floor"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

# Frequencies tried: evenly over the device's range, and in quarters of a width about the resonance of one actuator.
EVENLY, ABOUT = 41, np.arange(-8, 33) / 4
# One lam for all links: so many are tried, up to the strongest.
LINKS = 40
# What is fitted, the best first.
KEPT = 4
# Of amplitudes alike within this part of the largest the least sensitive is taken.
ALIKE = 1e-3
# Levels a flat dot may idle at, in units of the floor; so many flat dots are given one each, more all the same.
IDLE, MOST_IDLE = (1.0, 0.5, 0.25), 5


class _Guess(NamedTuple):
    """Settings, the motion they make in one harmonic, and how far that is from the wish, in units of it."""

    point: OperatingPoint
    away: float
    sensitive: float
    profile: int

    @property
    def rank(self) -> tuple[float, float]:
        """The smaller the better."""
        return (0.0 if self.away <= ALIKE else self.away, self.sensitive)


@dataclass(frozen=True)
class JointFit(WaveFit):
    """The task for one target on a device whose links act both ways, or whose rings have a lam on every link."""

    @cached_property
    def backwards(self) -> bool:
        """Nothing is said of directions beforehand."""
        return False

    @cached_property
    def jagged(self) -> bool:
        """Nothing is said of shapes beforehand."""
        return False

    @cached_property
    def freedom(self) -> Freedom:
        """Every link for itself where the device has it so."""
        whole = super().freedom
        each = self.device.coupling.scope == "link" and whole.lam
        return replace(whole, lam=self.device.chain_length - 1) if each else whole

    def best(self, share: float) -> FittedPoint:
        """The nearest found for `share` of the target."""
        wanted, tries = self.wanted(share), list[FittedPoint]()
        for guess in self._guessed(wanted):
            own = replace(wanted, phasor=np.where(self.phased, wanted.phasor, _like(wanted, guess.point.phasor)))
            found = fit(self.device.chain, own, guess.point, self.freedom)
            tries.append(self._rounded(found, own, self.freedom))
            if self.stands(self._least(tries, wanted)):
                break
        return self._least(tries, wanted)

    def _guessed(self, wanted: MotionTarget) -> list[_Guess]:
        if self.freedom.lam <= 1:
            found = _one_lam(self.device, wanted, self.freedom)
        elif int(np.count_nonzero(self.phased)) > 1:
            found = _phased(self.device, wanted)
        else:
            found = _by_links(self.device, np.abs(wanted.phasor)[None, :])
        found = found or _one_lam(self.device, wanted, replace(self.freedom, lam=1))
        best = sorted(found, key=lambda guess: guess.rank)[:KEPT]
        # What is not alike is fitted once: others are no nearer.
        return [guess for guess in best if guess.away <= ALIKE] or best[:1]


def _like(wanted: MotionTarget, phasor: Complexes) -> Complexes:
    """The wanted amplitudes with the phases of a motion."""
    return np.asarray(np.abs(wanted.phasor) * np.exp(1j * np.angle(phasor)))


def with_floor(device: Device, levels: Floats, contrast_db: float) -> Floats:
    """Amplitudes to hold for raised and flat dots: flat ones idle where the links hold them, at the floor at most."""
    floor = 10.0 ** (-contrast_db / 20)
    flat = np.flatnonzero(levels < floor)
    each = product(IDLE, repeat=len(flat)) if len(flat) <= MOST_IDLE else ((one,) * len(flat) for one in IDLE)
    profiles = np.array([_filled(levels, flat, np.array(idle) * floor) for idle in each])
    found = _by_links(device, profiles * device.full_scale)
    if not found:
        return np.asarray(profiles[0])
    return np.asarray(profiles[min(found, key=lambda guess: guess.rank).profile])


def _filled(levels: Floats, at: NDArray[np.intp], idle: Floats) -> Floats:
    profile = levels.copy()
    profile[at] = idle
    return profile


def _frequencies(device: Device) -> Floats:
    low, high = device.omega.min, device.omega.max
    about = 1 + device.delta * ABOUT
    return np.unique(np.concatenate([np.linspace(low, high, EVENLY), about[(about > low) & (about < high)]]))


def _by_links(device: Device, amplitude: Floats) -> list[_Guess]:
    """At every frequency the best settings whose links hold one of the profiles, shape (P, n), or come near."""
    chain, found = device.chain, list[_Guess]()
    links = links_both_ways if chain.law.both_ways else links_round
    # What is exactly still cannot be passed through.
    amplitude = np.maximum(amplitude, 1e-3 * amplitude.max(axis=1, keepdims=True))
    for omega in _frequencies(device).tolist():
        held = links(chain, amplitude, omega, device.coupling.lam.max)
        inside = (held.lam >= device.coupling.lam.min).all(axis=1) & (np.abs(held.epsilon) <= device.epsilon_max)
        held = held.part(inside)
        if not len(held.profile):
            continue
        scale = amplitude[held.profile].max(axis=1)
        away = np.abs(np.abs(held.phasor) - amplitude[held.profile]).max(axis=1) / scale
        lam = closed(chain, held.lam)
        sensitive = sensitivity(chain, lam, held.phasor, omega) / scale
        order = np.lexsort((sensitive, np.where(away <= ALIKE, 0.0, away)))[:KEPT]
        stable = order[growth(chain, lam[order], held.phasor[order], omega) < 0]
        for at in stable[:1]:
            point = OperatingPoint(complex(held.epsilon[at]), held.lam[at], omega, held.phasor[at])
            found.append(_Guess(point, float(away[at]), float(sensitive[at]), int(held.profile[at])))
    return found


def _phased(device: Device, wanted: MotionTarget) -> list[_Guess]:
    """At every frequency the links nearest to those that phasors ask for."""
    lam, found = device.coupling.lam, list[_Guess]()
    for omega in _frequencies(device).tolist():
        links, left = links_between(device.chain, wanted.phasor, omega, lam.min, lam.max)
        answer = driven(device.chain, closed(device.chain, links), np.array([omega]))[0]
        found.append(_driven_like(answer, wanted, links, omega, left))
    return found


def _one_lam(device: Device, wanted: MotionTarget, freedom: Freedom) -> list[_Guess]:
    """For every frequency and lam the drive whose small motion is nearest to the wish."""
    low, high = (freedom.lam_min, freedom.lam_max) if freedom.lam else (device.coupling.lam.min,) * 2
    omegas, found = _frequencies(device), list[_Guess]()
    for lam in np.unique(np.linspace(low, high, LINKS) ** 2 / max(high, 1e-300)).clip(low, high).tolist():
        links = np.full(device.chain_length - 1, lam)
        answers = driven(device.chain, closed(device.chain, links), omegas)
        for omega, answer in zip(omegas.tolist(), answers, strict=True):
            found.append(_driven_like(answer, wanted, links, omega, None))
    return found


def _driven_like(answer: Complexes, wanted: MotionTarget, links: Floats, omega: float, away: float | None) -> _Guess:
    """A small motion under the drive that brings it nearest to the wish."""
    goal = wanted.phasor if wanted.phased.any() else _like(wanted, answer)
    weighted = goal * wanted.weight**2
    drive = complex(np.vdot(answer, weighted) / max(float(np.sum(np.abs(answer * wanted.weight) ** 2)), 1e-300))
    left = wanted.error(drive * answer) / max(wanted.scale, 1e-300)
    point = OperatingPoint(drive, links, omega, drive * answer)
    return _Guess(point, left if away is None else max(left, away), 0.0, 0)
