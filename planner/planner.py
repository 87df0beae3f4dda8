"""What chains do for targets, worked out anew every time it is asked: points, and ramps between them."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from chainsim import Device

from .families import family_of, row_of
from .family import PatternFamily
from .operating_point import OperatingPoint
from .plan import Ramp
from .targets import ChainTarget
from .transitions.joining import as_tone, joined, rest_for

__all__ = ["Planner", "Transition"]


class Transition(NamedTuple):
    """From one target to another, neither of them turned; `moves` where lam may differ on the way from both ends."""

    before: ChainTarget
    after: ChainTarget
    moves: bool

    @property
    def target(self) -> ChainTarget:
        """The one that decides how: what is left for rest, else what is reached."""
        return self.before if self.after.resting else self.after

    @property
    def key(self) -> bytes:
        """The transition in bytes, for a cache on disk."""
        return b"%d" % self.moves + self.before.key + b" to " + self.after.key


@dataclass(frozen=True)
class Planner:
    """Points and ramps of the chains of a device, which are alike.

    Attributes
    ----------
    contrast_db : how far an unraised dot of a vibrating chain stays below a raised one.
    kinds : where chains have numbers of their own, each of them as a device.
    whole : the planner of such a device when `device` is one of them.
    """

    device: Device
    contrast_db: float
    kinds: Sequence[Device] = ()
    whole: Planner | None = None
    _families: dict[type[ChainTarget], PatternFamily] = field(default_factory=dict, repr=False, compare=False)

    def family(self, kind: type[ChainTarget]) -> PatternFamily:
        """Who makes targets of a kind."""
        if kind not in self._families:
            row = row_of(kind, self.device)
            whole = None if self.whole is None else self.whole.family(kind)
            self._families[kind] = family_of(row, self.device, self.contrast_db, self.kinds, whole)
        return self._families[kind]

    def held(self, target: ChainTarget, started: bool) -> ChainTarget:
        """What a chain really holds for a target; `started`: amplitudes are held, and it is not at rest."""
        return self.family(type(target)).held(target, started)

    def points(self, targets: Sequence[ChainTarget]) -> list[OperatingPoint]:
        """What chains are driven at for targets that are not turned; those of a family together, which is quicker."""
        kinds = [type(target) for target in targets]
        points: dict[int, OperatingPoint] = {}
        for kind in dict.fromkeys(kinds):
            places = [place for place, one in enumerate(kinds) if one is kind]
            points.update(zip(places, self.family(kind).points([targets[i] for i in places]), strict=True))
        return [points[place] for place in range(len(targets))]

    def direct(self, before: ChainTarget, after: ChainTarget) -> bool:
        """Whether one ramp leads from one to the other, by `ramps`; else the chain rests between them."""
        if before.resting or after.resting:
            return True
        pair = {type(before), type(after)}
        return len(pair) == 1 and self.family(pair.pop()).changes and before.turn == after.turn

    def ramps(
        self, transitions: Sequence[Transition], before: Sequence[OperatingPoint], after: Sequence[OperatingPoint]
    ) -> list[Ramp | None]:
        """Ramps where they are direct; None where nothing has to change, or what is wanted cannot be held.

        Parameters
        ----------
        before, after : the points of each transition.
        """
        alike: dict[tuple[type[ChainTarget], bool], list[int]] = defaultdict(list)
        for place, one in enumerate(transitions):
            alike[(type(one.target), one.moves)].append(place)
        ramps: dict[int, Ramp | None] = {}
        for (kind, moves), places in alike.items():
            made = self.family(kind).ramps([before[i] for i in places], [after[i] for i in places], moves)
            ramps.update(zip(places, made, strict=True))
        return [ramps[place] for place in range(len(transitions))]

    def by_rest(
        self, leave: Ramp | None, enter: Ramp | None, before: OperatingPoint, after: OperatingPoint, wait_s: float
    ) -> Ramp | None:
        """One ramp of two that meet at rest: long enough there that what is left of the first spoils nothing.

        Parameters
        ----------
        leave : from `before` to rest.
        enter : from rest to `after`, which begins `wait_s` seconds after the start or later.
        """
        if leave is None or enter is None:
            return leave or enter
        left = as_tone(leave, before.omega)
        left = rest_for(left, wait_s - left.duration_s)
        entering = enter

        def whole(rest_s: float) -> Ramp:
            return joined(rest_for(left, rest_s), entering, before, after)

        one_tone = not (before.tones or after.tones) and bool(before.epsilon) and bool(after.epsilon)
        if one_tone and self.device.chain_length > 1:
            from .transitions.rest_between import rested

            return rested(self.device, before, after, whole)
        return whole(0.0)
