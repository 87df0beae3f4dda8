"""What a frame can be bought for: pattern error, time to the pattern, peak drive and robustness against each other.

Frequency, length of the way in and contrast are varied over the device's range; each candidate's closed-form settings
and way in are tried in the full equations from rest, so that the error is that of what would be felt.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from chainsim import Closure, Device
from encoders import TargetPattern

from ..amplitudes.floor import LOWER, idle_profiles
from ..closed_forms.links import detuning_gain, links_for
from ..drive import FirstOrderHold, cubic, cubic_slope, felt, full_motion
from ..operating_point import OperatingPoint
from ..transitions.envelopes import EnvelopeRamp, change, rise
from .effects import Linearisation
from .pareto_point import SIGMA, ParetoError, ParetoFront, ParetoPoint, front_of

__all__ = ["ParetoError", "ParetoFront", "ParetoPoint", "front_of", "pareto_of"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

OMEGAS, RAMPS_S = 9, (0.04, 0.06, 0.08, 0.1, 0.12, 0.15, 0.18, 0.22, 0.27, 0.33, 0.4)
CONTRASTS_DB = (12.0, 20.0, 26.0)
NODES = 251
SAMPLES_PER_PERIOD = 64
# Periods after the way in over which the pattern is looked at.
LOOKED_AT = 12
WELL_SHARE = 0.8


def pareto_of(pattern: TargetPattern, device: Device) -> ParetoFront:
    """Trade one frame on a device: amplitudes by vibration, deflections held by biases, or waves.

    Raises
    ------
    ParetoError
        When bars walk in it, nothing is felt, or the device has nothing to trade for it.
    """
    if device.actuators:
        raise ParetoError("device: its actuators were measured one by one; give the profile they were built to")
    if pattern.walking is not None:
        raise ParetoError("frame: bars that walk are two tones of one length of way; give amplitudes or a wave")
    amplitudes = np.unique(np.abs(pattern.amplitude).reshape(-1, device.chain_length), axis=0)
    wishes: Floats = amplitudes[amplitudes.any(axis=1)]
    if not len(wishes):
        raise ParetoError("frame: nothing is felt in it; give one with a raised dot")
    linked = device.coupling.scope == "link" and device.coupling.closure is Closure.OPEN
    if pattern.phase_matters and device.chain_length > 1:
        from .pareto_waves import ways_of_waves

        points, tried = ways_of_waves(pattern, device)
    elif device.bias == "actuator":
        from .pareto_still import ways_of_deflections

        points, tried = ways_of_deflections(wishes, device)
    elif linked or device.chain_length == 1:
        points, tried = _ways_of_vibrations(wishes, device)
    else:
        raise ParetoError(
            f"device: {device.name} has nothing to trade for amplitudes; give one with a bias per actuator or a lam "
            "per link, such as paper-6x6 or linked-6x6"
        )
    return ParetoFront(device.name, front_of(points), tried, tried - len(points))


def _ways_of_vibrations(wishes: Floats, device: Device) -> tuple[list[ParetoPoint], int]:
    """Those within the limits, over frequency, contrast and length, and how many were tried."""
    contrasts = CONTRASTS_DB if device.chain_length > 1 else (math.inf,)
    points: list[ParetoPoint] = []
    tried = 0
    for omega in np.linspace(device.omega.min, device.omega.max, OMEGAS):
        for made in [_Candidates.of(device, wishes, float(omega), contrast) for contrast in contrasts]:
            tried += len(RAMPS_S)
            points += made.points() if made is not None else []
    return points, tried


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
            point = OperatingPoint(complex(epsilon), lam, self.omega)
            stiffening = 0.75 * chain.beta * (target * self.device.full_scale) ** 2
            force = np.concatenate([[point.epsilon], np.zeros(chain.n - 1, np.complex128)])
            impedance = Linearisation(chain, point).impedance(self.omega, stiffening)
            point = replace(point, phasor=np.asarray(np.linalg.solve(impedance, force), np.complex128))
            worst = max(worst, float(Linearisation(chain, point).scattered(SIGMA, np.zeros(chain.n, np.bool_)).max()))
        return worst / self.device.full_scale

    def _felt(self, ways: list[EnvelopeRamp]) -> tuple[Complexes, Floats]:
        """First harmonics after each way and the largest deflection; shapes (ways, periods, P, n) and (ways,)."""
        chain, count = self.device.chain, len(self.wishes)
        dtau = 2 * math.pi / self.omega / SAMPLES_PER_PERIOD
        ends = [math.ceil(ramp_s * self.device.tau_per_s / dtau) for ramp_s in RAMPS_S]
        tau = dtau * np.arange(max(ends) + LOOKED_AT * SAMPLES_PER_PERIOD, dtype=np.float64)
        carrier = np.exp(1j * self.omega * tau)
        force, hold = np.zeros((len(tau), len(ways) * count)), FirstOrderHold.of(self.omega, dtau)
        for at, (way, ramp_s) in enumerate(zip(ways, RAMPS_S, strict=True)):
            nodes = np.linspace(0.0, ramp_s * self.device.tau_per_s, NODES)
            for p in range(count):
                drive = tau, nodes, way.epsilon[p], way.epsilon_slope[p]
                force[:, at * count + p] = (hold.raised(cubic(*drive), cubic_slope(*drive)) * carrier).real
        lam = np.tile(np.pad(self.lam, ((0, 0), (1, 0))), (len(ways), 1))
        z = full_motion(chain, dtau, force, lam).reshape(len(tau), len(ways), count, chain.n)
        after = []
        for at, end in enumerate(ends):
            late = slice(end, end + LOOKED_AT * SAMPLES_PER_PERIOD)
            after.append(felt(z[late, at], carrier[late, None, None], SAMPLES_PER_PERIOD))
        return np.array(after), np.abs(z).max(axis=(0, 2, 3))


def _quietest(device: Device, wish: Floats, floor: float, omega: float) -> Floats:
    """The profile for a wish whose unraised dots magnify disturbances least."""
    if floor == 0:
        return wish
    profiles = idle_profiles(wish, floor, LOWER)
    amplitude = profiles * device.full_scale
    gain = detuning_gain(device.chain, amplitude, links_for(device.chain, amplitude, omega), omega)
    return np.asarray(profiles[int(np.argmin(np.where(np.isfinite(gain), gain, np.inf)))])
