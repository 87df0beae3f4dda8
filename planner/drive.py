"""What a drive is between its nodes, how it is put on samples, and what a chain does under it: the only place."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from chainsim import Chain, Device

from .operating_point import OperatingPoint
from .plan import Ramp

__all__ = [
    "DriveTone", "FirstOrderHold", "SmoothStep", "closed", "cubic", "cubic_slope", "curve", "felt", "full_motion",
    "links_at", "play", "samples", "smooth_step", "tones_of",
]  # fmt: skip

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
Numbers = TypeVar("Numbers", NDArray[np.float64], NDArray[np.complex128])


class SmoothStep(NamedTuple):
    """A smooth step and its first two derivatives, float64, shape (S,)."""

    value: Floats
    slope: Floats
    bend: Floats


def smooth_step(x: Floats) -> SmoothStep:
    """The C^2 step from 0 at x <= 0 to 1 at x >= 1, ``x^3 (10 - 15 x + 6 x^2)``."""
    x = np.clip(x, 0.0, 1.0)
    return SmoothStep(x**3 * (10 - 15 * x + 6 * x**2), 30 * x**2 * (1 - x) ** 2, 60 * x * (1 - x) * (1 - 2 * x))


class _Pieces(NamedTuple):
    """Cubic Hermite in powers of s, from 0 to 1 in the piece that each instant lies in."""

    s: Floats
    width: Floats
    start: NDArray[Any]
    begin: NDArray[Any]
    square: NDArray[Any]
    cube: NDArray[Any]


def _pieces(at: Floats, nodes: Floats, values: Numbers, slopes: Numbers) -> _Pieces:
    k = np.clip(np.searchsorted(nodes, at, side="right") - 1, 0, len(nodes) - 2)
    beside = (slice(None),) + (None,) * (values.ndim - 1)
    width, rise = np.diff(nodes), np.diff(values, axis=0)
    begin, end = width[beside] * slopes[:-1], width[beside] * slopes[1:]
    # Two nodes at one time (a jump) leave no room to divide by.
    room = np.where(width > 0, width, 1.0)
    s = np.clip((at - nodes[k]) / room[k], 0.0, 1.0)
    square, cube = 3 * rise - 2 * begin - end, begin + end - 2 * rise
    return _Pieces(s[beside], room[k], values[:-1][k], begin[k], square[k], cube[k])


def cubic(at: Floats, nodes: Floats, values: Numbers, slopes: Numbers) -> Numbers:
    """Cubic Hermite curves through nodes; before the first and after the last node, that node's value.

    Parameters
    ----------
    at : float64, shape (S,).
    nodes : float64, shape (K,), K > 1, not falling; two at one place are a jump.
    values : float64 or complex128, shape (K, ...).
    slopes : the same per unit of `nodes`.

    Returns
    -------
    Of the dtype of `values`, shape (S, ...).
    """
    s, _, start, begin, square, cube = _pieces(at, nodes, values, slopes)
    smooth: Numbers = ((cube * s + square) * s + begin) * s + start
    return smooth


def curve(at: Floats, nodes: Floats, values: Numbers, slopes: Numbers | None) -> Numbers:
    """As `cubic` for values of shape (K,), K > 0; straight lines where `slopes` is None."""
    if slopes is None or len(nodes) == 1:
        straight: Numbers = np.interp(at, nodes, values)
        return straight
    return cubic(at, nodes, values, slopes)


def cubic_slope(at: Floats, nodes: Floats, values: Numbers, slopes: Numbers) -> Numbers:
    """The derivative of `cubic` for values of shape (K,); 0 from the last node on."""
    s, width, _, begin, square, cube = _pieces(at, nodes, values, slopes)
    slope: Numbers = (begin + s * (2 * square + 3 * s * cube)) / width
    return np.where(at < nodes[-1], slope, 0.0)


@dataclass(frozen=True)
class FirstOrderHold:
    """The straight lines that an amplifier, or an integrator, draws from sample to sample of a carrier.

    They pass the carrier with ``H = sinc^2(omega dtau / 2)`` and an envelope E on it as ``H E - i H' E'``; so
    ``E / H + i (H' / H^2) E'`` has to be sampled to give E back. The little that is lost otherwise (0.04 % at 135
    samples a period) a chain of resonators magnifies. Without its second part, which is the envelope's own change,
    a drive that rises comes late.

    Attributes
    ----------
    sinc : of half a sample's phase.
    tilt : H', in tau.
    """

    sinc: float
    tilt: float

    @classmethod
    def of(cls, omega: float, dtau: float) -> FirstOrderHold:
        """For a carrier at `omega` over f0 and samples every `dtau`; omega dtau < pi."""
        half = omega * dtau / 2
        sinc = math.sin(half) / half
        return cls(sinc, dtau * sinc * (half * math.cos(half) - math.sin(half)) / half**2)

    @property
    def passed(self) -> float:
        """H, what is left of the carrier."""
        return self.sinc**2

    @property
    def gain(self) -> float:
        """1/H."""
        return 1 / self.sinc**2

    @property
    def lead(self) -> float:
        """H'/H^2, in tau."""
        return self.tilt / self.sinc**4

    def raised(self, envelope: NDArray[Any], slope: NDArray[Any], tau_per_unit: float = 1.0) -> Complexes:
        """What has to be sampled in place of a complex envelope, whose `slope` is per unit of so much tau."""
        return np.asarray(self.gain * envelope + 1j * (self.lead / tau_per_unit) * slope)


@dataclass(frozen=True)
class DriveTone:
    """One tone of a drive on a ramp, and after it.

    Attributes
    ----------
    omega : over f0.
    held : its phasor after the ramp.
    end_s : the ramp's length, -inf without one.
    t_s, values, slopes : its nodes, as in `Ramp`; None where it is silent on the ramp, or its lines are straight.
    """

    omega: float
    held: complex
    end_s: float = -math.inf
    t_s: Floats | None = None
    values: Complexes | None = None
    slopes: Complexes | None = None

    def on_ramp(self, t_s: Floats, hold: FirstOrderHold, tau_per_s: float) -> Complexes | None:
        """What is sampled of the envelope at instants of the ramp, seconds from its start; None where it is silent."""
        if self.t_s is None or self.values is None or not len(t_s):
            return None
        envelope = curve(t_s, self.t_s, self.values, self.slopes)
        if self.slopes is None:
            return hold.gain * envelope
        # Slopes are taken straight from node to node: they are only there for what the hold takes away.
        return hold.raised(envelope, np.interp(t_s, self.t_s, self.slopes), tau_per_s)


def tones_of(point: OperatingPoint, ramp: Ramp | None, place: int = 0) -> Iterator[DriveTone]:
    """The tones that sound on a ramp or at the point it leads to, each frequency once.

    `place` : of the actuator that is driven, as in `PointTone`.
    """
    held = {tone.omega: tone.epsilon for tone in point.every_tone if tone.place == place}
    way: dict[float, tuple[Complexes | None, Complexes | None]] = {}
    if ramp is not None:
        way = {} if place else {point.omega: (ramp.epsilon, ramp.epsilon_slope)}
        way |= {tone.omega: (tone.epsilon, tone.epsilon_slope) for tone in ramp.tones if tone.place == place}
    end_s, t_s = (-math.inf, None) if ramp is None else (ramp.duration_s, ramp.t_s)
    for omega in dict.fromkeys([*held, *way]):
        tone = DriveTone(omega, held.get(omega, 0j), end_s, t_s, *way.get(omega, (None, None)))
        if tone.held or tone.values is not None:
            yield tone


def samples(
    device: Device, point: OperatingPoint, ramp: Ramp | None, tau: Floats, start: float = 0.0, place: int = 0
) -> Floats:
    """The drive's force at evenly spaced samples, such that straight lines between them pass what is meant.

    Parameters
    ----------
    tau : float64, shape (S,), S > 1, from the start of the ramp.
    start : of the ramp, tau from that of the whole plan.
    place : of the actuator that is driven, as in `PointTone`.

    Returns
    -------
    float64, shape (S,), dimensionless.
    """
    tau_per_s, dtau = device.tau_per_s, float(tau[1] - tau[0])
    force, t_s = np.zeros(len(tau)), tau / tau_per_s
    for tone in tones_of(point, ramp, place):
        hold, end = FirstOrderHold.of(tone.omega, dtau), int(np.searchsorted(t_s, tone.end_s))
        envelope = np.full(len(tau), hold.gain * tone.held)
        rising = tone.on_ramp(t_s[:end], hold, tau_per_s)
        envelope[:end] = 0j if rising is None else rising
        force += (envelope * np.exp(1j * tone.omega * (start + tau))).real
    return force


def links_at(point: OperatingPoint, ramp: Ramp | None, t_s: Floats, *, before: bool = False) -> Floats:
    """The links at instants from the start of a ramp, float64, shape (S, n-1); `before`: ahead of a jump there."""
    links = np.repeat(point.lam[None, :], len(t_s), axis=0)
    if ramp is not None and ramp.lam is not None and ramp.lam_t_s is not None:
        last = ramp.lam_t_s[-1]
        moving = t_s <= last if before else t_s < last
        for link, course in enumerate(ramp.lam.T):
            links[moving, link] = np.interp(t_s[moving], ramp.lam_t_s, course)
    return links


def play(
    device: Device, point: OperatingPoint, ramp: Ramp, tau: Floats, *, start: float = 0.0,
    ahead: tuple[Floats, Floats] | None = None,
) -> Floats:  # fmt: skip
    """The motion of a chain on a ramp and at the point it leads to, in the full equations.

    Parameters
    ----------
    tau, start : as in `samples`.
    ahead : forces on every actuator that come before, float64, shape (Q, n), and the links under them, shape (n-1,);
        None from rest.

    Returns
    -------
    Displacements, float64, shape (S, n), dimensionless.
    """
    chain, force = device.chain, samples(device, point, ramp, tau, start)[:, None]
    # Links that stay are given once.
    links = point.lam[None, :] if ramp.lam is None else links_at(point, ramp, tau / device.tau_per_s)
    lam = closed(chain, links)[:, None]
    before = None if ahead is None else (ahead[0][:, None], closed(chain, ahead[1]))
    return full_motion(chain, float(tau[1] - tau[0]), force, lam, before=before)[:, 0]


def closed(chain: Chain, links: Floats) -> Floats:
    """Links of shape (..., n-1) with the one into the first actuator: like the next in a ring, none otherwise."""
    first = links[..., :1] if chain.law.closed else np.zeros((*links.shape[:-1], 1))
    return np.concatenate([first, links], axis=-1)


def full_motion(
    chain: Chain, dtau: float, force: Floats, lam: Floats, *, before: tuple[Floats, Floats] | None = None
) -> Floats:
    """The motion of P equal chains in the full equations, from rest; all is straight between samples.

    Parameters
    ----------
    force : float64, shape (S, P), on the first actuator of each at samples every `dtau`.
    lam : float64, shape (n,) or one that fits (S, P, n), the links; the first closes a ring and is 0 otherwise.
    before : forces on every actuator ahead of these, float64, shape (Q, P, n), and the links under them, shape (n,) or
        (P, n).

    Returns
    -------
    Displacements, float64, shape (S, P, n), dimensionless.
    """
    from chainsim import GridIntegrator

    steps, count = force.shape
    grid = GridIntegrator(
        shape=(count, chain.n), chain_length=chain.n, delta=chain.deltas, beta=chain.betas, stiffness=chain.stiffness,
        ring=chain.law.closed, both_ways=chain.law.both_ways, dtau=dtau,
    )  # fmt: skip
    if before is not None:
        forces, links = before
        grid.advance(forces, np.broadcast_to(links, (count, chain.n)))
    drives = np.zeros((steps, count, chain.n))
    drives[:, :, 0] = force
    shape = drives.shape if lam.ndim == 3 else drives.shape[1:]
    return grid.advance(drives, np.ascontiguousarray(np.broadcast_to(lam, shape)))


def felt(z: Floats, carrier: Complexes, samples: int) -> Complexes:
    """First harmonics in every period of a motion.

    Parameters
    ----------
    z : float64, shape (periods * samples, ...).
    carrier : complex128, ``e^{i omega tau}``, which fits `z`.

    Returns
    -------
    complex128, shape (periods, ...).
    """
    turned = z * np.conj(carrier)
    return np.asarray(2 * turned.reshape(-1, samples, *turned.shape[1:]).mean(axis=1))
