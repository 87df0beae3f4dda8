"""What one chain holds for bars that walk."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from chainsim import Device, Outcome

from ..closed_forms.links import detuning_gain
from ..family import RisingFamily
from ..margins import lacking_of, slew_of
from ..operating_point import Margins, OperatingPoint, PointTone
from ..plan import Ramp
from ..targets import ChainTarget, WalkingTarget
from ..transitions.slow import slow_fall
from ..transitions.waves import enter_tones
from .two_tones import MAIN, ORDERS, TwoToneWave, apart, two_tones

__all__ = ["TONES_GOOD", "Walks", "walking_rate_hz", "walking_state"]

Floats = NDArray[np.float64]

# What is asked of tones, relative to each: their combinations are only modelled in the slow flow.
TONES_GOOD = 5e-3
SIDE = [k not in (MAIN, MAIN + 1) for k in range(len(ORDERS))]
# Halvings in the search for the largest amplitude that has an answer; relative deviation of a width or rate that is the
# same, and how often and how well the width is fitted to a rate.
HALVINGS, SAME, FITS, FITTED = 5, 0.02, 20, 1e-6
# In such steps, and so many of them, a quicker rate is looked for that has an answer.
FASTER, FASTER_TRIES = 1.1, 40
# Bars narrower than this have tones at lags of nearly 0 and 180 degrees, beyond any lam.
NARROWEST = 1.01


class Walks(RisingFamily):
    """Two tones under one lam."""

    def points(self, targets: Sequence[ChainTarget]) -> list[OperatingPoint]:
        """One by one."""
        return [walking_state(self.device, target) for target in targets if isinstance(target, WalkingTarget)]

    def enter(self, point: OperatingPoint, moves: bool) -> Ramp:
        """The slow way, or over strong links."""
        return enter_tones(self.device, point, moves, TONES_GOOD)

    def leave(self, point: OperatingPoint, moves: bool) -> Ramp:
        """The drive is taken away."""
        return slow_fall(self.device, point, moves)


def walking_state(device: Device, target: WalkingTarget) -> OperatingPoint:
    """The settings for a wave of two tones of half the wanted amplitude; the nearest where they cannot be made."""
    level = float(target.levels.max())
    if device.chain.law.both_ways and device.chain_length > 1:
        lacking = "bars walk where waves run one way; it lacks links that act one way"
        return _nothing(device, target, lacking)
    if np.ptp(target.levels[target.weights > 0]) > 0:
        return _nothing(
            device, target, "bars walk with one amplitude along a chain; it lacks a drive for every actuator"
        )
    found, share = _found(device, level, target), 1.0
    if found is None:
        share, found = _lower(device, level, target)
    if found is None:
        return _nothing(device, target, "no two tones stand under one lam; it lacks range of lam")
    state = _state(device, target, found)
    lacking = _lacking(device, target, found, share) or lacking_of(state.margins)
    return replace(state, outcome=Outcome.UNREACHABLE if lacking else Outcome.OK, lacking=lacking)


def walking_rate_hz(device: Device, state: OperatingPoint) -> float:
    """Bars that pass an actuator in a second in the state of a walk."""
    other = next(tone for tone in state.tones if not tone.side)
    return (other.omega - state.omega) * device.f0_hz


def _found(device: Device, level: float, target: WalkingTarget) -> TwoToneWave | None:
    """Two tones under a lam that can be set."""
    chain, coupling = device.chain, device.coupling
    amplitude = level * device.full_scale / 2
    lam, spacing = target.lam, None if target.rate_hz is None else target.rate_hz / device.f0_hz
    width = target.width
    if width is None:
        assert spacing is not None
        width = max(NARROWEST, math.pi / 2 / math.atan(spacing / device.delta))
        if device.chain_length > 1:
            width = _fitted(device, amplitude, width, spacing)
    if device.chain_length == 1:
        if spacing is None:
            return two_tones(chain, amplitude=amplitude, width=width)
        return apart(chain, amplitude=amplitude, width=width, spacing=spacing)
    if lam is None and coupling.lam.min < coupling.lam.max:
        free = two_tones(chain, amplitude=amplitude, width=width)
        if free is None:
            return None
        lam = float(np.clip(free.lam, coupling.lam.min, coupling.lam.max))
        if coupling.lam_step:
            lam = coupling.lam.min + coupling.lam_step * round((lam - coupling.lam.min) / coupling.lam_step)
        if lam == free.lam:
            return free
    return two_tones(chain, amplitude=amplitude, width=width, lam=coupling.lam.min if lam is None else lam)


def _fitted(device: Device, amplitude: float, width: float, spacing: float) -> float:
    """The width at which two tones are so far apart, over f0; a linear chain's where none is found."""
    first, asked = width, spacing
    for _ in range(FITS):
        found = two_tones(device.chain, amplitude=amplitude, width=width)
        if found is None:
            return first
        if abs(found.spacing / spacing - 1) < FITTED:
            break
        asked *= spacing / found.spacing
        width = max(NARROWEST, math.pi / 2 / math.atan(asked / device.delta))
    return width


def _lower(device: Device, level: float, target: WalkingTarget) -> tuple[float, TwoToneWave | None]:
    good, bad, kept = 0.0, 1.0, None
    for _ in range(HALVINGS):
        middle = (good + bad) / 2
        found = _found(device, level * middle, target)
        if found is None:
            bad = middle
        else:
            good, kept = middle, found
    return good, kept


def _lacking(device: Device, target: WalkingTarget, found: TwoToneWave, share: float) -> str:
    if share < 1.0:
        part = f"{100 * share:.0f} % of this amplitude"
        slow = _slowest(device, target)
        return f"two tones of more than {part} do not stand under one lam; it lacks linearity (a smaller beta){slow}"
    if target.width is not None and abs(found.width / target.width - 1) > SAME:
        return f"its lam makes bars {found.width:.3g} actuators wide; it lacks range of lam"
    rate_hz = found.spacing * device.f0_hz
    if target.rate_hz is not None and abs(rate_hz / target.rate_hz - 1) > SAME:
        if target.width is None:
            return f"its lam makes bars walk at {rate_hz:.3g} Hz; it lacks range of lam"
        return f"bars of this width walk at {rate_hz:.3g} Hz; it lacks a drive for every actuator"
    if found.omega[MAIN] < device.omega.min or found.omega[MAIN + 1] > device.omega.max:
        return f"it takes frequencies outside {device.omega.min:g}..{device.omega.max:g}; it lacks range of omega"
    return ""


def _slowest(device: Device, target: WalkingTarget) -> str:
    """At which rate bars of this amplitude walk instead, and what lets slower ones pass; empty for a given width."""
    if target.rate_hz is None or target.width is not None:
        return ""
    level, rate_hz = float(target.levels.max()), target.rate_hz
    for _ in range(FASTER_TRIES):
        rate_hz *= FASTER
        found = _found(device, level, replace(target, rate_hz=rate_hz))
        if found is not None and abs(found.spacing * device.f0_hz / rate_hz - 1) <= SAME:
            slower = ", slower bars go by its bias (texture scroll)" if device.bias == "actuator" else ""
            return f"; at this amplitude bars walk at {rate_hz:.3g} Hz{slower}"
    return ""


def _state(device: Device, target: WalkingTarget, found: TwoToneWave) -> OperatingPoint:
    n = device.chain_length
    lags = np.outer(found.lag, target.place + np.arange(n))
    phasors = found.phasor[:, None] * np.exp(-1j * lags)
    drives = found.epsilon * np.exp(-1j * found.lag * target.place)
    tones = [
        PointTone(float(omega), complex(drive), phasor, side)
        for omega, drive, phasor, side in zip(found.omega, drives, phasors, SIDE, strict=True)
    ]
    first, *others = sorted(tones, key=lambda tone: tone.side)
    lam = np.full(n - 1, found.lam if n > 1 else 0.0)
    reached = (np.abs(first.phasor) + np.abs(others[0].phasor)) / device.full_scale
    together = float(np.abs(drives).sum())
    gain = detuning_gain(device.chain, np.abs(first.phasor)[None, :], lam[None, :], first.omega)
    # The tones with all side tones in line, and the third harmonic that goes with them.
    highest = float(np.abs(found.phasor).sum())
    highest += abs(device.beta) * highest**3 / 32
    return OperatingPoint(
        target=target.levels,
        epsilon=first.epsilon,
        lam=lam,
        bias=np.zeros(n),
        omega=first.omega,
        phasor=first.phasor,
        mean=np.zeros(n),
        error=float(np.abs((reached - target.levels)[target.weights > 0]).max()),
        margins=Margins(
            volts=together / device.epsilon_max,
            well=highest / device.escape_amplitude,
            noise_gain=float(gain[0]),
            slew=slew_of(device, together, float(found.omega.max())),
        ),
        outcome=Outcome.OK,
        tones=tuple(others),
    )


def _nothing(device: Device, target: WalkingTarget, lacking: str) -> OperatingPoint:
    n = device.chain_length
    silence = np.zeros(n, dtype=np.complex128)
    return OperatingPoint(
        target=target.levels, epsilon=0j, lam=np.full(n - 1, device.coupling.lam.min), bias=np.zeros(n), omega=1.0,
        phasor=silence, mean=np.zeros(n), error=float(target.levels.max()), margins=Margins(0.0, 0.0),
        outcome=Outcome.UNREACHABLE, lacking=lacking,
    )  # fmt: skip
