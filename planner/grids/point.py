"""Operating points and ramps of a grid: its links in two directions, and a drive on each actuator that has one."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from chainsim import Device

from ..closed_forms.grid import GridLinks, transfer
from ..margins import slew_of
from ..operating_point import Margins, OperatingPoint, PointTone
from ..plan import Ramp, ToneRamp

__all__ = ["margins_of", "noise_of", "places_of", "point_tones", "ramp_of", "rest_of"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

# Points of the frequency grid on which resonances are looked for, over so many widths of a resonance to either side.
POINTS, WIDTHS = 801, 40.0


def rest_of(device: Device, target: Floats) -> OperatingPoint:
    """The grid at rest."""
    n, coupling = device.chain_length, device.coupling
    down = 0.0 if coupling.lam_y is None else coupling.lam_y.min
    return OperatingPoint(
        target=target, epsilon=0j, lam=GridLinks.alike(device, coupling.lam.min, down).flat, omega=1.0,
        bias=np.zeros(n), phasor=np.zeros(n, dtype=np.complex128), mean=np.zeros(n),
    )  # fmt: skip


def point_tones(device: Device, omega: float, epsilon: Complexes) -> tuple[PointTone, ...]:
    """The drives of all driven actuators behind the first that are not silent; `epsilon` is of shape (driven,)."""
    silent = np.zeros(device.chain_length, dtype=np.complex128)
    drives = list(zip(places_of(device), epsilon.tolist(), strict=True))[1:]
    return tuple(PointTone(omega, one, silent, side=True, place=place) for place, one in drives if one)


def places_of(device: Device) -> list[int]:
    """The driven actuators, counted row by row."""
    return [row * device.cols + col for row, col in device.driven]


def ramp_of(device: Device, omega: float, t_s: Floats, epsilon: Complexes, slope: Complexes) -> Ramp:
    """A ramp of the drives of all driven actuators, complex128, shape (driven, nodes); `slope` is per second."""
    every = zip(places_of(device), epsilon, slope, strict=True)
    tones = tuple(ToneRamp(omega, one, rise, place) for place, one, rise in every if place and one.any())
    return Ramp(t_s=t_s, epsilon=epsilon[0], epsilon_slope=slope[0], tones=tones)


def margins_of(device: Device, epsilon: Complexes, phasor: Complexes, links: GridLinks, omega: float) -> Margins:
    """How far a motion, complex128, shape (rows, cols), stays from its limits; `epsilon` of shape (driven,)."""
    strongest, size = float(np.abs(epsilon).max()), np.abs(phasor)
    return Margins(
        volts=strongest / device.epsilon_max,
        well=float(size.max()) / device.escape_amplitude,
        noise_gain=_noise_gain(device, epsilon, size, links),
        slew=slew_of(device, strongest, omega),
        multiplier=_multiplier(device, size, links, omega),
    )


def _resonances(device: Device, links: GridLinks) -> Floats:
    """Frequencies about the resonances of all stages."""
    stiffness = 1 + links.right + links.down
    low, high = np.sqrt(stiffness.min()), np.sqrt(stiffness.max())
    wide = WIDTHS * device.delta
    return np.sort(np.append(np.linspace(max(low - wide, 0.05), high + wide, POINTS), np.sqrt(np.unique(stiffness))))


def _noise_gain(device: Device, epsilon: Complexes, size: Floats, links: GridLinks) -> float:
    """As `Margins.noise_gain`, of equal parts of all drives."""
    gains = np.abs(transfer(device, links, _resonances(device, links))) * np.abs(epsilon)[:, None, None, None]
    standing = np.where(size > 0, size, np.inf)[:, :, None]
    return float((np.sqrt((gains**2).sum(axis=0)) / standing).max())


def _multiplier(device: Device, size: Floats, links: GridLinks, omega: float) -> float:
    """Modulus of the largest Floquet multiplier in the slow flow, where each actuator has two of its own."""
    bend = 0.75 * device.beta * size**2
    real = 1 - omega**2 + links.right + links.down + bend
    grows = np.sqrt(np.maximum(-real * (real + 2 * bend), 0.0))
    return float(np.exp((grows / (2 * omega) - device.delta / 2) * 2 * np.pi / omega).max())


def noise_of(device: Device, links: GridLinks) -> float:
    """Standard deviation of the worst actuator's amplitude under the noise of all drives, as `margins.noise_error`."""
    step = device.amplifier.volt_step * device.epsilon_per_volt
    added = 0.0 if device.surroundings is None else device.surroundings.amplifier_noise * device.epsilon_max
    if not (step or added):
        return 0.0
    omega = _resonances(device, links)
    rate = device.amplifier.rate_hz / device.tau_per_s
    density = (step**2 / 12 * (2 * np.sin(omega / rate / 2)) ** 4 + added**2) / (np.pi * rate)
    gain = (np.abs(transfer(device, links, omega)) ** 2).sum(axis=0)
    return float(np.sqrt(np.trapezoid(density * gain, omega, axis=-1).max()))
