"""Ways from what stands to what comes, when nobody knows yet what comes after that, or when."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import product

import numpy as np

from chainsim import Device, Outcome
from encoders import Frame, TargetPattern

from .frame_change import Change, change_to, moves_between
from .means import plain_means
from .plan import FramePlan
from .scene_plan import DEFAULT_CONTRAST_DB, verdict
from .targets import ChainTarget

__all__ = ["LivePlan", "LiveWay"]

LONGEST_AHEAD = 6  # actuators in a chain whose ways are planned ahead


@dataclass(frozen=True)
class LiveWay:
    """A way from what is held to what is wished next.

    Attributes
    ----------
    plan : from 0 s to the moment at which the pattern stands; where the pattern, or the way, cannot be made its outcome
        says so, and it must not be begun. Its frame is None on the way to rest.
    before, after : what chains hold, row by row, chain by chain.
    """

    plan: FramePlan
    before: list[ChainTarget] = field(repr=False)
    after: list[ChainTarget] = field(repr=False)

    @property
    def still(self) -> bool:
        """Whether nothing moves, for all stands already."""
        return all(ramp is None for ramp in self.plan.ramps)


class LivePlan:
    """What chains hold, and their way to what is wished next; at first all are at rest.

    Holding costs nothing: what stands is the last `FramePlan`, for as long as no other is begun. What changes leave
    ringing is not followed from one to the next, as nobody knows how long a pattern will stand; of a device with a
    spread the means are those of the profile.

    Parameters
    ----------
    device : the hardware.
    contrast_db : asked between raised and unraised dots, as in `plan_scene`.

    Examples
    --------
    >>> import numpy as np
    >>> from chainsim import load_device
    >>> from encoders import Frame, TargetPattern
    >>> from planner import LivePlan
    >>> live = LivePlan(load_device("paper-6x6"))
    >>> way = live.show(Frame(TargetPattern(np.eye(6, dtype=complex)), dwell_s=1.0))
    >>> way.plan
    FramePlan(0.000 to 0.060 s, settled at 0.060 s, ok)
    >>> live.begin(way)
    >>> live.show(way.plan.frame).still, live.rest().still
    (True, False)
    """

    def __init__(self, device: Device, *, contrast_db: float | None = None) -> None:
        self._asked_db = contrast_db
        self._means = plain_means(device, DEFAULT_CONTRAST_DB if contrast_db is None else contrast_db)
        self._held = self._means.memory.at_rest
        self._pairs = self._dot_pairs()

    @property
    def resting(self) -> bool:
        """Whether all chains are at rest, or on their way there."""
        return self._held == self._means.memory.at_rest

    def show(self, frame: Frame) -> LiveWay:
        """The way from what is held to a frame, whose `dwell_s` does not matter; only `begin` makes it held."""
        before = self._held
        return self._way(frame, before, self._means.change(before, frame))

    def rest(self) -> LiveWay:
        """The way to rest, as `show`."""
        before, memory = self._held, self._means.memory
        return self._way(None, before, change_to(memory, before, memory.at_rest))

    def ahead(self) -> bool:
        """Plan one way more between patterns of raised and flat dots of a chain; False when none is left.

        A chain of six has 64 of them, and 4032 ways in between: once all are kept, no change takes long to plan.
        """
        pair = next(self._pairs, None)
        if pair is None:
            return False
        memory = self._means.memory
        memory.prepare_ramps([pair], moves_between(memory, [pair[0]], [pair[1]]))
        return True

    def _dot_pairs(self) -> Iterator[tuple[ChainTarget, ChainTarget]]:
        memory, device = self._means.memory, self._means.memory.device
        # Chains that differ, and long ones, have too many.
        if device.actuators or device.chain_length > LONGEST_AHEAD:
            return
        dots = []
        for raised in product((0.0, 1.0), repeat=device.chain_length):
            pattern = np.zeros((device.rows, device.cols), dtype=np.complex128)
            pattern[0, : device.chain_length] = raised
            dots.append(TargetPattern(pattern))
        for first in dots:
            before = memory.hold(first, memory.at_rest)
            for second in dots:
                yield before[0], memory.hold(second, before)[0]

    def leads_on(self, way: LiveWay) -> bool:
        """Whether a way leads from what is held now."""
        return way.before is self._held

    def begin(self, way: LiveWay) -> None:
        """A way is gone: what it leads to is held.

        Raises
        ------
        ValueError
            When it leads from something else, or cannot be gone.
        """
        if not self.leads_on(way) or way.plan.outcome is not Outcome.OK:
            raise ValueError(f"way: expected one from what is held, with the outcome ok, got {way.plan}")
        self._held = way.after

    def _way(self, frame: Frame | None, before: list[ChainTarget], change: Change) -> LiveWay:
        longest, (outcome, note) = change.longest_s, verdict(change, 0.0, self._means.memory)
        plan = FramePlan(
            frame, 0.0, longest, longest, change.states, change.ramps, outcome, note, contrast_db=self._asked_db
        )
        # A list of its own, so that what is held can be told from what was held before.
        return LiveWay(plan, before, list(change.targets))
