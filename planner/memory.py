"""What is planned, each once: in this run, and from the cache in any."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cached_property

import numpy as np

from chainsim import Device, Outcome
from encoders import TargetPattern

from .cache import PlanCache
from .operating_point import OperatingPoint
from .plan import Ramp
from .planner import Planner, Transition
from .targets import AmplitudeTarget, ChainTarget, DotGoal, targets_of
from .transitions.joining import turned_ramp, turned_state

__all__ = ["Ends", "Memory"]

# Kept of each: all 64 x 64 ramps of a chain of six would fit.
MOST_RAMPS = MOST_STATES = 4096
Ends = tuple[Sequence[ChainTarget], Sequence[ChainTarget]]
"""What chains hold before a change and after it."""


class Memory:
    """In front of a planner: what the chains of a device do for patterns.

    Lists of targets, states and ramps go row by row, chain by chain. A state is the point of a target with its turn.
    """

    def __init__(
        self, device: Device, contrast_db: float, kinds: Sequence[Device] = (), whole: Memory | None = None
    ) -> None:
        """`kinds` : as in `Planner`. `whole` : of the device that `device` is one chain of."""
        self.device = device
        self.planner: Planner = Planner(device, contrast_db, kinds, None if whole is None else whole.planner)
        self._cache: PlanCache = PlanCache(device, contrast_db, None if whole is None else whole._cache)
        self._held: dict[tuple[ChainTarget, bool], ChainTarget] = {}
        self._points: dict[ChainTarget, OperatingPoint] = {}
        self._states: dict[ChainTarget, OperatingPoint] = {}
        self._ramps: dict[Transition, Ramp | None] = {}
        self._turned: dict[tuple[ChainTarget, ChainTarget, bool, float, float | None], Ramp | None] = {}

    @cached_property
    def rest(self) -> ChainTarget:
        """What a chain holds that has nothing to do."""
        return AmplitudeTarget.of(np.zeros(self.device.chain_length))

    @property
    def kinds_at(self) -> Sequence[int]:
        """Which kind each chain of the device is; chains of one kind do the same for the same pattern."""
        return [0] * (self.device.chains)

    @property
    def at_rest(self) -> list[ChainTarget]:
        """All chains of the device at rest."""
        return [self.rest] * (self.device.chains)

    def hold(
        self,
        pattern: TargetPattern,
        before: Sequence[ChainTarget],
        dots: DotGoal | None = None,
        awake: bool = False,
    ) -> list[ChainTarget]:
        """What chains hold for a pattern, given what they held; `dots` as in `targets_of`, `awake` as in `held`."""
        targets = [self.held(*one, awake) for one in zip(targets_of(pattern, self.device, dots), before, strict=True)]
        self.prepare(targets)
        return targets

    def held(self, target: ChainTarget, before: ChainTarget, awake: bool = False) -> ChainTarget:
        """What a chain holds for a target, given what it held; `awake`: as though that were some amplitudes."""
        ask = (target.unturned, awake or (isinstance(before, AmplitudeTarget) and not before.resting))
        if ask not in self._held:
            if len(self._held) >= MOST_STATES:
                self._held.clear()
            self._held[ask] = self.planner.held(*ask)
        return self._held[ask].turned(target.turn)

    def states(self, targets: Sequence[ChainTarget]) -> list[OperatingPoint]:
        """The states for what chains hold."""
        return list(map(self.state, targets))

    def state(self, target: ChainTarget) -> OperatingPoint:
        """The state for what a chain holds."""
        if target not in self._states:
            if len(self._states) >= MOST_STATES:
                self._states.clear()
            self.prepare([target])
            self._states[target] = turned_state(self._points[target.unturned], target.turn)
        return self._states[target]

    def under(self, targets: Sequence[ChainTarget], lam: float) -> list[ChainTarget]:
        """What chains hold, with their links given."""
        return [target.under(lam) for target in targets]

    def prepare(self, targets: Iterable[ChainTarget]) -> None:
        """Plan many targets at once, which is quicker than one by one."""
        wanted = list(dict.fromkeys(target.unturned for target in targets))
        missing = [target for target in wanted if target not in self._points]
        if not missing:
            return
        if len(self._points) + len(missing) > MOST_STATES:
            self._points.clear()
            missing = wanted
        known = self._cache.find([b"state" + target.key for target in missing])
        self._points.update((target, point) for target, point in zip(missing, known, strict=True) if point is not None)
        new = [target for target, point in zip(missing, known, strict=True) if point is None]
        if new:
            made = dict(zip(new, self.planner.points(new), strict=True))
            self._points.update(made)
            self._cache.keep((b"state" + target.key, point) for target, point in made.items())

    def ramps(
        self,
        before: Sequence[ChainTarget],
        after: Sequence[ChainTarget],
        moves: bool,
        wait_s: float,
        length_s: float | None = None,
    ) -> list[Ramp | None]:
        """The ramps from one to the other; None where a chain already stands.

        `wait_s` : how many seconds after the start a wave begins to rise at the earliest.
        `length_s` : how long each is to last; None: as short as is safe.
        """
        pairs = list(zip(before, after, strict=True))
        self.prepare_ramps(pairs, moves, length_s)
        return [self.ramp(one, other, moves, wait_s, length_s) for one, other in pairs]

    def ramp(
        self,
        before: ChainTarget,
        after: ChainTarget,
        moves: bool,
        wait_s: float = 0.0,
        length_s: float | None = None,
    ) -> Ramp | None:
        """The ramp of one chain, as in `ramps`."""
        if before == after:
            return None
        ask = (before, after, moves, wait_s, length_s)
        if ask not in self._turned:
            if len(self._turned) >= MOST_RAMPS:
                self._turned.clear()
            self._turned[ask] = self._ramp(*ask)
        return self._turned[ask]

    def leaving_s(self, targets: Sequence[ChainTarget], moves: bool) -> float:
        """Seconds until all these chains have come to rest."""
        ramps = (self.ramp(target, self.rest, moves) for target in targets)
        return max((ramp.duration_s for ramp in ramps if ramp is not None), default=0.0)

    def _ramp(
        self, before: ChainTarget, after: ChainTarget, moves: bool, wait_s: float, length_s: float | None = None
    ) -> Ramp | None:
        waits = before.resting and wait_s > 0 and not isinstance(after, AmplitudeTarget)
        if self.planner.direct(before, after) and not waits:
            transition = Transition(before.unturned, after.unturned, moves, length_s)
            self._go([transition])
            ramp = self._ramps[transition]
            return None if ramp is None else turned_ramp(ramp, before.turn if after.resting else after.turn)
        leave = Ramp(t_s=np.zeros(1)) if before.resting else self._ramp(before, self.rest, moves, 0.0)
        enter = self._ramp(self.rest, after, moves, 0.0)
        return self.planner.by_rest(leave, enter, self.state(before), self.state(after), wait_s)

    def prepare_ways(self, changes: Iterable[Ends], moves: bool, length_s: float | None = None) -> None:
        """Plan the ramps of many changes at once, which is quicker than one by one."""
        pairs = dict.fromkeys(pair for before, after in changes for pair in zip(before, after, strict=True))
        # Between what cannot be held no ways are looked for.
        lasting = {target for pair in pairs for target in pair if self.state(target).outcome is Outcome.OK}
        self.prepare_ramps((pair for pair in pairs if lasting.issuperset(pair)), moves, length_s)

    def prepare_ramps(
        self, pairs: Iterable[tuple[ChainTarget, ChainTarget]], moves: bool, length_s: float | None = None
    ) -> None:
        """Plan many ramps between amplitudes at once, which is quicker than one by one."""
        if not self.planner.family(AmplitudeTarget).changes:
            return
        self._go(
            [
                Transition(one.unturned, other.unturned, moves, length_s)
                for one, other in dict.fromkeys(pairs)
                if isinstance(one, AmplitudeTarget) and isinstance(other, AmplitudeTarget)
                and one.turn == other.turn and one != other
            ]
        )  # fmt: skip

    def _go(self, transitions: Sequence[Transition]) -> None:
        wanted = list(dict.fromkeys(transitions))
        missing = [one for one in wanted if one not in self._ramps]
        if not missing:
            return
        if len(self._ramps) + len(missing) > MOST_RAMPS:
            self._ramps.clear()
            missing = wanted
        known = self._cache.find([b"ramp" + one.key for one in missing])
        self._ramps.update((one, ramp) for one, ramp in zip(missing, known, strict=True) if ramp is not None)
        new = [one for one, ramp in zip(missing, known, strict=True) if ramp is None]
        if new:
            before, after = self.states([one.before for one in new]), self.states([one.after for one in new])
            made = dict(zip(new, self.planner.ramps(new, before, after), strict=True))
            self._ramps.update(made)
            self._cache.keep((b"ramp" + one.key, ramp) for one, ramp in made.items() if ramp is not None)
