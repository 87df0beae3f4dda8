"""Patterns held by vibration: a drive per chain, a lam on every link, no bias."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray

from chainsim import Device, Outcome

from ..closed_forms.links import detuning_gain, links_for
from ..family import AmplitudeFamily, PatternFamily
from ..margins import WELL_SHARE, lacking_of, noise_error, slew_of
from ..operating_point import Margins, OperatingPoint
from ..plan import AMPLITUDE_ERROR_LIMIT, Ramp
from ..targets import AmplitudeTarget, ChainTarget, DotGoal
from ..transitions import jets
from ..transitions.envelopes import ROUGHEST, EnvelopeRamp, change, fall, rise
from ..transitions.hermite import broken_line
from .band import NODES_PER_RAMP, Band, choose_band
from .floor import idle_profiles
from .refine import Refined, refine

__all__ = ["Vibration"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
Mask = NDArray[np.bool_]

# Straight pieces a link's way is cut into: short against the beats of drive and stage resonance.
PIECE_S = 2.5e-3
# Where a state magnifies disturbances this much, shorter ones: the line's error is one of them.
FINE_PIECE_S = 1.5e-3
# Of a usual ramp: text that scrolls so fast is felt within 0.6 % of its way.
TRAVEL_SHARE = 0.8
DELICATE = 1e6


class Vibration(AmplitudeFamily):
    """Amplitude profiles by closed-form links, refined on harmonic balance; flat ramps between them."""

    def __init__(
        self, device: Device, contrast_db: float, kinds: Sequence[Device] = (), whole: Vibration | None = None
    ) -> None:
        """`kinds`, `whole` : as in `families.family_of`; all chains of a device share one band."""
        super().__init__(device)
        self.contrast_db = contrast_db
        self._kinds, self._whole = kinds, whole

    @classmethod
    def of(
        cls, device: Device, contrast_db: float, kinds: Sequence[Device] = (), whole: PatternFamily | None = None
    ) -> Self:
        """The family on a device, or on one chain of the device that `whole` is for."""
        return cls(device, contrast_db, kinds, whole if isinstance(whole, Vibration) else None)

    @cached_property
    def band(self) -> Band:
        """Frequency, ramp length and floor; chosen once."""
        return self._whole.band if self._whole else choose_band(self.device, self.contrast_db, self._kinds)

    @property
    def ramp_s(self) -> float:
        """Length of the longest ramps in seconds."""
        return self.band.ramp_s

    @property
    def shortest_s(self) -> float:
        """What travels may take less than what is to stand: what each way leaves is judged in every frame."""
        return TRAVEL_SHARE * self.band.ramp_s

    def levels(self, target: Floats, started: bool) -> Floats:
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

    def points(self, targets: Sequence[ChainTarget]) -> list[OperatingPoint]:
        """All of them in one array, with what they are aimed by."""
        goals = [target.dots if isinstance(target, AmplitudeTarget) else None for target in targets]
        return self.states(np.array([target.amplitude for target in targets]), goals)

    def states(self, targets: Floats, goals: Sequence[DotGoal | None] = ()) -> list[OperatingPoint]:
        """Settings for amplitude targets; all zero is rest, and so is what no links can hold (unreachable).

        Under spread the states aim beside the targets: with a goal where most devices keep their dots, else where the
        expected error is least.
        """
        if self.device.spread is None or self.band.lacking:
            return self._exact(targets)
        aims = self._aims(targets, goals or [None] * len(targets))
        found = self._exact(aims)
        for i in np.flatnonzero(np.any(aims != targets, axis=1)):
            if found[i].outcome is not Outcome.OK:
                found[i] = self._exact(targets[[i]])[0]
        return found

    def _aims(self, targets: Floats, goals: Sequence[DotGoal | None]) -> Floats:
        from ..robustness.robust_aim import aim_for

        amplitude = targets * self.device.full_scale
        known = np.any(targets > 0, axis=1)
        known[known] = np.isfinite(links_for(self.device.chain, amplitude[known], self.band.omega)).all(axis=1)
        whole = (self._whole or self).device
        common = self.band.omega, whole.chains
        asked = zip(targets, goals, known, strict=True)
        return np.array([aim_for(self.device, one, *common, goal) if fine else one for one, goal, fine in asked])

    def _exact(self, targets: Floats) -> list[OperatingPoint]:
        chain, omega = self.device.chain, self.band.omega
        moving = np.flatnonzero(np.any(targets > 0, axis=1))
        amplitude = targets[moving] * self.device.full_scale
        holdable = np.isfinite(links_for(chain, amplitude, omega)).all(axis=1)
        held, amplitude = moving[holdable], amplitude[holdable]
        states: dict[int, OperatingPoint | None] = dict.fromkeys(range(len(targets)))
        if len(held):
            found = refine(chain, amplitude, omega)
            gain = detuning_gain(chain, amplitude, found.lam, omega)
            made = (self._state(targets[index], found, place, gain[place]) for place, index in enumerate(held))
            states.update(zip(held.tolist(), made, strict=True))
        return [state or self._rest(targets[index]) for index, state in states.items()]

    def _rest(self, target: Floats) -> OperatingPoint:
        n = self.device.chain_length
        return OperatingPoint(
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

    def _state(self, target: Floats, found: Refined, i: int, gain: float) -> OperatingPoint:
        device = self.device
        margins = Margins(
            volts=abs(found.epsilon[i]) / device.epsilon_max,
            well=float(np.abs(found.phasor[i]).max()) / device.escape_amplitude,
            noise_gain=float(gain),
            slew=slew_of(device, abs(found.epsilon[i]), self.band.omega),
        )
        point = OperatingPoint(
            target=target,
            epsilon=complex(found.epsilon[i]),
            lam=found.lam[i],
            bias=np.zeros(device.chain_length),
            omega=self.band.omega,
            phasor=found.phasor[i],
            mean=np.zeros(device.chain_length),
            margins=margins,
        )
        added = noise_error(device, point, rounding=False) / device.full_scale
        # What rounding does to a drive that repeats is less than this; where devices differ it is counted all the same.
        noise = added if device.spread is None else noise_error(device, point) / device.full_scale
        lacking = lacking_of(margins)
        if not lacking and added > AMPLITUDE_ERROR_LIMIT:
            lacking = f"its amplifier's noise makes it tremble by {100 * added:.2g} %; it lacks a quieter amplifier"
        return replace(
            point,
            error=float(found.error[i]) / device.full_scale + noise,
            outcome=self._outcome(found.outcome[i], found.lam[i], lacking),
            lacking="" if self.band.lacking else lacking,
        )

    def _outcome(self, solved: Outcome, lam: Floats, lacking: str) -> Outcome:
        if solved is Outcome.OK and (self.band.lacking or self._outside(lam) or lacking):
            return Outcome.UNREACHABLE
        return solved

    def _outside(self, lam: Floats) -> bool:
        """Whether links of shape (..., n-1) must be set beyond their range."""
        allowed, device = self.device.coupling.lam, self.device
        if device.actuators and device.chains == 1:
            lam = lam / device.lam_gain(0)
        return bool(lam.size and (lam.min() < allowed.min or lam.max() > allowed.max))

    def ramps(
        self,
        before: Sequence[OperatingPoint],
        after: Sequence[OperatingPoint],
        moves: bool = True,
        length_s: float | None = None,
    ) -> list[Ramp | None]:
        """From rest and to rest along the flat output; between patterns with links that vary in time."""
        chain, band = self.device.chain, self.band
        old = np.array([_standing(state) for state in before]) * self.device.full_scale
        new = np.array([_standing(state) for state in after]) * self.device.full_scale
        moved: Mask = np.any(old != new, axis=1)
        # A single actuator has no links to divide by zero amplitude: every way is a plain change.
        resting: Mask = np.logical_and(~old.any(axis=1), chain.n > 1)
        stopping: Mask = np.logical_and(~new.any(axis=1), chain.n > 1)
        out: list[Ramp | None] = [None] * len(after)

        def fill(chosen: Mask, way: Callable[..., EnvelopeRamp], ramp_s: float, *ends: Floats) -> None:
            index = np.flatnonzero(chosen & moved)
            if len(index):
                duration = ramp_s * self.device.tau_per_s
                made = way(chain, *(end[index] for end in ends), band.omega, duration, NODES_PER_RAMP)
                ramps = self._ramps(made, ramp_s, [before[int(i)] for i in index], [after[int(i)] for i in index])
                for i, ramp in zip(index, ramps, strict=True):
                    out[i] = ramp

        fill(resting & ~stopping, rise, length_s or band.rise_s, new)
        fill(stopping & ~resting, fall, length_s or band.ramp_s, old)
        fill(~resting & ~stopping, change, length_s or band.ramp_s, old, new)
        return self._known(before, after, out)

    def _known(
        self, before: Sequence[OperatingPoint], after: Sequence[OperatingPoint], ramps: Sequence[Ramp | None]
    ) -> list[Ramp | None]:
        """With what they leave, where they can be gone; behind an actuator alone nothing magnifies it."""
        known = list(ramps)
        gone = [(i, ramp) for i, ramp in enumerate(ramps) if ramp is not None and not ramp.lacking]
        if gone and self.device.chain_length > 1:
            from ..transitions.residue import residues_of

            ends = [before[i] for i, _ in gone], [after[i] for i, _ in gone]
            found = residues_of(self.device, *ends, [ramp for _, ramp in gone])
            for (i, ramp), residue in zip(gone, found, strict=True):
                known[i] = replace(ramp, residue=residue)
        return known

    def _ramps(
        self, made: EnvelopeRamp, ramp_s: float, before: Sequence[OperatingPoint], after: Sequence[OperatingPoint]
    ) -> list[Ramp]:
        """Ramps moved by the little that separates their closed-form ends from the refined states."""
        blend = jets.smoothstep(ROUGHEST, NODES_PER_RAMP, 2)
        first, last = (
            np.array([state.epsilon for state in states]) - made.epsilon[:, end]
            for states, end in ((before, 0), (after, -1))
        )
        epsilon = made.epsilon + first[:, None] + (last - first)[:, None] * blend[0]
        slope = made.epsilon_slope * self.device.tau_per_s + (last - first)[:, None] * blend[1] / ramp_s
        t_s = np.linspace(0.0, ramp_s, NODES_PER_RAMP)
        courses = self._courses(made, ramp_s, before, after)
        t_of = {len(lam): np.linspace(0.0, ramp_s, len(lam)) for lam in courses}
        peak = np.abs(epsilon).max(axis=1)
        return [
            Ramp(
                t_s=t_s,
                epsilon=epsilon[i],
                epsilon_slope=slope[i],
                lam_t_s=t_of[len(lam)] if lam.size else None,
                lam=lam if lam.size else None,
                lacking=self._lacking(made, i, float(peak[i]), lam),
            )
            for i, lam in enumerate(courses)
        ]

    def _courses(
        self, made: EnvelopeRamp, ramp_s: float, before: Sequence[OperatingPoint], after: Sequence[OperatingPoint]
    ) -> list[Floats]:
        """What the links of every ramp do in straight pieces; float64, shape (pieces + 1, n-1) each."""
        blend = jets.smoothstep(ROUGHEST, NODES_PER_RAMP, 2)[0]
        ends = list(zip(before, after, strict=True))
        delicate = np.array([max(one.margins.noise_gain, other.margins.noise_gain) > DELICATE for one, other in ends])
        courses: list[Floats] = [np.empty((0, 0))] * len(ends)
        for chosen, piece_s in ((~delicate, PIECE_S), (delicate, FINE_PIECE_S)):
            index = np.flatnonzero(chosen)
            if not len(index):
                continue
            pieces = max(2, math.ceil(ramp_s / piece_s))
            slope_per_ramp = made.lam_slope[index] * (ramp_s * self.device.tau_per_s)
            lam = broken_line(made.lam[index], slope_per_ramp, pieces)
            # At rest the links are free: they take the pattern's values for the whole of a rise or fall.
            start = np.array([(one if np.any(one.phasor) else other).lam for one, other in (ends[i] for i in index)])
            end = np.array([(other if np.any(other.phasor) else one).lam for one, other in (ends[i] for i in index)])
            x = np.linspace(0.0, 1.0, pieces + 1)
            step = np.interp(x, np.linspace(0.0, 1.0, NODES_PER_RAMP), blend)[:, None]
            lam += (start - lam[:, 0])[:, None] * (1 - step) + (end - lam[:, -1])[:, None] * step
            for i, course in zip(index, lam, strict=True):
                courses[i] = course
        return courses

    def _lacking(self, made: EnvelopeRamp, i: int, peak: float, lam: Floats) -> str:
        device, allowed = self.device, self.device.coupling.lam
        if not made.possible[i]:
            return "its links cannot follow the change in this time; it lacks detuning (a higher omega.max)"
        if peak > device.epsilon_max:
            return f"the change takes {peak / device.epsilon_per_volt:.3g} V; it lacks volts"
        if lam.size and (lam.min() < allowed.min or lam.max() > allowed.max):
            return f"the change takes links of {lam.min():.3g}..{lam.max():.3g}; it lacks range of lam"
        if made.peak[i].max() > device.escape_amplitude * WELL_SHARE:
            return "the change comes too near the edge of the softening well; it lacks time"
        return ""


def _standing(state: OperatingPoint) -> Floats:
    """The target a state stands at: nothing where it could only stay at rest."""
    return state.target if np.any(state.phasor) else np.zeros_like(state.target)
