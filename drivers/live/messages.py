"""What stands, and the ways to what comes, as the messages of an open session; each sample held against the gate."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Mapping
from typing import Any, Protocol

from chainsim import Device
from planner import FramePlan

from ..channels import channels_of
from ..protocol.gated import GatedStream
from ..protocol.messages import Mark
from ..protocol.outgoing import MARK_FIXED, End, Message, check_fit_for, fitting, start_of
from ..protocol.record import device_note, live_note
from ..protocol.replies import OPEN_SINCE, Capabilities
from ..safety import GateLimits, GateRefusal
from ..waveform.coupling import CouplingWriter
from ..waveform.frame_entry import frame_entry
from .wave import LiveWave

__all__ = ["LiveEnded", "LiveMessages", "LiveSource"]

REFUSED = "stopped at the gate"
NEVER = 1 << 62  # samples announced to a controller that knows of no open sessions
WINDOWED = frozenset({"dc", "duty", "energy"})  # what passes with time
AGAIN_S = 0.05  # before a way is tried again that was too much for the time before it


class LiveEnded(Exception):
    """All is at rest and has been played, on a controller that cannot be told of an end: it is to be stopped."""


class LiveSource(Protocol):
    """Who knows what is to be shown."""

    def next_way(self) -> FramePlan | None:
        """The way to go now from what stands; None: what stands goes on standing."""
        ...

    def began(self, placed: FramePlan) -> None:
        """The way that was given last has begun, at the times that it has now."""
        ...

    def refused(self, why: str) -> None:
        """The way that was given last is over a limit, and is not gone; what stands is true no longer."""
        ...

    @property
    def over(self) -> bool:
        """Whether nothing comes any more, and the grid is at rest once the present way is gone."""
        ...


class LiveMessages:
    """START, then samples for as long as the source has not ended, with marks and links before theirs, then END.

    An iterator. What is not asked for yet is not decided yet: at each block the source is asked for a way.

    Parameters
    ----------
    found : the controller. One of version 3 or older fills half its buffer first, and is stopped at the end.
    encoding : of the cells, for recorders.
    prefill_s : seconds in store that are enough to begin.
    limits : None: those of the device.

    Raises
    ------
    UnfitController
        At once, when the controller is not one for the device.
    """

    def __init__(
        self, device: Device, found: Capabilities, source: LiveSource, *, session: int, encoding: Mapping[str, Any],
        prefill_s: float, limits: GateLimits | None = None,
    ) -> None:  # fmt: skip
        check_fit_for(device, found, device.coupling.lam.max)
        self._device, self._found, self._source = device, found, source
        self._wave, self._links = LiveWave(device), CouplingWriter(device, sampled=True)
        self._limits = limits or GateLimits.of(device, len(channels_of(device)))
        self._stream = GatedStream(device, found, self._limits, refused=REFUSED)
        self._open = found.version >= OPEN_SINCE
        self._again_at = self._frames = 0
        self._silent_until: int | None = None
        self._refused_from: int | None = None  # since when ways were too much
        start = start_of(session, found, 0 if self._open else NEVER, device_note(device, encoding), prefill_s)
        self._due: deque[Message] = deque([start])
        self._ended = False

    def __iter__(self) -> Iterator[Message]:
        return self

    def __next__(self) -> Message:
        """The next message.

        Raises
        ------
        GateRefusal
            When a sample is over a limit: nothing of its block was given.
        LiveEnded
            At the end, where the controller cannot be told of it.
        """
        if not self._due:
            if self._ended:
                raise StopIteration
            self._more()
        return self._due.popleft()

    def _more(self) -> None:
        wave = self._wave
        if wave.settled and wave.position >= self._again_at:
            way = self._source.next_way()
            if way is not None:
                self._try(way)
            elif self._source.over:
                self._end()
                if self._ended:
                    return
        self._due.extend(self._stream.messages(wave.block(self._stream.block)))

    def _end(self) -> None:
        position = self._wave.position
        if self._open:
            self._due.append(End(position))
            self._ended = True
        elif self._silent_until is None:
            self._silent_until = position + self._found.buffer_samples
        elif position >= self._silent_until:
            raise LiveEnded

    def _try(self, way: FramePlan) -> None:
        """Begin a way that passes the gate as a whole; one that is too much for the time before it waits."""
        wave = self._wave
        placed = wave.placed(way)
        try:
            self._check(placed)
        except GateRefusal as refusal:
            self._wait(refusal, way)
            return
        self._stream.expect([self._mark(placed)], self._links.events(placed))
        self._refused_from = None
        wave.begin(placed)
        self._source.began(placed)

    def _check(self, placed: FramePlan) -> None:
        """Hold a way against the gate, with all windows in which its pattern stands; nothing is sent."""
        gate, window = self._stream.gate.trial(), round(self._limits.window_s * self._found.rate_hz)
        if any(state.moving for state in placed.states):
            gate.check(self._wave.ahead(placed, window))
        else:
            gate.check(self._wave.ahead(placed, 1))
            gate.stay(window)

    def _wait(self, refusal: GateRefusal, way: FramePlan) -> None:
        """Try again soon where time may help; what stands meanwhile is true no longer once a window has passed."""
        position, rate = self._wave.position, self._found.rate_hz
        self._again_at = position + round(AGAIN_S * rate)
        if self._refused_from is None:
            self._refused_from = position
        passes = refusal.quantity in WINDOWED
        if way.frame is None and not passes:
            raise refusal
        if way.frame is not None and (not passes or position - self._refused_from > self._limits.window_s * rate):
            self._source.refused(str(refusal))

    def _mark(self, placed: FramePlan) -> Mark:
        entry = None if placed.frame is None else frame_entry(self._device, placed, self._frames)
        note = fitting(live_note(entry, placed.start_s), self._found, MARK_FIXED)
        self._frames += 1
        return Mark(self._wave.position, self._frames - 1, note)
