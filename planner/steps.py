"""Changes of chains that know nothing of each other, remembered chain by chain: a book brings the same ones again."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from encoders import TargetPattern

from .frame_change import Change, change_to
from .memory import Memory
from .operating_point import OperatingPoint
from .plan import Ramp
from .targets import ChainTarget, DotGoal, targets_of

__all__ = ["ChainSteps"]

# All of 64 x 64 of a chain of six, which may be held in two ways, would fit.
MOST_STEPS = 1 << 14


class _Step(NamedTuple):
    """What one chain holds after a change, and its way there."""

    target: ChainTarget
    state: OperatingPoint
    ramp: Ramp | None
    duration_s: float
    rings: bool


class ChainSteps:
    """In front of a memory: changes of patterns, put together from what every chain did before where it did.

    Only changes that could be made are remembered, and only where no lam and no drive is common to all chains: there
    what a chain does depends on the others.
    """

    def __init__(self, memory: Memory) -> None:
        device = memory.device
        self._memory = memory
        self._kinds = memory.kinds_at
        self._apart = device.coupling.scope != "device" and device.drive != "device"
        self._known: dict[tuple[int, ChainTarget, ChainTarget], _Step] = {}

    def change(self, before: list[ChainTarget], pattern: TargetPattern, dots: DotGoal | None = None) -> Change:
        """The change from what chains hold to a pattern; `dots` as in `targets_of`."""
        wanted, known = targets_of(pattern, self._memory.device, dots), self._known
        try:
            steps = [known[step] for step in zip(self._kinds, before, wanted, strict=True)]
        except KeyError:
            change = change_to(self._memory, before, self._memory.hold(pattern, before, dots))
            if self._apart and change.made:
                self._remember(before, wanted, change)
            return change
        targets, states, ramps, durations_s, rings = zip(*steps, strict=True)
        return Change(list(targets), states, ramps, max(durations_s), True, "", any(rings))

    def _remember(self, before: Sequence[ChainTarget], wanted: Sequence[ChainTarget], change: Change) -> None:
        if len(self._known) >= MOST_STEPS:
            self._known.clear()
        ends = zip(self._kinds, before, wanted, strict=True)
        for ask, target, state, ramp in zip(ends, change.targets, change.states, change.ramps, strict=True):
            duration_s, rings = (0.0, False) if ramp is None else (ramp.duration_s, ramp.residue is not None)
            self._known[ask] = _Step(target, state, ramp, duration_s, rings)
