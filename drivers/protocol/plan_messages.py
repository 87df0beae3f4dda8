"""A plan as the messages of one session, each frame drawn when its samples are due, so that it can still be changed."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from heapq import merge

import numpy as np

from planner import FramePlan

from ..channels import channels_of
from ..safety import Gate, GateLimits
from ..waveform.coupling import CouplingWriter
from ..waveform.manifest import Manifest
from ..waveform.marking import mark_of
from ..waveform.sampling import Waveform
from .messages import Mark, SamplesMessage, StartMessage
from .outgoing import Coder, End, Message, check_fit, fitting, link_message, measures
from .playout import Event
from .record import plan_note, scene_note
from .replies import Capabilities

__all__ = ["plan_messages"]

CHANGED = "stopped, the corrected samples are not safe"


def plan_messages(
    manifest: Manifest, frames: Iterable[FramePlan], found: Capabilities, *, session: int, limits: GateLimits
) -> Iterator[Message]:
    """As `session_messages`, of frames in the place of samples; every sample is held against the gate as it goes out.

    Parameters
    ----------
    manifest : of the waveform that the frames stand for: as long, for the same device.

    Raises
    ------
    UnfitController
        Before anything, when the waveform does not fit the controller.
    GateRefusal
        In mid-stream, at the first quantity over its limit.
    WaveformError
        In mid-stream, when a frame does not fit the device or the frame before it.
    """
    check_fit(manifest, found)
    return _Drawn(manifest, frames, found, session, limits).messages()


class _Drawn:
    """Frames on their way out."""

    def __init__(
        self, manifest: Manifest, frames: Iterable[FramePlan], found: Capabilities, session: int, limits: GateLimits
    ) -> None:
        self._manifest, self._found, self._session = manifest, found, session
        self._frames = frames
        self._links = CouplingWriter(manifest.device)
        self._gate = Gate(limits, manifest.channels, manifest.rate_hz, refused=CHANGED)
        self._waiting: list[Event] = []
        self._number = 0

    def messages(self) -> Iterator[Message]:
        """All of them."""
        manifest, found, first = self._manifest, self._found, 0
        note = fitting(scene_note(manifest), found, 17)
        yield StartMessage(self._session, False, manifest.rate_hz, manifest.samples, note)
        coder = Coder(manifest.channels, manifest.rate_hz, found)
        waveform = Waveform(manifest.device, channels_of(manifest.device), self._noted())
        for volts in waveform.blocks(coder.block):
            self._gate.check(volts)
            due = [event for event in self._waiting if event.at < first + len(volts)]
            self._waiting = self._waiting[len(due) :]
            yield from due
            yield SamplesMessage(first, coder.codes(np.array(volts)))
            first += len(volts)
        self._gate.finish()
        yield End(first)

    def _noted(self) -> Iterator[FramePlan]:
        """The frames; what happens in one is known once it is drawn."""
        for frame in self._frames:
            self._waiting = list(merge(self._waiting, self._events(frame), key=lambda event: event.at))
            yield frame

    def _events(self, frame: FramePlan) -> list[Event]:
        device, rate, found = self._manifest.device, self._manifest.rate_hz, self._found
        events: list[Event] = [link_message(event, rate, found) for event in self._links.events(frame)]
        if frame.frame is None:
            return events
        number, self._number = self._number, self._number + 1
        mark = mark_of(device, frame, number)
        note = fitting(plan_note(device, frame, number), found, 12)
        window = round((frame.settled_s + frame.end_s) / 2 * rate), round(frame.end_s * rate)
        asked = measures(device, number, window, mark["omega"], mark["moving"], found)
        events += [Mark(round(frame.start_s * rate), number, note), *asked]
        return sorted(events, key=lambda event: event.at)
