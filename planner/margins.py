"""How far a vibration stays from what it must not reach, and what the noise of its amplifier does to it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from chainsim import Chain, Device, Response

from .closed_forms.links import stages
from .drive import closed
from .operating_point import Margins, OperatingPoint

__all__ = ["WELL_SHARE", "lacking_of", "noise_error", "slew_of", "well_of"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

# Largest share of the hilltop amplitude that is planned for: the escape margin is the rest.
WELL_SHARE = 0.8
# Points of the frequency grid on which noise is summed up, over so many widths of a resonance to either side.
POINTS, WIDTHS = 801, 40.0


def well_of(device: Device, response: Response) -> float:
    """Largest deflection, its harmonics in line, over the hilltop; 0 unless beta < 0."""
    return float(np.abs(response.harmonics[0]).sum(axis=0).max()) / device.escape_amplitude


def slew_of(device: Device, epsilon: float, omega: float) -> float:
    """Fastest change of a steady drive over the amplifier's slew."""
    return epsilon / device.epsilon_per_volt * omega * device.tau_per_s / device.amplifier.slew_v_per_s


def lacking_of(margins: Margins) -> str:
    """What a state takes too much of, one clause; "" when nothing."""
    if margins.volts > 1:
        return f"it takes {100 * margins.volts:.0f} % of the amplifier's volts; it lacks volts"
    if margins.slew > 1:
        return f"it takes {100 * margins.slew:.0f} % of the amplifier's slew; it lacks slew"
    if margins.well > WELL_SHARE:
        share = f"{100 * margins.well:.0f} % of the way to the softening well's edge"
        return f"it goes {share}, {100 * WELL_SHARE:.0f} % are allowed; it lacks depth of the well"
    return ""


def noise_error(device: Device, point: OperatingPoint, *, rounding: bool = True) -> float:
    """Standard deviation of the worst actuator's amplitude under the noise of the amplifier, dimensionless.

    That is what it adds itself (`surroundings.amplifier_noise`), spread evenly, and with `rounding` what its converter
    rounds: noise of step^2/12, spread up to half the rate as |2 sin(omega dtau / 2)|^4 (second-order error feedback,
    `drivers.Waveform`). Small motions pass both on stage by stage.
    """
    step = device.amplifier.volt_step * device.epsilon_per_volt if rounding else 0.0
    added = 0.0 if device.surroundings is None else device.surroundings.amplifier_noise * device.epsilon_max
    if not (step or added):
        return 0.0
    chain, lam = device.chain, closed(device.chain, point.lam)
    own, law = stages(chain), chain.law
    # Links both ways stiffen an actuator up to twice more, where its neighbours move against it.
    stiffest = own.stiffness + (4 * lam if law.both_ways else lam)
    low, high = float(np.sqrt(np.min(own.stiffness if law.both_ways else stiffest))), float(np.sqrt(np.max(stiffest)))
    omega = np.linspace(max(low - WIDTHS * device.delta, 0.05), high + WIDTHS * device.delta, POINTS)
    gain = np.abs(_passed_on(chain, lam, omega)) ** 2
    rate = device.amplifier.rate_hz / device.tau_per_s
    density = (step**2 / 12 * (2 * np.sin(omega / rate / 2)) ** 4 + added**2) / (np.pi * rate)
    return float(np.sqrt(np.trapezoid(density * gain, omega, axis=1).max()))


def _passed_on(chain: Chain, lam: Floats, omega: Floats) -> Complexes:
    """Small motions under a unit force on the first, stage by stage; round a ring over and over. complex128, (n, W)."""
    if chain.law.both_ways:
        # Imported here: most chains act one way.
        from .closed_forms.joint import driven

        return driven(chain, lam, omega).T
    own = stages(chain)
    stage = (own.stiffness + lam)[:, None] - omega**2 + 1j * np.multiply.outer(own.delta, omega)
    forward = np.concatenate([[1.0], lam[1:]])
    gain = np.cumprod(forward[:, None] / stage, axis=0)
    return np.asarray(gain / (1 - np.prod(lam[:, None] / stage, axis=0)) if chain.law.closed else gain)
