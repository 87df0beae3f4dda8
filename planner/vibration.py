"""Patterns held by vibration: a drive per chain, a lam on every link, no bias."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from chainsim import Device, Outcome

from . import jets
from .band import NODES_PER_RAMP, Band, choose_band
from .envelopes import ROUGHEST, EnvelopeRamp, change, fall, rise
from .floor import idle_profiles
from .hermite import broken_line
from .links import detuning_gain, links_for
from .margins import WELL_SHARE, lacking_of, slew_of
from .plan import ChainState, Margins, Ramp
from .refine import Refined, refine
from .strategy import Strategy

__all__ = ["Vibration"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
Mask = NDArray[np.bool_]

# Straight pieces a link's way is cut into: short against the beats of drive and stage resonance.
PIECE_S = 2.5e-3
# Where a state magnifies disturbances this much, shorter ones: the line's error is one of them.
FINE_PIECE_S = 1.5e-3
DELICATE = 1e6


class Vibration(Strategy):
    """Amplitude profiles by closed-form links, refined on harmonic balance; flat ramps between them."""

    def __init__(self, device: Device, contrast_db: float) -> None:
        super().__init__(device)
        self.contrast_db = contrast_db

    @cached_property
    def band(self) -> Band:
        """Frequency, ramp length and floor; chosen once."""
        return choose_band(self.device, self.contrast_db)

    @property
    def ramp_s(self) -> float:
        """Length of every ramp in seconds."""
        return self.band.ramp_s

    def held(self, target: Floats, started: bool) -> Floats:
        """A chain rests until its first dot; after it, unraised dots idle near the floor, for fast changes.

        Each takes the floor or half of it, whichever mix magnifies disturbances of the drive least: equal
        neighbours resonate alike, and five alike magnify a disturbance a billion times.
        """
        if not started and not np.any(target):
            return target
        profiles = idle_profiles(target, self.band.floor, self.band.lower)
        if len(profiles) == 1:
            return np.asarray(profiles[0])
        amplitude = profiles * self.device.full_scale
        lam = links_for(self.device.chain, amplitude, self.band.omega)
        gain = detuning_gain(self.device.chain, amplitude, lam, self.band.omega)
        return np.asarray(profiles[int(np.argmin(np.where(np.isfinite(gain), gain, np.inf)))])

    def note(self) -> str:
        """What is lacking."""
        return f"{self.device.name} cannot make this pattern by vibration: {self.band.lacking or 'it is out of reach'}."

    def states(self, targets: Floats) -> list[ChainState]:
        """Settings for amplitude targets; all zero is rest, and so is what no links can hold (unreachable)."""
        chain, omega = self.device.chain, self.band.omega
        moving = np.flatnonzero(np.any(targets > 0, axis=1))
        amplitude = targets[moving] * self.device.full_scale
        holdable = np.isfinite(links_for(chain, amplitude, omega)).all(axis=1)
        out = [self._rest(target) for target in targets]
        moving = moving[holdable]
        if len(moving):
            found = refine(chain, amplitude[holdable], omega)
            for place, index in enumerate(moving):
                out[index] = self._state(targets[index], found, place)
        return out

    def _rest(self, target: Floats) -> ChainState:
        n = self.device.chain_length
        return ChainState(
            target=target,
            epsilon=0j,
            lam=np.full(n - 1, self.device.coupling.lam.min),
            bias=np.zeros(n),
            omega=self.band.omega,
            phasor=np.zeros(n, dtype=np.complex128),
            mean=np.zeros(n),
            error=float(target.max()),
            margins=Margins(volts=0.0, well=0.0),
            outcome=Outcome.UNREACHABLE if np.any(target) else Outcome.OK,
        )

    def _state(self, target: Floats, found: Refined, i: int) -> ChainState:
        device = self.device
        gain = detuning_gain(device.chain, target[None, :] * device.full_scale, found.lam[[i]], self.band.omega)
        margins = Margins(
            volts=abs(found.epsilon[i]) / device.epsilon_max,
            well=float(np.abs(found.phasor[i]).max()) / device.escape_amplitude,
            noise_gain=float(gain[0]),
            slew=slew_of(device, abs(found.epsilon[i]), self.band.omega),
        )
        return ChainState(
            target=target,
            epsilon=complex(found.epsilon[i]),
            lam=found.lam[i],
            bias=np.zeros(device.chain_length),
            omega=self.band.omega,
            phasor=found.phasor[i],
            mean=np.zeros(device.chain_length),
            error=float(found.error[i]) / device.full_scale,
            margins=margins,
            outcome=self._outcome(found.outcome[i], found.lam[i], margins),
            lacking="" if self.band.lacking else lacking_of(margins),
        )

    def _outcome(self, solved: Outcome, lam: Floats, margins: Margins) -> Outcome:
        allowed = self.device.coupling.lam
        outside = lam.size and (lam.min() < allowed.min or lam.max() > allowed.max)
        if solved is Outcome.OK and (self.band.lacking or outside or lacking_of(margins)):
            return Outcome.UNREACHABLE
        return solved

    def ramps(self, before: list[ChainState], after: list[ChainState]) -> list[Ramp | None]:
        """From rest and to rest along the flat output; between patterns with links that vary in time."""
        chain, band = self.device.chain, self.band
        old = np.array([_standing(state) for state in before]) * self.device.full_scale
        new = np.array([_standing(state) for state in after]) * self.device.full_scale
        moved: Mask = np.any(old != new, axis=1)
        # A single actuator has no links to divide by zero amplitude: every way is a plain change.
        resting: Mask = np.logical_and(~old.any(axis=1), chain.n > 1)
        stopping: Mask = np.logical_and(~new.any(axis=1), chain.n > 1)
        common = (band.omega, band.ramp_s * self.device.tau_per_s, NODES_PER_RAMP)
        out: list[Ramp | None] = [None] * len(after)

        def fill(chosen: Mask, way: Callable[..., EnvelopeRamp], *ends: Floats) -> None:
            index = np.flatnonzero(chosen & moved)
            if len(index):
                made = way(chain, *(end[index] for end in ends), *common)
                for place, i in enumerate(index):
                    out[i] = self._ramp(made, place, before[i], after[i])

        fill(resting & ~stopping, rise, new)
        fill(stopping & ~resting, fall, old)
        fill(~resting & ~stopping, change, old, new)
        return out

    def _ramp(self, made: EnvelopeRamp, i: int, before: ChainState, after: ChainState) -> Ramp:
        """One ramp, moved by the little that separates its closed-form ends from the refined states."""
        ramp_s = self.band.ramp_s
        delicate = max(before.margins.noise_gain, after.margins.noise_gain) > DELICATE
        pieces = max(2, math.ceil(ramp_s / (FINE_PIECE_S if delicate else PIECE_S)))
        slope_per_ramp = made.lam_slope[[i]] * (ramp_s * self.device.tau_per_s)
        lam = broken_line(made.lam[[i]], slope_per_ramp, pieces)[0]
        blend = jets.smoothstep(ROUGHEST, NODES_PER_RAMP, 2)
        first, last = before.epsilon - made.epsilon[i, 0], after.epsilon - made.epsilon[i, -1]
        epsilon = made.epsilon[i] + first + (last - first) * blend[0]
        slope = made.epsilon_slope[i] * self.device.tau_per_s + (last - first) * blend[1] / ramp_s
        # At rest the links are free: they take the pattern's values for the whole of a rise or fall.
        start, end = (s.lam if np.any(s.phasor) else o.lam for s, o in ((before, after), (after, before)))
        x = np.linspace(0.0, 1.0, len(lam))
        step = np.interp(x, np.linspace(0.0, 1.0, NODES_PER_RAMP), blend[0])[:, None]
        lam = lam + (start - lam[0]) * (1 - step) + (end - lam[-1]) * step
        return Ramp(
            t_s=np.linspace(0.0, ramp_s, NODES_PER_RAMP),
            epsilon=epsilon,
            epsilon_slope=slope,
            lam_t_s=x * ramp_s if lam.size else None,
            lam=lam if lam.size else None,
            lacking=self._lacking(made, i, epsilon, lam),
        )

    def _lacking(self, made: EnvelopeRamp, i: int, epsilon: Complexes, lam: Floats) -> str:
        device, allowed = self.device, self.device.coupling.lam
        if not made.possible[i]:
            return "its links cannot follow the change in this time; it lacks detuning (a higher omega.max)"
        if np.abs(epsilon).max() > device.epsilon_max:
            return f"the change takes {np.abs(epsilon).max() / device.epsilon_per_volt:.3g} V; it lacks volts"
        if lam.size and (lam.min() < allowed.min or lam.max() > allowed.max):
            return f"the change takes links of {lam.min():.3g}..{lam.max():.3g}; it lacks range of lam"
        if made.peak[i].max() > device.escape_amplitude * WELL_SHARE:
            return "the change comes too near the edge of the softening well; it lacks time"
        return ""


def _standing(state: ChainState) -> Floats:
    """The target a state stands at: nothing where it could only stay at rest."""
    return state.target if np.any(state.phasor) else np.zeros_like(state.target)
