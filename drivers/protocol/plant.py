"""A grid as it truly is: the hidden numbers of a plant file, integrated under the very samples that go out."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from chainsim import AsBuilt, Device, Play, SampledGrid
from planner import Measured

from ..channels import channels_of
from .felt import FeltGrid, VoltForces, nominal_per_volt
from .plant_file import Fingertip, PlantError, PlantFile
from .playout import OutputBlock

__all__ = ["Sensors", "TruePlant", "true_factors"]

Floats = NDArray[np.float64]

NUMBERS = ("frequency", "damping", "beta", "lam", "force")
LEAST_FACTOR = 0.1
# Noise of a change over that of a harmonic, by the window's slope and its weight.
CHANGE_NOISE = 3.6
STEP = 64  # played samples for which stiffness and damping stay as they are


def true_factors(plant: PlantFile, device: Device) -> dict[str, Floats]:
    """What each actuator is over what the profile says, by number; float64, shape (rows, cols) each."""
    normal = np.random.default_rng(plant.seed).standard_normal((len(NUMBERS), device.rows, device.cols))
    spread = np.array([getattr(plant.spread, name) for name in NUMBERS])
    factors = np.maximum(1 + spread[:, None, None] * normal, LEAST_FACTOR)
    for one in plant.actuators:
        for number, name in enumerate(NUMBERS):
            given = getattr(one, name)
            if given is not None:
                factors[number, one.row, one.col] = given
    return dict(zip(NUMBERS, factors, strict=True))


class _Touch(NamedTuple):
    """A fingertip in samples; `stop` is infinite where it stays."""

    start: float
    stop: float
    finger: Fingertip


class TruePlant:
    """The motion of a plant under what a controller puts out.

    The full equations are integrated from sample to sample, with hysteresis and creep; a settled state for each frame
    would have no memory of the frame before. Warming and fingertips go by the seconds played since the plant was made,
    so that they do not depend on when a host came.

    Parameters
    ----------
    plant : its file.
    device : what the profile says, actuators that were measured included.
    rate_hz : samples per true second.
    """

    def __init__(self, plant: PlantFile, device: Device, rate_hz: float) -> None:
        if device.chain.law.both_ways:
            raise PlantError(f"{device.name}: a plant has links that act one way, not such as these; leave --plant out")
        built, factors = AsBuilt(device), true_factors(plant, device)
        shape, drawn = (device.rows, device.cols), factors["force"]
        per_volt = nominal_per_volt(device)
        per_volt *= [drawn[channel.row, channel.col or 0] for channel in channels_of(device)]
        lam_gain = np.broadcast_to(built.lam_gain * factors["lam"], shape)
        self._forces = VoltForces(device, per_volt, lam_gain)
        self._stiffness = np.broadcast_to(built.stiffness * factors["frequency"] ** 2, shape)
        self._delta = np.broadcast_to(built.delta * factors["damping"], shape)
        self._warming, self._rate_hz = plant.warming, rate_hz
        self._touches = [_touch(finger, rate_hz) for finger in plant.fingertips]
        self._played = 0
        # No more than all fingertips at once and the whole of the warming.
        pressed = sum(finger.stiffness for finger in plant.fingertips)
        warmed = 1 + max(0.0, 0.0 if plant.warming is None else plant.warming.stiffness)
        hysteresis = None if plant.hysteresis is None else plant.hysteresis.built()
        assert hysteresis is None or isinstance(hysteresis, Play)
        self._grid = SampledGrid(
            shape=shape, chain_length=device.chain_length, beta=built.beta * factors["beta"],
            ring=device.chain.law.closed, dtau=device.tau_per_s / rate_hz,
            stiffest=float(self._stiffness.max()) * warmed + pressed + 2 * device.coupling.lam.max * lam_gain.max(),
            hysteresis=hysteresis, creep=None if plant.creep is None else plant.creep.built(),
        )  # fmt: skip

    def move(self, block: OutputBlock) -> Floats:
        """Move through the samples of `block`; z at them, float64, shape (S, rows, cols)."""
        force, lam = self._forces.force(block), self._forces.lam(block)
        parts, at = [], 0
        while at < len(force):
            count = min(len(force) - at, STEP - self._played % STEP) if block.live else len(force)
            stiffness, delta = self._now(self._played // STEP * STEP)
            part = slice(at, at + count)
            parts.append(self._grid.advance(force[part], lam[part], stiffness=stiffness, delta=delta))
            at += count
            self._played += count if block.live else 0
        return np.concatenate(parts)

    def _now(self, played: int) -> tuple[Floats, Floats]:
        """Stiffness and damping of every actuator after so many samples."""
        stiffness, delta = self._stiffness.copy(), self._delta.copy()
        if self._warming is not None:
            stiffness *= 1 + self._warming.stiffness * -math.expm1(-played / self._rate_hz / self._warming.time_s)
        for start, stop, finger in self._touches:
            if start <= played < stop:
                stiffness[finger.row, finger.col] += finger.stiffness
                delta[finger.row, finger.col] += finger.damping
        return stiffness, delta


def _touch(finger: Fingertip, rate_hz: float) -> _Touch:
    stop = math.inf if finger.to_s is None else finger.to_s * rate_hz
    return _Touch(finger.from_s * rate_hz, stop, finger)


class Sensors:
    """What the actuators of a plant sense of themselves, and of their neighbours; and how noisily that is read.

    Parameters
    ----------
    plant : its file.
    device : for its full scale.
    felt : the grid that moves.
    """

    def __init__(self, plant: PlantFile, device: Device, felt: FeltGrid) -> None:
        self._felt = felt
        self._share = plant.sensors.cross_talk
        self._noise = plant.sensors.noise * device.full_scale
        self._random = np.random.default_rng((plant.seed, 1))

    def sense(self, block: OutputBlock) -> Floats:
        """Move through what goes out; z as it is sensed, float64, shape (S, rows, cols)."""
        z = self._felt.take(block)
        if not self._share:
            return z
        sensed = z.copy()
        sensed[:, 1:] += self._share * z[:, :-1]
        sensed[:, :-1] += self._share * z[:, 1:]
        sensed[:, :, 1:] += self._share * z[:, :, :-1]
        sensed[:, :, :-1] += self._share * z[:, :, 1:]
        return sensed

    def read(self, measured: Measured) -> Measured:
        """The same with the noise of the reading, drawn anew each time."""
        mean, real, imaginary, *both = self._noise * self._random.standard_normal((5, len(measured.mean)))
        change = None if measured.change is None else measured.change + CHANGE_NOISE * (both[0] + 1j * both[1])
        harmonic = measured.harmonic + (real + 1j * imaginary)
        return Measured(measured.frame, measured.mean + mean, harmonic, change, measured.rest)
