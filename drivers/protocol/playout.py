"""The output side of a controller: buffer, sample clock, events, and the ramp to zero."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from chainsim import Device

from ..channels import channels_of
from .early import MOST_EARLY
from .envelope import Envelope, EnvelopeMix
from .measured import Measure
from .messages import FULL_CODE, Bias, Codes, LinkCoupling, Links, Mark, Tones
from .replies import Marked, State
from .synthesis import Glide, ToneMix

__all__ = ["BUFFER_S", "ControllerSpec", "Event", "OutputBlock", "Playout"]

Floats = NDArray[np.float64]
Event = LinkCoupling | Links | Bias | Tones | Envelope | Mark | Measure

BLOCK = 256
BUFFER_S = 2.0  # what a host on a busy machine needs; see PROTOCOL.md
EVENTS_PER_S = 2048  # links of linked-6x6 that change from frame to frame: 600 in a quarter of a second


@dataclass(frozen=True)
class ControllerSpec:
    """What a controller is built for.

    Attributes
    ----------
    buffer_samples, event_slots : room.
    full_volts : volts of the largest code.
    lam_step, lam_max : links.
    watchdog_s : silence after which the output is at zero.
    ramp_s : time the ramp to zero takes, <= watchdog_s.
    drift_ppm : how much faster than nominal its sample clock runs.
    early_packets : kept for their turn, 0 to 32.
    """

    rows: int
    cols: int
    channels: int
    rate_hz: int
    buffer_samples: int
    event_slots: int
    full_volts: float
    lam_step: float
    lam_max: float
    watchdog_s: float
    ramp_s: float
    drift_ppm: float
    early_packets: int = MOST_EARLY

    @classmethod
    def of(
        cls,
        device: Device,
        *,
        buffer_s: float = BUFFER_S,
        watchdog_s: float = 0.2,
        ramp_s: float = 0.05,
        drift_ppm: float = 0.0,
    ) -> ControllerSpec:
        """A controller for `device` with room for `buffer_s` seconds of samples and of events."""
        rate, lam = device.amplifier.rate_hz, device.coupling.lam.max
        slots = min(65535, max(256, math.ceil(buffer_s * EVENTS_PER_S)))
        return cls(
            rows=device.rows, cols=device.cols, channels=len(channels_of(device)), rate_hz=rate,
            buffer_samples=max(2, math.ceil(buffer_s * rate)), event_slots=slots,
            full_volts=device.amplifier.volts, lam_step=lam / 65535, lam_max=lam,
            watchdog_s=watchdog_s, ramp_s=min(ramp_s, watchdog_s), drift_ppm=drift_ppm,
        )  # fmt: skip

    @property
    def true_rate_hz(self) -> float:
        """Samples per true second."""
        return self.rate_hz * (1 + 1e-6 * self.drift_ppm)


@dataclass(frozen=True)
class OutputBlock:
    """What went out.

    Attributes
    ----------
    time_s : of the first sample.
    volts : float64, shape (S, channels).
    played : samples of the stream before it.
    lam : float64, shape (S, rows, cols), column 0 is 0.
    live : False while the output is held or ramps to zero.
    """

    time_s: float
    volts: Floats
    lam: Floats
    played: int
    live: bool


class Playout:
    """Plays what is pushed, at the pace of its own clock; a hold freezes the output and ramps it to zero.

    Attributes
    ----------
    state : what the output does.
    alive : whether the host is heard; without it nothing starts.
    received, played : samples of the stream.
    events_done : events carried out.
    underruns : how often it ran dry.
    held_s : seconds held since the stream began to play.
    """

    def __init__(self, spec: ControllerSpec, now: float, on_output: Callable[[OutputBlock], None] | None) -> None:
        self._spec = spec
        self._on_output = on_output
        self._time = now
        self._fade = np.linspace(1.0, 0.0, max(1, round(spec.ramp_s * spec.rate_hz)) + 1)[1:]
        self._frozen: Floats = np.zeros(spec.channels)
        self._faded = len(self._fade)
        self._last: Floats = np.zeros(spec.channels)
        self._lam = [Glide.still(np.zeros(spec.cols - 1)) for _ in range(spec.rows)]
        self.state = State.IDLE
        self.played = 0
        self.alive = True
        self.clear()

    def clear(self) -> None:
        """Forget the stream; a ramp to zero that is under way goes on."""
        self._freeze()
        here = np.array([self.played])
        self._lam = [Glide.still(glide.at(here)[0]) for glide in self._lam]
        self._blocks: deque[Codes] = deque()
        self._events: deque[Event] = deque()
        self._bias = [Glide.still(np.zeros(1)) for _ in range(self._spec.channels)]
        self._tones = [ToneMix() for _ in range(self._spec.channels)]
        self._envelopes = [EnvelopeMix() for _ in range(self._spec.channels)]
        self._gain = len(self._fade)  # how far the ramp back up is
        self._total = 0
        self._ended = False
        self.parametric = False
        self._enough = self._spec.buffer_samples / 2
        self.received = self.played = self.events_done = self.underruns = 0
        self.held_s = 0.0

    def begin(self, parametric: bool, total: int, prefill: int = 0) -> None:
        """A stream is to come, of which `prefill` samples are enough to play (0: half a buffer); links go to 0."""
        self.clear()
        self._enough = min(self._enough, prefill or self._enough)
        self._lam = [Glide.still(np.zeros(self._spec.cols - 1)) for _ in self._lam]
        self.parametric, self._total = parametric, total
        self.state = State.FILLING

    def push(self, codes: Codes) -> None:
        """More samples: int16, shape (S, channels)."""
        self._blocks.append(codes)
        self.received += len(codes)
        self.start_if_ready()

    def push_event(self, event: Event) -> None:
        """More to do at a sample."""
        self._events.append(event)
        self.start_if_ready()

    def end(self, total: int) -> None:
        """All of the stream is here."""
        self._total = total
        self._ended = True
        self.start_if_ready()

    @property
    def last_event_at(self) -> int:
        """Where the newest waiting event stands; the played position when none waits."""
        return self._events[-1].at if self._events else self.played

    @property
    def silent(self) -> bool:
        """Whether the output is at zero and stays there."""
        return self.state is not State.PLAYING and (self._faded == len(self._fade) or not self._frozen.any())

    def start_if_ready(self) -> None:
        """Begin, or go on after a hold, once the output is at zero and there is enough to play."""
        if self.state not in (State.FILLING, State.HELD) or not self.silent or not self.alive:
            return
        stored = self.received - self.played
        enough = stored >= self._enough or 2 * len(self._events) >= self._spec.event_slots
        if self._ended or enough:
            self.state = State.PLAYING

    def hold(self, state: State = State.HELD) -> None:
        """Freeze the output and ramp it to zero; the position stays."""
        if self.state is State.PLAYING:
            self._freeze()
            self._gain = 0
            self.state = state
        elif state is not State.HELD:
            self.state = state

    def advance(self, now: float) -> list[Marked]:
        """Put out all samples that are due at `now`; returns the marks that went out."""
        marked: list[Marked] = []
        due = math.floor((now - self._time) * self._spec.true_rate_hz)
        while due > 0:
            if self.state is State.PLAYING:
                self._happen(marked)
                count = min(due, BLOCK, self._until_event(), self._available())
                if count == 0:
                    self._run_dry()
                    continue
                self._put_out(self._next(count), np.arange(self.played, self.played + count), live=True)
                self.played += count
            else:
                # A block ends with the ramp, for after it the output may go on.
                count = min(due, BLOCK, len(self._fade) - self._faded or BLOCK)
                if self.state is State.HELD and self.played:
                    self.held_s += count / self._spec.true_rate_hz
                self._put_out(self._fading(count), np.full(count, self.played), live=False)
                self.start_if_ready()
            due -= count
            self._time += count / self._spec.true_rate_hz
        return marked

    def _run_dry(self) -> None:
        if self._ended and self.played == self._total:
            self.hold(State.DONE)
        else:
            self.underruns += 1
            self.hold()

    def _available(self) -> int:
        if self.parametric:
            return max(0, self._total - self.played) if self._total else BLOCK
        return self.received - self.played

    def _until_event(self) -> int:
        return self._events[0].at - self.played if self._events else BLOCK

    def _happen(self, marked: list[Marked]) -> None:
        """Carry out the events whose sample is next."""
        while self._events and self._events[0].at <= self.played:
            event = self._events.popleft()
            self.events_done += 1
            if isinstance(event, Mark):
                marked.append(Marked(event.frame, event.at, round(self._time * 1e6)))
            elif isinstance(event, LinkCoupling):
                lam = np.array(event.codes) * self._spec.lam_step
                self._lam[event.row] = self._lam[event.row].then(event.at, event.ramp, lam)
            elif isinstance(event, Links):
                self._lam[event.row] = self._lam[event.row].then(event.at, event.ramp, event.lam)
            elif isinstance(event, Bias):
                self._bias[event.channel] = self._bias[event.channel].then(event.at, event.ramp, [event.volts])
            elif isinstance(event, Tones):
                self._tones[event.channel].change(event.at, event.ramp, event.tones)
            elif isinstance(event, Envelope):
                self._envelopes[event.channel].change(event)

    def _next(self, count: int) -> Floats:
        index = np.arange(self.played, self.played + count)
        volts = np.zeros((count, self._spec.channels))
        if not self.parametric:
            volts += self._take(count) * (self._spec.full_volts / FULL_CODE)
        for channel, (bias, tones) in enumerate(zip(self._bias, self._tones, strict=True)):
            if bias.moves_or_is_set:
                volts[:, channel] += bias.at(index)[:, 0]
            if tones.any:
                volts[:, channel] += tones.at(index, self._spec.rate_hz)
            if self._envelopes[channel].any:
                volts[:, channel] += self._envelopes[channel].at(index)
        if self._gain < len(self._fade):
            climb = np.arange(self._gain, self._gain + count).clip(max=len(self._fade)) / len(self._fade)
            volts *= climb[:, np.newaxis]
            self._gain += count
        # Tones and biases add up on top of the samples: the amplifier cannot give more than its full scale.
        return volts.clip(-self._spec.full_volts, self._spec.full_volts)

    def _take(self, count: int) -> Codes:
        parts = []
        while count:
            head = self._blocks.popleft()
            parts.append(head[:count])
            if len(head) > count:
                self._blocks.appendleft(head[count:])
            count -= len(parts[-1])
        return np.concatenate(parts)

    def _fading(self, count: int) -> Floats:
        fade = np.zeros(count)
        part = self._fade[self._faded : self._faded + count]
        fade[: len(part)] = part
        self._faded += len(part)
        return fade[:, np.newaxis] * self._frozen

    def _freeze(self) -> None:
        if self.state is State.PLAYING:
            self._frozen, self._faded = self._last.copy(), 0

    def _put_out(self, volts: Floats, index: NDArray[np.intp], *, live: bool) -> None:
        self._last = volts[-1]
        if self._on_output is not None:
            lam = np.zeros((len(volts), self._spec.rows, self._spec.cols))
            for row, glide in enumerate(self._lam):
                lam[:, row, 1:] = glide.at(index)
            self._on_output(OutputBlock(self._time, volts, lam, self.played, live))
