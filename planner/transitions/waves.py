"""Ways into waves and out of them: the quickest that is known for the device."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from chainsim import Closure, Device

from ..margins import WELL_SHARE
from ..operating_point import OperatingPoint
from ..plan import Ramp, ToneRamp
from ..waves.walking import TONES_GOOD
from ..waves.wave_fit import GOOD
from . import jets
from .fall import find_fall
from .joining import as_tone
from .limits import WayLimits
from .rise import find_way
from .slow import slow_fall, slow_rise
from .tones import quick_rise

__all__ = ["BUDGET", "enter_wave", "leave_wave", "limits_of"]

Floats = NDArray[np.float64]

# Slopes a search for a way may take, about 10 ms each.
BUDGET = 150
# Single actuators go any way that is smooth: its length in periods, its smoothness, and its nodes.
PERIODS, SMOOTHNESS, NODES = 40, 5, 161


def enter_wave(device: Device, state: OperatingPoint, moves: bool) -> Ramp:
    """From rest to a wave; `moves` where lam may differ on the way from what it is in the end."""
    if device.chain_length == 1:
        return _single(device, state, rises=True)
    lacking = ""
    if not state.tones and device.coupling.closure is Closure.OPEN:
        ramp = find_way(
            device.chain, epsilon=state.epsilon, lam=state.lam, omega=state.omega, phasor=state.phasor,
            limits=limits_of(device, moves), tau_per_s=device.tau_per_s, budget=BUDGET,
        )  # fmt: skip
        if not ramp.lacking:
            return ramp
        lacking = ramp.lacking
    ramp = slow_rise(device, state, TONES_GOOD if state.tones else GOOD)
    if state.tones and moves and device.coupling.closure is Closure.OPEN:
        quick = quick_rise(device, state, limits_of(device, moves), TONES_GOOD)
        if quick is not None and (ramp.lacking or quick.duration_s < ramp.duration_s):
            return quick
    return ramp if not (ramp.lacking and lacking) else _lacking(ramp, lacking)


def leave_wave(device: Device, state: OperatingPoint, moves: bool) -> Ramp:
    """From a wave to rest, the drive among the ramp's tones."""
    if device.chain_length == 1:
        return as_tone(_single(device, state, rises=False), state.omega)
    if state.tones or device.coupling.closure is not Closure.OPEN:
        return slow_fall(device, state, moves)
    ramp = find_fall(
        device.chain, epsilon=state.epsilon, lam=state.lam, omega=state.omega, phasor=state.phasor,
        limits=limits_of(device, moves), tau_per_s=device.tau_per_s, budget=BUDGET,
    )  # fmt: skip
    return as_tone(ramp, state.omega)


def _lacking(ramp: Ramp, lacking: str) -> Ramp:
    return Ramp(ramp.t_s, ramp.epsilon, ramp.epsilon_slope, lacking=lacking, tones=ramp.tones)


def limits_of(device: Device, moves: bool) -> WayLimits:
    """What a way may use of a device; `moves` where lam may differ on it from what it is at the ends."""
    scope: Literal["fixed", "chain", "link"] = "fixed"
    if moves:
        scope = "link" if device.coupling.scope == "link" else "chain"
    return WayLimits(
        epsilon_max=device.epsilon_max,
        lam_min=device.coupling.lam.min,
        lam_max=device.coupling.lam.max,
        lam_scope=scope,
        slew_per_s=device.amplifier.slew_v_per_s * device.epsilon_per_volt,
        well_share=WELL_SHARE,
    )


def _single(device: Device, state: OperatingPoint, *, rises: bool) -> Ramp:
    """One actuator follows a smooth step times its motion; the drive is what the equation asks for on the way.

    A tone c s(tau) takes ``(1 - omega^2 + i delta omega) c s + (2 i omega + delta) c s' + c s''`` and, of the cubic
    term, what it takes in the end times s^3.
    """
    duration = 2 * math.pi * PERIODS
    blend = jets.smoothstep(SMOOTHNESS, NODES, 4)
    s0, s1, s2, s3 = (blend[k] * math.factorial(k) * duration**-k for k in range(4))
    if not rises:
        s0, s1, s2, s3 = 1 - s0, -s1, -s2, -s3
    tones = []
    for tone in state.every_tone:
        phasor = complex(tone.phasor[0])
        stage, drag = 1 - tone.omega**2 + 1j * device.delta * tone.omega, 2j * tone.omega + device.delta
        cubic = tone.epsilon - stage * phasor
        envelope = phasor * (stage * s0 + drag * s1 + s2) + cubic * s0**3
        slope = phasor * (stage * s1 + drag * s2 + s3) + 3 * cubic * s0**2 * s1
        tones.append(ToneRamp(tone.omega, envelope, slope * device.tau_per_s))
    first, *others = tones
    t_s = np.linspace(0.0, duration / device.tau_per_s, NODES)
    return Ramp(t_s=t_s, epsilon=first.epsilon, epsilon_slope=first.epsilon_slope, tones=tuple(others))
