"""Ways into waves and out of them: the quickest that is known for the device."""

from __future__ import annotations

from typing import Literal

from chainsim import Closure, Device

from ..margins import WELL_SHARE
from ..operating_point import OperatingPoint
from ..plan import Ramp
from .fall import find_fall
from .flat_way import flat_fall, flat_rise
from .joining import as_tone
from .limits import WayLimits
from .rise import find_way
from .search import STRONG
from .slow import slow_fall, slow_rise
from .tones import quick_rise

__all__ = ["BUDGET", "enter_tones", "enter_wave", "leave_wave", "limits_of"]

# Slopes a search for a way may take, about 10 ms each.
BUDGET = 150


def enter_wave(device: Device, point: OperatingPoint, moves: bool, tolerance: float) -> Ramp:
    """From rest to a wave of one tone.

    Parameters
    ----------
    moves : where lam may differ on the way from what it is in the end.
    tolerance : of what is waited for where no quick way is found, relative to the largest amplitude.
    """
    if device.chain.spread is not None:
        return slow_rise(device, point, tolerance)
    if _flat(device):
        flat = flat_rise(device, point, limits_of(device, moves))
        if flat is not None or float(point.lam.max(initial=0.0)) > STRONG:
            return slow_rise(device, point, tolerance) if flat is None else flat
    quick = find_way(
        device.chain, epsilon=point.epsilon, lam=point.lam, omega=point.omega, phasor=point.phasor,
        limits=limits_of(device, moves), tau_per_s=device.tau_per_s, budget=BUDGET,
    )  # fmt: skip
    if not quick.lacking:
        return quick
    ramp = slow_rise(device, point, tolerance)
    return _lacking(ramp, quick.lacking) if ramp.lacking else ramp


def leave_wave(device: Device, point: OperatingPoint, moves: bool) -> Ramp:
    """From a wave of one tone to rest, the drive among the ramp's tones."""
    if device.chain.spread is not None:
        return slow_fall(device, point, moves)
    if _flat(device):
        flat = flat_fall(device, point, limits_of(device, moves))
        if flat is not None or float(point.lam.max(initial=0.0)) > STRONG:
            return slow_fall(device, point, moves) if flat is None else as_tone(flat, point.omega)
    ramp = find_fall(
        device.chain, epsilon=point.epsilon, lam=point.lam, omega=point.omega, phasor=point.phasor,
        limits=limits_of(device, moves), tau_per_s=device.tau_per_s, budget=BUDGET,
    )  # fmt: skip
    return as_tone(ramp, point.omega)


def _flat(device: Device) -> bool:
    """Whether links may be strong in a chain whose actuators act on each other."""
    return device.chain.law.both_ways or (device.chain.law.closed and device.coupling.scope == "link")


def enter_tones(device: Device, point: OperatingPoint, moves: bool, tolerance: float) -> Ramp:
    """From rest to a wave of several tones; as `enter_wave`."""
    ramp = slow_rise(device, point, tolerance)
    if moves and device.coupling.closure is Closure.OPEN:
        quick = quick_rise(device, point, limits_of(device, moves), tolerance)
        if quick is not None and (ramp.lacking or quick.duration_s < ramp.duration_s):
            return quick
    return ramp


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
