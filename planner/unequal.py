"""Chains whose actuators were measured: each kind of chain is planned as a device of its own."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from chainsim import Device, Outcome
from encoders import TargetPattern

from .memory import MOST_STATES, Ends, Memory
from .operating_point import OperatingPoint
from .plan import Ramp
from .targets import ChainTarget, DotGoal, targets_of

__all__ = ["UnequalMemory", "memory_of"]

Floats = NDArray[np.float64]

# Links that must be set beyond their range by less than this part of it are set to its end.
SLACK = 1e-9
# Largest change of a wave's motion, relative to its largest amplitude, by links that differ under one lam.
TOLD = 5e-4


def memory_of(device: Device, contrast_db: float) -> Memory:
    """What is in front of a planner for a device: one for all of its chains, or for each kind of them."""
    return UnequalMemory(device, contrast_db) if device.actuators else Memory(device, contrast_db)


class UnequalMemory(Memory):
    """As `Memory`, with the numbers of each chain; chains of the same numbers are one kind, planned once."""

    def __init__(self, device: Device, contrast_db: float) -> None:
        self._alone: list[Device] = []
        self._units: list[Floats | float] = []
        self._kind_at: list[int] = []
        known: dict[str, int] = {}
        for row in range(device.rows):
            for index in range(device.chains_per_row):
                alone = device.alone(row, index)
                kind = known.setdefault(alone.model_dump_json(), len(known))
                if kind == len(self._alone):
                    self._alone.append(alone)
                    own = device.coupling.scope == "link"
                    self._units.append(device.lam_gain(row, index) if own else device.lam_unit(row, index))
                self._kind_at.append(kind)
        super().__init__(device, contrast_db, self._alone)
        self._of_kind = [Memory(alone, contrast_db, whole=self) for alone in self._alone]
        self._set: dict[tuple[int, ChainTarget], OperatingPoint] = {}
        self._set_ramps: dict[tuple[int, ChainTarget, ChainTarget, bool, float, float | None], Ramp | None] = {}

    @property
    def kinds_at(self) -> Sequence[int]:
        """Which kind each chain of the device is."""
        return self._kind_at

    def hold(
        self,
        pattern: TargetPattern,
        before: Sequence[ChainTarget],
        dots: DotGoal | None = None,
        awake: bool = False,
    ) -> list[ChainTarget]:
        """What chains hold for a pattern, given what they held; `dots` and `awake` as in `Memory.hold`."""
        wanted = zip(self._kind_at, targets_of(pattern, self.device, dots), before, strict=True)
        targets = [self._of_kind[kind].held(target, one, awake) for kind, target, one in wanted]
        for kind, memory in enumerate(self._of_kind):
            memory.prepare(target for target, at in zip(targets, self._kind_at, strict=True) if at == kind)
        return targets

    def prepare_ways(self, changes: Iterable[Ends], moves: bool, length_s: float | None = None) -> None:
        """Plan the ramps of many changes at once."""
        given = list(changes)
        for kind, memory in enumerate(self._of_kind):
            places = [place for place, at in enumerate(self._kind_at) if at == kind]
            memory.prepare_ways([([b[i] for i in places], [a[i] for i in places]) for b, a in given], moves, length_s)

    def states(self, targets: Sequence[ChainTarget]) -> list[OperatingPoint]:
        """The states for what chains hold, as the device is set to them."""
        return [self._set_to(kind, target) for kind, target in zip(self._kind_at, targets, strict=True)]

    def _set_to(self, kind: int, target: ChainTarget) -> OperatingPoint:
        if (kind, target) not in self._set:
            if len(self._set) >= MOST_STATES:
                self._set.clear()
            self._set[(kind, target)] = self._state(kind, self._of_kind[kind].state(target))
        return self._set[(kind, target)]

    def _state(self, kind: int, state: OperatingPoint) -> OperatingPoint:
        gain, span = self._drive(kind), self.device.coupling.lam
        tones = tuple(replace(tone, epsilon=tone.epsilon * gain) for tone in state.tones)
        lam = state.lam / self._units[kind]
        if not state.moving:
            # What stands still is held under the smallest lam, whatever links make of it.
            lam = np.full_like(lam, span.min)
        done = replace(state, epsilon=state.epsilon * gain, tones=tones, lam=np.clip(lam, span.min, span.max))
        if done.outcome is Outcome.OK and self._beyond(lam):
            lacking = f"it takes links set to {lam.min():.3g}..{lam.max():.3g}; it lacks range of lam"
            return replace(done, outcome=Outcome.UNREACHABLE, lacking=lacking)
        return self._under_one_lam(kind, state, done)

    def _under_one_lam(self, kind: int, state: OperatingPoint, done: OperatingPoint) -> OperatingPoint:
        """A wave as it is when links differ that have one lam: it was planned for their mean."""
        device = self._alone[kind]
        gain = device.lam_gain(0)
        if device.coupling.scope == "link" or not state.epsilon or state.tones or np.all(gain == 1.0):
            return done
        from .closed_forms.wave_fit import response_to

        real = response_to(device.chain, replace(state, lam=state.lam * gain), state.phasor).phasor[0]
        away = float(np.abs(real - state.phasor).max())
        if away <= TOLD * float(np.abs(state.phasor).max()):
            return replace(done, error=done.error + away / device.full_scale)
        spread = f"{100 * float(np.abs(gain - 1).max()):.2g} %"
        return replace(
            done, phasor=real, error=done.error + away / device.full_scale, outcome=Outcome.UNREACHABLE,
            lacking=f"its links differ by up to {spread} under one lam; it lacks a lam per link",
        )  # fmt: skip

    def _drive(self, kind: int) -> float:
        """What a force is called in units of the profile."""
        return self.device.epsilon_per_volt / self._alone[kind].epsilon_per_volt

    def _beyond(self, lam: Floats) -> bool:
        span = self.device.coupling.lam
        slack = SLACK * (span.max - span.min)
        return bool(lam.size and (lam.min() < span.min - slack or lam.max() > span.max + slack))

    def under(self, targets: Sequence[ChainTarget], lam: float) -> list[ChainTarget]:
        """What chains hold, with their links given as they are set."""
        units = [float(np.mean(unit)) for unit in self._units]
        return [target.under(lam * units[kind]) for kind, target in zip(self._kind_at, targets, strict=True)]

    def leaving_s(self, targets: Sequence[ChainTarget], moves: bool) -> float:
        """Seconds until all chains have come to rest."""
        return max(
            (self._of_kind[kind].leaving_s([one], moves) for kind, one in zip(self._kind_at, targets, strict=True)),
            default=0.0,
        )

    def ramps(
        self,
        before: Sequence[ChainTarget],
        after: Sequence[ChainTarget],
        moves: bool,
        wait_s: float,
        length_s: float | None = None,
    ) -> list[Ramp | None]:
        """The ways from one to the other, as the device is set on them; None where a chain already stands."""
        pairs = list(zip(self._kind_at, before, after, strict=True))
        for kind, memory in enumerate(self._of_kind):
            same = [(one, other) for at, one, other in pairs if at == kind]
            memory.prepare_ramps(same, moves, length_s)
        return [self._set_ramp(kind, one, other, moves, wait_s, length_s) for kind, one, other in pairs]

    def _set_ramp(
        self,
        kind: int,
        before: ChainTarget,
        after: ChainTarget,
        moves: bool,
        wait_s: float,
        length_s: float | None,
    ) -> Ramp | None:
        ask = (kind, before, after, moves, wait_s, length_s)
        if ask not in self._set_ramps:
            if len(self._set_ramps) >= MOST_STATES:
                self._set_ramps.clear()
            ramp = self._of_kind[kind].ramp(*ask[1:])
            self._set_ramps[ask] = None if ramp is None else self._as_set(kind, ramp)
        return self._set_ramps[ask]

    def _as_set(self, kind: int, ramp: Ramp) -> Ramp:
        gain, span = self._drive(kind), self.device.coupling.lam
        tones = tuple(
            replace(
                tone, epsilon=tone.epsilon * gain,
                epsilon_slope=None if tone.epsilon_slope is None else tone.epsilon_slope * gain,
            )
            for tone in ramp.tones
        )  # fmt: skip
        ramp = replace(
            ramp, tones=tones, epsilon=None if ramp.epsilon is None else ramp.epsilon * gain,
            epsilon_slope=None if ramp.epsilon_slope is None else ramp.epsilon_slope * gain,
        )  # fmt: skip
        if ramp.lam is None:
            return ramp
        lam = ramp.lam / self._units[kind]
        lacking = ramp.lacking
        if not lacking and self._beyond(lam):
            lacking = f"the change takes links set to {lam.min():.3g}..{lam.max():.3g}; it lacks range of lam"
        return replace(ramp, lam=np.clip(lam, span.min, span.max), lacking=lacking)
