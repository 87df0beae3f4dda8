"""What a whole scene is planned with."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

from chainsim import Device
from encoders import Frame

from .frame_change import USUAL, ChainSteps, Change, Pace, usual
from .memory import Memory
from .targets import AS_WISHED, ChainTarget, DotGoal
from .wish import FrameWish

if TYPE_CHECKING:
    from .outlook import MeansTried

__all__ = ["Means", "plain_means"]


@dataclass(frozen=True)
class Means:
    """What a scene is planned with.

    Attributes
    ----------
    memory : plans chains for the device, with its range of omega cut down to what is used; for one without a spread
        where nothing is aimed beside the wish.
    dots : what dots are aimed by; None: they are aimed at as they are wished.
    tried : all means that were tried, in order; empty where there was no choice.
    share : of devices that keep the first frames of the scene; None where there was no choice.
    """

    memory: Memory
    dots: DotGoal | None = None
    tried: tuple[MeansTried, ...] = ()
    share: float | None = None

    @cached_property
    def _steps(self) -> ChainSteps:
        return ChainSteps(self.memory)

    def through(
        self, frames: Iterable[Frame], pace_of: Callable[[Frame], Pace] = usual
    ) -> Iterator[tuple[Frame, Change]]:
        """Frames one after another, from rest, and the change to each.

        What cannot be held is not played, and the frame after it begins at rest.
        """
        if self.dots is None:
            yield from self._steps.through(frames, pace_of)
            return
        held = self.memory.at_rest
        for frame in frames:
            change = self.change(held, frame, pace_of(frame))
            yield frame, change
            held = change.targets if change.held else self.memory.at_rest

    def change(self, before: list[ChainTarget], frame: Frame, pace: Pace = USUAL) -> Change:
        """The change from what chains hold to a frame.

        Where no way leads to dots as they are aimed at, they are aimed at as they are wished.
        """
        dots = self.dots if self.dots is not None and FrameWish.of(frame).dots else None
        change = self._steps.change(before, frame.pattern, dots, pace)
        if dots is None or change.made:
            return change
        wished = replace(dots, loudest=AS_WISHED)
        return self._steps.change(before, frame.pattern, wished, pace)


def plain_means(device: Device, contrast_db: float) -> Means:
    """What a device without a choice of means is planned with."""
    if device.actuators:
        from .unequal import memory_of

        return Means(memory_of(device, contrast_db))
    return Means(Memory(device, contrast_db))
