"""What a change between vibrating patterns leaves behind: the full equations followed along it, from its steady begin.

Closed forms of ways know one harmonic. What they leave out rings on at the stages' own frequencies, and every stage
magnifies what rings in the stages before it.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from chainsim import Device, Outcome

from ..drive import FirstOrderHold, full_motion, links_at, samples
from ..operating_point import OperatingPoint, setting_of
from ..plan import Ramp
from .check import Orbit
from .search import ARRIVES

__all__ = ["residues_of"]

Floats = NDArray[np.float64]

# Phases of the carrier at the begin of a ramp from which all others follow: what is slow turns once with it, what is
# not turns back, and both are sums of these two.
PHASES = (0.0, math.pi / 2)
# What is left to the stages to magnify asks for more samples than ways that nothing magnifies.
SAMPLES_PER_PERIOD = 128
# Images of the carrier that count.
IMAGES = 8
# Ramps followed side by side.
TOGETHER = 8


def residues_of(
    device: Device, before: Sequence[OperatingPoint], after: Sequence[OperatingPoint], ramps: Sequence[Ramp]
) -> list[Floats]:
    """How far each ramp's end is from the motion it leads to; see `Ramp.residue`.

    Parameters
    ----------
    device : its chains are open.
    before, after : of one tone, of one frequency; either may rest.
    """
    alike: dict[float, list[int]] = defaultdict(list)
    for place, ramp in enumerate(ramps):
        alike[ramp.duration_s].append(place)
    orbits = _orbits(device, {id(one): one for one in (*before, *after)})
    found: dict[int, Floats] = {}
    for places in alike.values():
        for first in range(0, len(places), TOGETHER):
            some = places[first : first + TOGETHER]
            ways = [_Way(before[i], after[i], ramps[i], orbits[id(before[i])], orbits[id(after[i])]) for i in some]
            found.update(zip(some, _followed(device, ways), strict=True))
    return [found[place] for place in range(len(ramps))]


class _Way(NamedTuple):
    """A ramp between two motions."""

    before: OperatingPoint
    after: OperatingPoint
    ramp: Ramp
    start: Orbit
    end: Orbit


def _orbits(device: Device, points: Mapping[int, OperatingPoint]) -> dict[int, Orbit]:
    """The whole periodic motions of points: of one harmonic where there is no better, of zero where they rest."""
    from chainsim import balance_near

    found = {at: Orbit(point.phasor[None, :], point.lam, point.omega) for at, point in points.items()}
    moving = {at: point for at, point in points.items() if not point.resting}
    if moving:
        near = np.array([point.phasor for point in moving.values()])
        answer = balance_near(device.chain, setting_of(device.chain, list(moving.values())), near, tol=ARRIVES / 100)
        for (at, point), outcome, harmonics in zip(moving.items(), answer.outcome, answer.harmonics, strict=True):
            if outcome in (Outcome.OK, Outcome.UNSTABLE):
                found[at] = Orbit(harmonics, point.lam, point.omega)
    return found


def _followed(device: Device, ways: Sequence[_Way]) -> list[Floats]:
    """Of ways that last equally long."""
    omega, duration = ways[0].after.omega, ways[0].ramp.duration_s * device.tau_per_s
    # A sample lies on the end, and one behind it.
    steps = math.ceil(duration * omega / (2 * math.pi) * SAMPLES_PER_PERIOD)
    dtau = duration / steps
    tau = np.arange(steps + 2, dtype=np.float64) * dtau
    phased = [(way, phase) for way in ways for phase in PHASES]
    force = np.stack([samples(device, way.after, way.ramp, tau, phase / omega) for way, phase in phased], axis=1)
    ahead = np.stack([_ahead(device, way, dtau, phase) for way, phase in phased], axis=1)
    # The first of a chain has no link; phases of a way have the same.
    links, held = np.zeros((len(tau), len(phased), device.chain.n)), np.zeros((len(phased), device.chain.n))
    for at, way in enumerate(ways):
        both = slice(at * len(PHASES), (at + 1) * len(PHASES))
        links[:, both, 1:] = links_at(way.after, way.ramp, tau / device.tau_per_s)[:, None]
        held[both, 1:] = (way.after if way.before.resting else way.before).lam
    z = full_motion(device.chain, dtau, force, links, before=(ahead, held))[-3:]
    away = z - np.stack([way.end.at(tau[-3:] + phase / omega) for way, phase in phased], axis=1)
    away[:, :, 0] += _corners(omega * dtau) / omega**2 * force[-3:] * FirstOrderHold.of(omega, dtau).passed
    states = np.concatenate([away[1], (away[2] - away[0]) / (2 * dtau)], axis=1)
    return list(states.reshape(len(ways), len(PHASES), -1))


def _ahead(device: Device, way: _Way, dtau: float, phase: float) -> Floats:
    """Forces on every actuator that lead onto the motion before the ramp; none from rest.

    Straight lines between them take away ``(omega dtau)^2 / 12`` of every frequency, and a little more, which is given
    to them first: what is left would pass for a residue.
    """
    forces = way.start.prelude(device.chain, dtau, phase)
    further = np.zeros((2, device.chain.n))
    carrier = np.exp(1j * (phase + way.start.omega * dtau * np.arange(2)))
    further[:, 0] = (way.before.epsilon * carrier).real
    whole = np.concatenate([np.zeros_like(further), forces, further])
    bend = whole[2:] - 2 * whole[1:-1] + whole[:-2]
    turn = bend[2:] - 2 * bend[1:-1] + bend[:-2]
    return np.asarray(forces - bend[1:-1] / 12 + turn / 90)


def _corners(angle: float) -> float:
    """What corners of straight lines, `angle` radians of a carrier apart, add to a motion: this times -force/omega^2.

    The lines hold the carrier's images too, at ``2 pi k / angle -+ 1`` times its frequency and weaker by the square of
    that; an oscillator follows them by another square. In line with the carrier at every sample, they would pass for
    a residue, which later stages magnify.
    """
    image = 2 * math.pi / angle * np.arange(1, IMAGES + 1)
    return float((1 / (image - 1) ** 4 + 1 / (image + 1) ** 4).sum())
