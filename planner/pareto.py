"""What a frame can be bought for: pattern error, time to the pattern, peak drive and robustness against each other.

Frequency, length of the way in and contrast are varied over the device's range; each candidate's closed-form settings
and way in are tried in the full equations from rest, so that the error is that of what would be felt.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chainsim import Closure, Device, GridIntegrator
from encoders import TargetPattern

from .effects import Line, StandingChain
from .envelopes import EnvelopeRamp, change, rise
from .errors import PlanError
from .floor import LOWER, idle_profiles
from .links import detuning_gain, links_for
from .spread import Spread
from .way_check import Way

__all__ = ["ParetoError", "ParetoFront", "ParetoPoint", "front_of", "pareto_of"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

OMEGAS, RAMPS_S = 9, (0.04, 0.06, 0.08, 0.1, 0.12, 0.15, 0.18, 0.22, 0.27, 0.33, 0.4)
CONTRASTS_DB = (12.0, 20.0, 26.0)
NODES = 251
SAMPLES_PER_PERIOD = 64
# Periods after the way in over which the pattern is looked at.
LOOKED_AT = 12
SIGMA = Spread(f0=0.01)
# Differences below this share, or this size (time, drive, error, spread, gain), are none: a front of measured numbers
# would otherwise keep everything.
ALIKE = 0.02
RESOLUTION = np.array([0.0, 1e-3, 1e-3, 1e-3, 0.0])
WELL_SHARE = 0.8


class ParetoError(PlanError, ValueError):
    """A frame cannot be traded.

    Examples: a wave, whose phases fix the frequency; a device of one lam per chain; nothing that is felt.
    """


@dataclass(frozen=True)
class ParetoPoint:
    """One way to make a frame.

    Attributes
    ----------
    omega : drive frequency over f0. ramp_s : length of the way in.
    contrast_db : of raised and unraised dots; infinite where unraised ones rest.
    error : worst deviation from the wish after the way in, unraised dots included, in units of full scale.
    made : the same from what the settings were made for, with the unraised dots at their level.
    drive : peak of the drive on the way and after it, over the amplifier's. noise_gain : as in `Margins`.
    spread : deviation that 1 % spread (1 sigma) of the natural frequencies makes at the worst actuator, full scale.
    """

    omega: float
    ramp_s: float
    contrast_db: float
    error: float
    made: float
    drive: float
    noise_gain: float
    spread: float

    def as_dict(self) -> dict[str, Any]:
        """Plain JSON types; null where not finite."""
        return {name: value if math.isfinite(value) else None for name, value in vars(self).items()}


@dataclass(frozen=True)
class ParetoFront:
    """The points no other beats in everything, the quickest first, of `tried`; `unfit` were beyond the limits."""

    device: str
    points: tuple[ParetoPoint, ...]
    tried: int
    unfit: int

    def as_dict(self) -> dict[str, Any]:
        """Plain JSON types."""
        return {
            "device": self.device, "tried": self.tried, "unfit": self.unfit,
            "points": [point.as_dict() for point in self.points],
        }  # fmt: skip


def front_of(points: Sequence[ParetoPoint]) -> tuple[ParetoPoint, ...]:
    """Those that none is as good as in everything, but for `ALIKE` and `RESOLUTION`; the quickest first."""
    # In this order no later point can be better in everything than an earlier one.
    costs = sorted(
        ((one.ramp_s, one.drive, one.error, one.spread, one.noise_gain), at) for at, one in enumerate(points)
    )
    kept: list[tuple[Floats, int]] = []
    for cost, at in costs:
        here = (1 + ALIKE) * np.array(cost) + RESOLUTION
        if not any(np.all(other <= here) for other, _ in kept):
            kept.append((np.array(cost), at))
    return tuple(points[at] for _, at in kept)


def pareto_of(pattern: TargetPattern, device: Device) -> ParetoFront:
    """Trade one frame of amplitudes on a device of programmable links, or of actuators on their own.

    Raises
    ------
    ParetoError
        When the frame's phases matter, the device has no lam per link, or nothing is felt.
    """
    wishes = _wishes(pattern, device)
    contrasts = CONTRASTS_DB if device.chain_length > 1 else (math.inf,)
    points: list[ParetoPoint] = []
    tried = 0
    for omega in np.linspace(device.omega.min, device.omega.max, OMEGAS):
        made = [_Candidates.of(device, wishes, float(omega), contrast) for contrast in contrasts]
        for one in made:
            tried += len(RAMPS_S)
            points += one.points() if one is not None else []
    return ParetoFront(device.name, front_of(points), tried, tried - len(points))


def _wishes(pattern: TargetPattern, device: Device) -> Floats:
    """Distinct amplitudes wished of chains that are not to rest; float64, shape (P, n)."""
    if pattern.phase_matters or pattern.walking is not None:
        raise ParetoError("frame: its phases are part of the wish and fix the frequency; give a frame of amplitudes")
    linked = device.coupling.scope == "link" and device.coupling.closure is Closure.OPEN
    if not (linked or device.chain_length == 1) or device.bias == "actuator":
        raise ParetoError(
            f"device: {device.name} has nothing to trade for amplitudes; give one with a lam per link and no bias, "
            "such as linked-6x6"
        )
    wishes = np.unique(np.abs(pattern.amplitude).reshape(-1, device.chain_length), axis=0)
    wishes = wishes[wishes.any(axis=1)]
    if not len(wishes):
        raise ParetoError("frame: nothing is felt in it; give one with a raised dot")
    return np.asarray(wishes)


@dataclass(frozen=True)
class _Candidates:
    """Settings for all chains at one frequency and contrast; ways of all lengths are tried with them."""

    device: Device
    wishes: Floats
    omega: float
    contrast_db: float
    target: Floats
    lam: Floats
    noise_gain: float

    @classmethod
    def of(cls, device: Device, wishes: Floats, omega: float, contrast_db: float) -> _Candidates | None:
        """None where no links of the device hold a wish."""
        floor = 10.0 ** (-contrast_db / 20)
        target = np.array([_quietest(device, wish, floor, omega) for wish in wishes])
        amplitude = target * device.full_scale
        lam = links_for(device.chain, amplitude, omega)
        allowed = device.coupling.lam
        if not np.isfinite(lam).all() or (lam.size and not allowed.min <= lam.min() <= lam.max() <= allowed.max):
            return None
        gain = float(detuning_gain(device.chain, amplitude, lam, omega).max())
        return cls(device, wishes, omega, contrast_db, target, lam, gain)

    def points(self) -> list[ParetoPoint]:
        """One for each length of way that the amplifier and the well allow."""
        ways = [self._ramp(ramp_s) for ramp_s in RAMPS_S]
        felt, peak = self._felt(ways)
        found = []
        for ramp_s, way, amplitude, highest in zip(RAMPS_S, ways, felt, peak, strict=True):
            drive = float(np.abs(way.epsilon).max()) / self.device.epsilon_max
            inside = highest <= WELL_SHARE * self.device.escape_amplitude
            if drive > 1 or not inside or not np.isfinite(amplitude).all():
                continue
            level = np.abs(amplitude) / self.device.full_scale
            error, made = (float(np.abs(level - wanted[None]).max()) for wanted in (self.wishes, self.target))
            costs = error, made, drive, self.noise_gain, self._scatter(way)
            found.append(ParetoPoint(self.omega, ramp_s, self.contrast_db, *costs))
        return found

    def _ramp(self, ramp_s: float) -> EnvelopeRamp:
        amplitude, duration = self.target * self.device.full_scale, ramp_s * self.device.tau_per_s
        if self.device.chain_length == 1:
            return change(self.device.chain, np.zeros_like(amplitude), amplitude, self.omega, duration, NODES)
        return rise(self.device.chain, amplitude, self.omega, duration, NODES)

    def _scatter(self, way: EnvelopeRamp) -> float:
        chain, worst = self.device.chain, 0.0
        for target, epsilon, lam in zip(self.target, way.epsilon[:, -1], self.lam, strict=True):
            drive, bias = complex(epsilon), np.zeros(chain.n)
            links, nowhere = np.concatenate([[0.0], lam]), np.zeros(chain.n, np.complex128)
            stiffening = 0.75 * chain.beta * (target * self.device.full_scale) ** 2
            silent = StandingChain(chain, links, bias, (Line(self.omega, drive, nowhere),))
            force = np.concatenate([[drive], nowhere[1:]])
            phasor = np.asarray(np.linalg.solve(silent.impedance(self.omega, stiffening), force), np.complex128)
            standing = StandingChain(chain, links, bias, (Line(self.omega, drive, phasor),))
            worst = max(worst, float(standing.scattered(SIGMA, np.zeros(chain.n, np.bool_)).max()))
        return worst / self.device.full_scale

    def _felt(self, ways: list[EnvelopeRamp]) -> tuple[Complexes, Floats]:
        """First harmonics after each way and the largest deflection; shapes (ways, periods, P, n) and (ways,)."""
        chain, count = self.device.chain, len(self.wishes)
        dtau = 2 * math.pi / self.omega / SAMPLES_PER_PERIOD
        ends = [math.ceil(ramp_s * self.device.tau_per_s / dtau) for ramp_s in RAMPS_S]
        tau = dtau * np.arange(max(ends) + LOOKED_AT * SAMPLES_PER_PERIOD, dtype=np.float64)
        carrier = np.exp(1j * self.omega * tau)
        force = np.zeros((len(tau), len(ways) * count, chain.n))
        for at, (way, ramp_s) in enumerate(zip(ways, RAMPS_S, strict=True)):
            nodes = np.linspace(0.0, ramp_s * self.device.tau_per_s, NODES)
            for p in range(count):
                lone = Way(nodes, way.epsilon[p], way.epsilon_slope[p], np.zeros(1), np.zeros((1, 0)))
                force[:, at * count + p, 0] = held_between(*lone.drive(tau), carrier, self.omega * dtau, dtau)
        lam = np.tile(np.pad(self.lam, ((0, 0), (1, 0))), (len(ways), 1))
        grid = GridIntegrator(
            shape=lam.shape, chain_length=chain.n, delta=chain.delta, beta=chain.beta, ring=False, dtau=dtau
        )  # fmt: skip
        z = grid.advance(force, lam).reshape(len(tau), len(ways), count, chain.n)
        felt = []
        for at, end in enumerate(ends):
            late = slice(end, end + LOOKED_AT * SAMPLES_PER_PERIOD)
            turned = z[late, at] * carrier[late, None, None].conj()
            felt.append(2 * turned.reshape(LOOKED_AT, SAMPLES_PER_PERIOD, count, chain.n).mean(axis=1))
        return np.array(felt), np.abs(z).max(axis=(0, 2, 3))


def _quietest(device: Device, wish: Floats, floor: float, omega: float) -> Floats:
    """The profile for a wish whose unraised dots magnify disturbances least."""
    if floor == 0:
        return wish
    profiles = idle_profiles(wish, floor, LOWER)
    amplitude = profiles * device.full_scale
    gain = detuning_gain(device.chain, amplitude, links_for(device.chain, amplitude, omega), omega)
    return np.asarray(profiles[int(np.argmin(np.where(np.isfinite(gain), gain, np.inf)))])


def held_between(value: Complexes, slope: Complexes, carrier: Complexes, turn: float, dtau: float) -> Floats:
    """Samples whose straight connections are the envelope on its carrier (they pass it with sinc^2 of half a turn)."""
    half = turn / 2
    sinc = math.sin(half) / half
    tilt = dtau * sinc * (half * math.cos(half) - math.sin(half)) / half**2
    return np.asarray(((value / sinc**2 + 1j * slope * tilt / sinc**4) * carrier).real)
