"""At which frequency, and how fast, a device's vibrating chains can change patterns."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from chainsim import Device

from ..closed_forms.links import drive_for, links_for
from ..transitions.envelopes import change, rise
from .floor import EQUAL, LOWER, idle_profiles

__all__ = ["NODES_PER_RAMP", "Band", "choose_band"]

Floats = NDArray[np.float64]

LONGEST_RAMP_S = 0.35
CANDIDATES = 41
NODES_PER_RAMP = 251
# A rise, whose links stay as they are, needs 2 + 0.74 n beats instead: its residue is then 2e-6 of full scale or less,
# 2e-4 where six dots are alike.
RISE_SHARE = 0.87
# Half of the volts stay free for what a closed form does not know.
STEADY_SHARE = 0.5


@dataclass(frozen=True)
class Band:
    """What is common to all patterns of a device: drive frequency, ramp length, highest level of an unraised dot.

    `lower` is the deepest level of an unraised dot in units of that floor. `lacking` is empty, or one clause that
    says what the device lacks for patterns with this contrast.
    """

    omega: float
    ramp_s: float
    floor: float
    lower: float = LOWER
    lacking: str = ""

    @property
    def rise_s(self) -> float:
        """Length of a ramp from rest."""
        return RISE_SHARE * self.ramp_s


def choose_band(device: Device, contrast_db: float, chains: Sequence[Device] = ()) -> Band:
    """The highest drive frequency at which every change between on/off patterns can be made.

    Detuning buys short ramps and robustness against spread, and costs volts and reach of the links; so the
    highest frequency the device can pay for. Where dots that idle at half the floor are out of reach, all idle
    at it. A single actuator is driven likewise, and has no floor.

    Under spread it is, of all frequencies at which every change can be made, that of the least expected error.

    Parameters
    ----------
    chains : where chains have numbers of their own, each as a device (`Device.alone`), which all share the band.
    """
    floor = 0.0 if device.chain_length == 1 else 10.0 ** (-contrast_db / 20)
    lacking, every = "", (device, *chains)
    for lower in (LOWER, EQUAL):
        lacking, possible = "", list[Band]()
        probes = _probes(device, floor, lower)
        for omega in dict.fromkeys(np.linspace(device.omega.max, device.omega.min, CANDIDATES).tolist()):
            for ramp_s in _ramps_s(device, omega):
                found = next(filter(None, (_lack(one, omega, ramp_s, probes) for one in every)), "")
                if not found:
                    possible.append(Band(omega, ramp_s, floor, lower))
                    break
                lacking = lacking or found
            if possible and device.spread is None:
                return possible[0]
        if possible:
            return min(possible, key=lambda band: _expected(device, band.omega, probes))
    return Band(device.omega.max, LONGEST_RAMP_S, floor, EQUAL, lacking)


def _expected(device: Device, omega: float, probes: Floats) -> float:
    """Expected error of the closed forms for `probes` under the device's spread, in units of full scale."""
    from ..robustness.expected import expected_of

    amplitude = probes[np.any(probes > 0, axis=1)]
    lam = links_for(device.chain, amplitude, omega)
    return expected_of(device, amplitude, drive_for(device.chain, amplitude[:, 0], omega), lam, omega)


def _ramps_s(device: Device, omega: float) -> list[float]:
    """Lengths to try, of which the shorter has enough beats between drive and stage resonance to leave no residue.

    The smooth blends have little content beyond 2 + 0.9 n beats per ramp, measured under the full equations
    for n = 1 and 6; what content they have there, every further stage magnifies.
    """
    alike = np.full(device.chain_length, device.full_scale)
    links = links_for(device.chain, alike, omega)
    resonance = math.sqrt(1.0 + float(links[0])) if device.chain_length > 1 and np.isfinite(links[0]) else 1.0
    beat_hz = abs(omega - resonance) * device.f0_hz
    beats = 2.0 + 0.9 * device.chain_length
    shortest = beats / beat_hz if beat_hz else math.inf
    if device.chain_length == 1:
        shortest = min(shortest, LONGEST_RAMP_S)
    # Links that cannot follow in that time, as in short chains, may in a longer one.
    return [shortest, LONGEST_RAMP_S] if shortest < LONGEST_RAMP_S else [shortest]


def _probes(device: Device, floor: float, lower: float) -> Floats:
    """On/off profiles with every kind of step: all, none, alternating, blocks."""
    m = np.arange(device.chain_length)
    shapes = np.array([m >= 0, m < 0, m % 2 == 0, m % 2 == 1, m // 2 % 2 == 0, m // 2 % 2 == 1])
    deepest = [idle_profiles(shape.astype(np.float64), floor, lower)[-1] for shape in shapes]
    return np.asarray(deepest) * device.full_scale


def _lack(device: Device, omega: float, ramp_s: float, probes: Floats) -> str:
    """What the device lacks at `omega` for changes between `probes`, or ""."""
    if ramp_s > LONGEST_RAMP_S:
        return f"frame changes of {ramp_s:.2g} s are too slow; it lacks detuning (a higher omega.max)"
    chain, allowed = device.chain, device.coupling.lam
    links = links_for(chain, probes, omega)
    if not np.all(np.isfinite(links)):
        return "no link can make a step of that contrast; it lacks detuning (a higher omega.max)"
    if drive_for(chain, probes[:, 0], omega).max() > STEADY_SHARE * device.epsilon_max:
        return "the steady drive needs more than half of the amplifier's volts; it lacks volts"
    duration = ramp_s * device.tau_per_s
    first, second = np.nonzero(~np.eye(len(probes), dtype=bool))
    changes = change(chain, probes[first], probes[second], omega, duration, NODES_PER_RAMP // 4)
    rises = rise(chain, probes[[0, 2, 3]], omega, RISE_SHARE * duration, NODES_PER_RAMP // 4)
    if not (changes.possible.all() and rises.possible.all()):
        return "its links cannot follow a frame change; it lacks detuning (a higher omega.max)"
    lam = changes.lam
    if lam.size and (lam.min() < allowed.min or lam.max() > allowed.max):
        return f"its links must reach {lam.min():.3g}..{lam.max():.3g}; it lacks range of lam"
    if max(np.abs(changes.epsilon).max(), np.abs(rises.epsilon).max()) > device.epsilon_max:
        return "the way in needs more than the amplifier's volts; it lacks volts"
    return ""
