"""A plan as the messages of one session, each frame drawn when its samples are due, so that it can still be changed."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from planner import FramePlan

from ..safety import GateLimits
from ..waveform.coupling import CouplingWriter
from ..waveform.frame_entry import frame_entry
from ..waveform.manifest import Manifest
from ..waveform.sampling import Waveform
from .gated import GatedStream
from .messages import Mark
from .outgoing import MARK_FIXED, End, Message, check_fit, fitting, measures, start_of
from .playout import Event
from .record import plan_note, scene_note
from .replies import Capabilities

__all__ = ["plan_messages"]

CHANGED = "stopped, what was corrected is not safe"


def plan_messages(
    manifest: Manifest, frames: Iterable[FramePlan], found: Capabilities, *, session: int, prefill_s: float,
    limits: GateLimits,
) -> Iterator[Message]:  # fmt: skip
    """As `session_messages`, of frames in the place of samples; all of it is held against the gate as it goes out.

    Parameters
    ----------
    manifest : of the waveform that the frames stand for: as long, for the same device.
    prefill_s : seconds in store that are enough to begin, for a controller that knows of that.

    Raises
    ------
    UnfitController
        Before anything, when the waveform does not fit the controller.
    GateRefusal
        In mid-stream, at the first quantity over its limit, of a sample or a link.
    WaveformError
        In mid-stream, when a frame does not fit the device or the frame before it.
    """
    check_fit(manifest, found)
    return _messages(manifest, frames, found, session, prefill_s, limits)


def _messages(
    manifest: Manifest, frames: Iterable[FramePlan], found: Capabilities, session: int, prefill_s: float,
    limits: GateLimits,
) -> Iterator[Message]:  # fmt: skip
    device = manifest.device
    stream = GatedStream(device, found, limits, refused=CHANGED)
    yield start_of(session, found, manifest.samples, scene_note(manifest), prefill_s)
    waveform = Waveform(device, manifest.channels, _told(manifest, frames, found, stream))
    for volts in waveform.blocks(stream.block):
        yield from stream.messages(volts)
    stream.gate.finish()
    yield End(manifest.samples)


def _told(
    manifest: Manifest, frames: Iterable[FramePlan], found: Capabilities, stream: GatedStream
) -> Iterator[FramePlan]:
    """The frames; what happens in one is known once it is drawn."""
    links, number = CouplingWriter(manifest.device, sampled=True), 0
    for frame in frames:
        events: list[Event] = []
        if frame.frame is not None:
            events = _events(manifest, frame, number, found)
            number += 1
        stream.expect(events, links.events(frame))
        yield frame


def _events(manifest: Manifest, frame: FramePlan, number: int, found: Capabilities) -> list[Event]:
    device = manifest.device
    entry = frame_entry(device, frame, number)
    mark = Mark(round(frame.start_s * manifest.rate_hz), number, fitting(plan_note(entry), found, MARK_FIXED))
    return [mark, *measures(device, number, frame, entry["omega"], entry["moving"], found)]
