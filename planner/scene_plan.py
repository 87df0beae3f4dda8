"""A scene on a device: frames planned one after another, with memory that does not grow with their number."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING

from chainsim import Device, Outcome
from encoders import STANDS_FROM, Frame, Scene

from .errors import CannotTravel, ContrastError, DwellTooShort, SceneDoesNotFit, YieldError
from .family import AmplitudeFamily
from .frame_change import USUAL, Change, Pace, change_to
from .means import Means, plain_means
from .memory import Memory
from .operating_point import OperatingPoint
from .plan import AMPLITUDE_ERROR_LIMIT, FramePlan, Plan
from .targets import AmplitudeTarget
from .wish import FrameWish

if TYPE_CHECKING:
    from .following import Following
    from .robustness.expected import Expectation

__all__ = ["DEFAULT_CONTRAST_DB", "kept_share", "plan_scene", "verdict"]

DEFAULT_CONTRAST_DB = 20.0


def plan_scene(scene: Scene, device: Device, *, contrast_db: float | None = None, yield_: float | None = None) -> Plan:
    """Plan `scene` on `device`; the work is done as `Plan.frames` is read.

    Parameters
    ----------
    contrast_db : asked between raised and unraised dots, which is planned and judged. None: planned with
        `DEFAULT_CONTRAST_DB` where chains vibrate, and judged as `FrameWish` says.
    yield_ : share of devices, drawn with the device's spread, that are to keep the wish. Where there is a choice the
        search for means ends at it; None: at 0.9.

    Raises
    ------
    SceneDoesNotFit
        When the scene was laid out for another grid.
    ContrastError
        When the contrast is not above 0.
    YieldError
        When the yield is not above 0 and at most 1, or the device has no spread.
    """
    if contrast_db is not None and not (math.isfinite(contrast_db) and contrast_db > 0):
        raise ContrastError(f"contrast: expected a number of decibels above 0, got {contrast_db:g}; 20 is usual")
    if yield_ is not None and not 0 < yield_ <= 1:
        raise YieldError(f"yield: expected a share above 0 and at most 1 such as 0.9, got {yield_:g}")
    if yield_ is not None and device.spread is None:
        raise YieldError(
            f"yield: {device.name} says nothing of how its actuators differ; give it a spread, such as "
            "spread: {frequency: 0.01} in the device"
        )
    if yield_ is not None and device.modulation is not None:
        raise YieldError(
            f"yield: {device.name} is felt by its modulation, whose yield is not planned for; leave it out, and ask "
            "dotwave verify --as-built"
        )
    shape = (scene.shape.rows, scene.shape.cols)
    if shape != (device.rows, device.cols):
        raise SceneDoesNotFit(
            f"the scene is laid out for {shape[0]} x {shape[1]} actuators, "
            f"{device.name} has {device.rows} x {device.cols}"
        )
    return Plan(device, _Frames(scene, device, contrast_db, yield_), scene.encoding)


def kept_share(
    scene: Scene, device: Device, *, contrast_db: float | None = None, yield_: float | None = None
) -> float | None:
    """The share of devices that keep the first pages of a scene, with the means that it would be planned with.

    None where there is no choice of means. Arguments and errors are those of `plan_scene`.
    """
    frames = plan_scene(scene, device, contrast_db=contrast_db, yield_=yield_).frames
    return frames.means.share if isinstance(frames, _Frames) else None


class _Frames:
    """The planned frames of a scene, as often as they are asked for."""

    def __init__(self, scene: Scene, device: Device, asked_db: float | None, wanted: float | None) -> None:
        self._scene, self._device = scene, device
        self._asked_db, self._wanted = asked_db, wanted
        self._planned_db = DEFAULT_CONTRAST_DB if asked_db is None else asked_db
        self._following: Following | None = None

    @cached_property
    def _expected(self) -> Expectation | None:
        if self._device.spread is None or self._device.modulation is not None:
            return None
        from .robustness.expected import WANTED, Expectation

        return Expectation(self._device, WANTED if self._wanted is None else self._wanted)

    @cached_property
    def means(self) -> Means:
        """Under spread those that the first frames ask for; found once."""
        found = None
        if self._expected is not None:
            from .robustness.means_search import means_for

            found = means_for(self._scene.frames, self._expected, self._planned_db, self._asked_db)
        return found or plain_means(self._device, self._planned_db)

    def __iter__(self) -> Iterator[FramePlan]:
        means, memory = self.means, self.means.memory
        rate = self._device.amplifier.rate_hz
        targets = memory.at_rest
        position = 0
        self._following = None
        for frame, change in means.through(self._scene.frames, self._pace):
            samples = max(1, round(frame.dwell_s * rate))
            # What cannot be held is not played, and the next frame begins at rest.
            targets = change.targets if change.held else memory.at_rest
            yield self._frame(frame, position, samples, change)
            if not change.held and self._following is not None:
                self._following.rest()
            position += samples
        change = change_to(memory, targets, memory.at_rest)
        if any(ramp is not None for ramp in change.ramps):
            yield self._frame(None, position, int(change.longest_s * rate) + 2, change)

    def _pace(self, frame: Frame) -> Pace:
        """How chains go to a frame; raises where it travels and they cannot, or not as quickly."""
        if not (frame.travels or frame.leads):
            return USUAL
        family = self.means.memory.planner.family(AmplitudeTarget)
        if not isinstance(family, AmplitudeFamily):
            from .waves.speeds import cannot_travel

            raise CannotTravel(cannot_travel(self._device))
        if not frame.travels:
            return Pace(awake=True)
        rate = self._device.amplifier.rate_hz
        length_s = max(1, round(frame.dwell_s * rate)) / rate
        if length_s < family.shortest_s:
            most = math.floor(100 / family.shortest_s) / 100
            raise DwellTooShort(
                f"{self._device.name} does not pass {1 / length_s:.3g} columns or places in a second: it takes "
                f"{family.shortest_s:.3g} s from one to the next; let at most {most:g} pass in a second (--rate in "
                "cells, in a job columns_per_s or actuators_per_s)"
            )
        return Pace(length_s, awake=True)

    def _frame(self, frame: Frame | None, position: int, samples: int, change: Change) -> FramePlan:
        rate = self._device.amplifier.rate_hz
        longest, length_s = change.longest_s, samples / rate
        start_s, end_s = position / rate, (position + samples) / rate
        travels = frame is not None and frame.travels
        if longest >= length_s and not travels:
            raise DwellTooShort(
                f"a frame of {length_s:.3g} s is shorter than the {longest:.3g} s that {self._device.name} "
                f"takes to change a pattern; show frames for {1.5 * longest:.2g} s or more (--dwell, in a job dwell_s)"
            )
        times = start_s, start_s + (STANDS_FROM * length_s if travels else longest), end_s
        # After the way out nothing is to be felt any more.
        settled_s = length_s - 1 / self._device.f0_hz if travels else longest
        residue = 0.0 if frame is None else self._left(change, start_s, settled_s, length_s)
        outcome, note = verdict(change, residue, self.means.memory, travels)
        whole = FramePlan(
            frame, *times, change.states, change.ramps, outcome, note, contrast_db=self._asked_db, residue=residue
        )
        if self._expected is None or frame is None or whole.outcome is not Outcome.OK:
            return whole
        wish = FrameWish.of(frame, self._asked_db)
        found = self._expected.of(change.targets, change.states, wish)
        return replace(whole, spread=found and replace(found, tried=self.means.tried))

    def _left(self, change: Change, start_s: float, settled_s: float, length_s: float) -> float:
        """What changes leave that is felt in a frame, in units of full scale."""
        found = max((ramp.left for ramp in change.ramps if ramp is not None), default=0.0)
        if self._following is None:
            if not change.rings:
                return found
            from .following import Following

            self._following = Following(self._device)
        moments = (self._device.tau_per_s * at_s for at_s in (start_s, settled_s, length_s - settled_s))
        return max(found, self._following.through(change.states, change.ramps, *moments))


def verdict(change: Change, residue: float, memory: Memory, travels: bool = False) -> tuple[Outcome, str]:
    """What comes of a change that leaves `residue`, of full scale, and a sentence where that is not ok."""
    if change.made and residue <= AMPLITUDE_ERROR_LIMIT:
        return Outcome.OK, ""
    if not change.held:
        failed = next(state for state in change.states if state.outcome is not Outcome.OK)
        return failed.outcome, _note(failed, memory)
    cannot = f"{memory.device.name} cannot change to this pattern"
    if change.lacking:
        return Outcome.UNREACHABLE, f"{cannot}: {change.lacking}."
    longer = "" if travels else "for longer (--dwell, in a job dwell_s), or "
    note = (
        f"{cannot}: what changes leave rings on at "
        f"{100 * residue:.2g} % of full scale, {100 * AMPLITUDE_ERROR_LIMIT:g} % are allowed; "
        f"show frames {longer}with flat dots among those that are raised."
    )
    return Outcome.UNREACHABLE, note


def _note(state: OperatingPoint, memory: Memory) -> str:
    if state.outcome is not Outcome.UNREACHABLE:
        return state.outcome.sentence
    if state.lacking:
        return f"{memory.device.name} cannot make this pattern: {state.lacking}."
    return memory.planner.family(AmplitudeTarget).note()
