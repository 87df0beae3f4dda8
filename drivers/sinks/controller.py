"""A controller on a serial port, over dotwave's own protocol."""

from __future__ import annotations

import random
from collections.abc import Callable, Iterable, Iterator
from dataclasses import asdict, dataclass
from typing import Any

from planner import FramePlan, Measured

from ..formats.samples import SampleReader
from ..packs.opened import PackSession
from ..packs.sounding import PackSamples
from ..protocol.host_session import HostSession, StreamReport, Timing
from ..protocol.outgoing import Message, session_messages
from ..protocol.parametric import ENVELOPES_SINCE, NotParametric, ParametricSession
from ..protocol.plan_messages import plan_messages
from ..protocol.playout import BUFFER_S
from ..protocol.replies import Capabilities
from ..safety import GateLimits
from ..waveform.manifest import Manifest
from .base import SinkError, SinkReport
from .serial_play import run_session
from .uart import Uart

__all__ = ["LEAD_S", "Controller", "buffer_notes"]

LEAD_S = 0.5
"""Seconds that frames which are still corrected go out ahead: enough for a host with little else to do."""


@dataclass(frozen=True)
class Controller:
    """A sink: the controller at `port`.

    Attributes
    ----------
    port : such as /dev/ttyACM0.
    baud : bits per second, None: the controller's own.
    patience_s : how long to wait for a controller that is not heard.
    parametric : send what the controller draws itself in place of samples, where waveform and controller allow it.
    on_measured : gets what the controller measured of each frame, where it does.
    frames : what is played in place of the samples, each frame drawn shortly before it goes out: a plan as long as they
        are, for the same device, that is corrected meanwhile. Every sample of it is held against `frame_limits`.
    frame_limits : as those of the gate; None: those of the device.
    """

    port: str
    baud: int | None = None
    patience_s: float = 10.0
    parametric: bool = False
    on_measured: Callable[[Measured], None] | None = None
    frames: Iterable[FramePlan] | None = None
    frame_limits: GateLimits | None = None

    def check(self, manifest: Manifest, samples: SampleReader) -> SinkReport:
        """Nothing more than the gate asks: what the controller can do is known once it answers."""
        return SinkReport()

    def play(self, manifest: Manifest, samples: SampleReader, progress: Callable[[float], None]) -> SinkReport:
        """Run a session to its end.

        Raises
        ------
        DriverError
            As `run_session`; SinkError when no port was given.
        """
        if not self.port:
            raise SinkError("controller: give its port, as in controller:/dev/ttyACM0; `dotwave ports` lists ports")
        number = random.SystemRandom().randrange(1, 1 << 32)
        drawn = (self.parametric or isinstance(samples, PackSamples)) and self.frames is None
        way = _Way.of(manifest, samples) if drawn else _Way(manifest, samples)
        session = HostSession(
            lambda found: self._messages(way, found, number), session=number,
            timing=Timing() if self.frames is None else Timing(lead_s=LEAD_S), on_measured=self.on_measured,
        )  # fmt: skip
        run_session(session, self._line, patience_s=self.patience_s, progress=progress)
        stream = session.report
        return SinkReport(
            ok=stream.underruns == 0 and stream.lost_s == 0,
            facts={"stream": _plain(stream)},
            lines=_lines(stream),
            notes=way.notes(stream),
        )

    def _messages(self, way: _Way, found: Capabilities, session: int) -> Iterator[Message]:
        if self.frames is None:
            return way.messages(found, session)
        limits = self.frame_limits or GateLimits.of(way.manifest.device, len(way.manifest.channels))
        return plan_messages(way.manifest, self.frames, found, session=session, prefill_s=LEAD_S / 2, limits=limits)

    def close(self) -> None:
        """Nothing stays open after `play`."""

    def _line(self) -> Uart:
        return Uart(self.port) if self.baud is None else Uart(self.port, self.baud)


@dataclass
class _Way:
    """How a waveform goes to a controller: as samples, or drawn by it; `why` it is not drawn though asked for."""

    manifest: Manifest
    samples: SampleReader
    drawn: ParametricSession | PackSession | None = None
    why: str = ""

    @classmethod
    def of(cls, manifest: Manifest, samples: SampleReader) -> _Way:
        """Drawn, if that can be; what is in a pack can."""
        if isinstance(samples, PackSamples):
            return cls(manifest, samples, PackSession(manifest, samples))
        try:
            return cls(manifest, samples, ParametricSession.of(manifest, samples))
        except NotParametric as refusal:
            return cls(manifest, samples, why=str(refusal))

    def messages(self, found: Capabilities, session: int) -> Iterator[Message]:
        """The session for the controller that answers."""
        if self.drawn is not None and found.version < ENVELOPES_SINCE:
            self.drawn, self.why = None, f"controller {found.name!r} knows no envelopes; update its firmware"
        if self.drawn is not None:
            return self.drawn.messages(found, session=session)
        return session_messages(self.manifest, self.samples, found, session=session)

    def notes(self, stream: StreamReport) -> tuple[str, ...]:
        """What to know of it."""
        if self.drawn is not None:
            return (f"The controller drew it from {self.drawn.pieces} envelopes; no samples were sent.",)
        rounding = f"off by at most {1e3 * self.manifest.device.amplifier.volts / 65534:.2f} mV"
        streamed = (f"It was streamed: {self.why}.",) if self.why else ()
        return (*streamed, f"Samples went out in 16 bits: {rounding}.", *buffer_notes(stream))


def buffer_notes(stream: StreamReport) -> tuple[str, ...]:
    """What to do about a buffer that ran dry, or would on a busy machine."""
    if stream.underruns:
        return (
            f"The buffer ran dry: it holds {stream.buffer_s:.2f} s, and for up to {stream.longest_pause_s:.2f} s "
            f"nothing could be sent. Close other programs, or give the controller room for more.",
        )
    if stream.buffer_s < BUFFER_S:
        return (
            f"The controller holds {stream.buffer_s:.2f} s: enough while this machine has little else to do, but "
            f"when it is busy {BUFFER_S:g} s are needed.",
        )
    return ()


def _lines(stream: StreamReport) -> tuple[str, ...]:
    late, reported = (
        1e3 * max(map(abs, values.values()), default=0.0) for values in (stream.late_s, stream.reported_late_s)
    )
    return (
        f"{stream.samples} samples in {stream.packets} packets, {stream.resent} sent again, {stream.reconnects} "
        f"reconnections, {stream.bad_there + stream.bad_here} broken packets seen",
        f"{stream.underruns} underruns, {stream.lost_s:.2f} s lost, least in store "
        f"{1e3 * _finite(stream.least_buffer_s):.0f} ms, frames within {late:.1f} ms of their marks, reported "
        f"within {reported:.1f} ms",
        *([f"{stream.measured} frames measured"] if stream.measured else []),
    )


def _plain(stream: StreamReport) -> dict[str, Any]:
    plain = asdict(stream)
    for name in ("late_s", "reported_late_s"):
        plain[name] = {str(frame): late for frame, late in plain[name].items()}
    plain["least_buffer_s"] = _finite(stream.least_buffer_s)
    return plain


def _finite(value: float) -> float:
    return value if value < float("inf") else 0.0
