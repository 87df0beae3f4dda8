"""What a live grid is to show: the latest wish, the way to it, and when it is to rest. No thread, no port."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from threading import Condition

import numpy as np

from chainsim import Device, Outcome
from encoders import Frame, TargetPattern
from planner import FramePlan, LivePlan, LiveWay, PlanError

from .state import LiveState

__all__ = ["LiveCore"]

STARVED_S = 0.1
"""A way that was planned is gone although something newer came, when the grid was kept waiting for so long."""


@dataclass(frozen=True)
class _Wish:
    """What is to be felt next; a frame of None: nothing."""

    frame: Frame | None
    at_s: float


@dataclass(frozen=True)
class _UnderWay:
    """A way that was begun, and its wish."""

    wish: _Wish
    settled_s: float


class LiveCore:
    """Holds the latest wish only, plans the way to it, and hands it over when the grid has come to a stand.

    `plan` is the dear part and may run on a thread of its own; all else returns at once. It is the `LiveSource` of a
    stream.

    Parameters
    ----------
    idle_s : how long a pattern stands after `hold`.
    clock : seconds, any origin.
    """

    def __init__(self, device: Device, *, idle_s: float, clock: Callable[[], float]) -> None:
        self._device, self._plan = device, LivePlan(device)
        self._idle_s, self._clock = idle_s, clock
        self._changed = Condition()
        self._wish: _Wish | None = None
        self._ready: tuple[_Wish, LiveWay] | None = None
        self._offered: tuple[_Wish, LiveWay] | None = None
        self._starved_from = math.inf  # since when the grid could go, and something is wished
        self._left_at: float | None = None
        self._closing = False
        self._last: Frame | None = None  # what was begun last
        self._going: deque[_UnderWay] = deque()
        self._state = LiveState()

    @property
    def state(self) -> LiveState:
        """As it is now."""
        with self._changed:
            waiting = self._wish is not None or self._ready is not None
            return replace(self._state, waiting=waiting, resting=self._plan.resting)

    def show(self, frame: Frame) -> None:
        """This is to be felt next; what waits gives way."""
        with self._changed:
            if not self._closing:
                self._left_at = None
                self._want(frame)

    def hold(self) -> None:
        """Nobody shows any more: what stands, and what is under way to stand, stays until it rests."""
        with self._changed:
            self._left_at = self._clock()

    def rest(self) -> None:
        """Nothing is to be felt."""
        with self._changed:
            self._left_at = None
            self._want(None)

    def close(self) -> None:
        """Nothing is to be felt, and nothing comes any more."""
        with self._changed:
            self._closing = True
            self._want(None)

    def warm_up(self) -> None:
        """Load and compile what planning takes."""
        dot = np.zeros((self._device.rows, self._device.cols), dtype=np.complex128)
        dot[0, 0] = 1.0
        self._plan.show(Frame(TargetPattern(dot), 1.0))

    def plan_ahead(self) -> bool:
        """Plan a way that may be wanted, while there is nothing else to plan; whether there was one left."""
        return self._plan.ahead()

    def wake(self) -> None:
        """Whoever waits is to look again."""
        with self._changed:
            self._changed.notify_all()

    def wait(self, timeout_s: float) -> None:
        """Until there may be something to plan."""
        with self._changed:
            if self._wish is None:
                self._changed.wait(timeout_s)

    def plan(self) -> bool:
        """Plan the way to the latest wish, if there is one; whether there was."""
        with self._changed:
            wish = self._wish
        if wish is None:
            return False
        way = self._way(wish)
        with self._changed:
            if not self._plan.leads_on(way):
                return True  # a way was begun meanwhile: once more
            newest = self._wish is wish
            if newest:
                self._wish = None
            if newest or self._clock() - self._starved_from > STARVED_S:
                self._ready = None if way.still and _alike(way.plan.frame, self._last) else (wish, way)
        return True

    def _way(self, wish: _Wish) -> LiveWay:
        if wish.frame is None:
            return self._plan.rest()
        try:
            way = self._plan.show(wish.frame)
        except PlanError as error:
            self._refuse(str(error))
            return self._plan.rest()
        if way.plan.outcome is Outcome.OK:
            self._refuse("")
            return way
        # What stands is true no longer.
        self._refuse(way.plan.note)
        return self._plan.rest()

    def _want(self, frame: Frame | None) -> None:
        now = self._clock()
        if self._wish is not None or self._ready is not None:
            self._state = replace(self._state, coalesced=self._state.coalesced + 1)
        self._wish = _Wish(frame, now)
        if now - self._starved_from <= STARVED_S:
            self._ready = None
        self._changed.notify_all()

    def _refuse(self, why: str) -> None:
        with self._changed:
            self._state = replace(self._state, refused=why)

    def next_way(self) -> FramePlan | None:
        """As `LiveSource`."""
        with self._changed:
            left = self._left_at
            if left is not None and self._clock() - left >= self._idle_s:
                self._left_at = None
                if not self._plan.resting:
                    self._want(None)
            self._offered = self._ready
            if self._offered is not None:
                return self._offered[1].plan
            self._starved_from = math.inf if self._wish is None else min(self._starved_from, self._clock())
            return None

    def began(self, placed: FramePlan) -> None:
        """As `LiveSource`."""
        with self._changed:
            assert self._offered is not None
            wish, way = self._offered
            self._plan.begin(way)
            self._last, self._starved_from = placed.frame, math.inf
            # Whatever else was planned meanwhile leads from what stood before.
            if self._ready is not self._offered and self._ready is not None and self._wish is None:
                self._wish = self._ready[0]
            self._ready = None
            self._going.append(_UnderWay(replace(wish, frame=placed.frame), placed.settled_s))
            self._state = replace(self._state, coming=placed.frame)

    def refused(self, why: str) -> None:
        """As `LiveSource`."""
        with self._changed:
            self._state = replace(self._state, refused=why)
            self._ready = None
            if self._wish is None:
                self._want(None)

    @property
    def over(self) -> bool:
        """As `LiveSource`."""
        with self._changed:
            return self._closing and self._plan.resting and self._wish is None and self._ready is None

    def played(self, seconds: float) -> None:
        """So much of the stream has gone out."""
        with self._changed:
            while self._going and self._going[0].settled_s <= seconds:
                self._stands(self._going.popleft())

    def _stands(self, gone: _UnderWay) -> None:
        frame = gone.wish.frame
        self._state = replace(
            self._state, stands=frame, coming=self._going[-1].wish.frame if self._going else None,
            shown=self._state.shown + (frame is not None),
            latency_s=self._state.latency_s if frame is None else self._clock() - gone.wish.at_s,
        )  # fmt: skip


def _alike(one: Frame | None, other: Frame | None) -> bool:
    """Whether two frames whose patterns are the same say the same."""
    if one is None or other is None:
        return one is other
    return (one.cells, one.text) == (other.cells, other.text)
