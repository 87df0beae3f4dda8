"""A written waveform as a session without samples, where its drives are tones and what changes them is smooth."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..channels import Channel, Role
from ..errors import DriverError
from ..formats.samples import SampleReader
from ..waveform.manifest import FrameMark, Manifest
from .envelope import Envelope
from .measured import turns_of
from .outgoing import End, Message, UnfitController, check_fit, links_of, marks_of, start_of
from .pieces import NoPiece, pieces_of
from .record import scene_note
from .replies import Capabilities

__all__ = ["ENVELOPES_SINCE", "NotParametric", "ParametricSession", "check_draws"]

Floats = NDArray[np.float64]

ENVELOPES_SINCE = 5  # version
# A chain of resonators magnifies what a piece misses; half a step of 16 bits is 15 times as much.
TOLERANCE = 1e-6  # of full volts
BLOCK = 4096


class NotParametric(DriverError, ValueError):
    """A waveform holds what no cubics on its frames' carriers are; it can be streamed.

    Examples: a way in that is not a tone; a texture of noise; a file of 16 bits.
    """


@dataclass(frozen=True)
class ParametricSession:
    """What a controller of version 5 needs to draw a waveform itself.

    Attributes
    ----------
    manifest : of the waveform.
    envelopes : by time.
    """

    manifest: Manifest
    envelopes: tuple[Envelope, ...]

    @classmethod
    def of(cls, manifest: Manifest, reader: SampleReader) -> ParametricSession:
        """Read the samples once and find their pieces.

        Raises
        ------
        NotParametric
            With the channel and the time at which the first sample stands that no piece passes.
        FileError, UnreadableWaveform
            As the samples raise them.
        """
        drawing = [_Drawing(channel, manifest) for channel in manifest.channels]
        found: list[Envelope] = []
        for stretch, volts in _stretches(manifest, reader):
            for one in drawing:
                found += one.draw(stretch, np.ascontiguousarray(volts[:, one.channel.index]))
        return cls(manifest, tuple(sorted(found, key=lambda envelope: envelope.at)))

    @property
    def pieces(self) -> int:
        """How many envelopes are sent."""
        return len(self.envelopes)

    def messages(self, found: Capabilities, *, session: int) -> Iterator[Message]:
        """START, the events by time, END.

        Raises
        ------
        UnfitController
            Before anything, when the controller is not one for this waveform.
        """
        check_fit(self.manifest, found, parametric=True)
        check_draws(found)
        return self._messages(found, session)

    def _messages(self, found: Capabilities, session: int) -> Iterator[Message]:
        events = [*links_of(self.manifest, found), *self.envelopes, *marks_of(self.manifest, found)]
        yield start_of(session, found, self.manifest.samples, scene_note(self.manifest), parametric=True)
        yield from sorted(events, key=lambda event: event.at)
        yield End(self.manifest.samples)


def check_draws(found: Capabilities) -> None:
    """Refuse a controller that draws no envelopes.

    Raises
    ------
    UnfitController
        With the cure.
    """
    if found.version < ENVELOPES_SINCE:
        raise UnfitController(f"controller {found.name!r}: it knows no envelopes; stream, or update the firmware")


@dataclass(frozen=True)
class _Stretch:
    """Samples `first` to `stop` (excluded), on the way to `mark` or in it, after `before`."""

    first: int
    stop: int
    mark: FrameMark | None
    before: FrameMark | None


def _stretches(manifest: Manifest, reader: SampleReader) -> Iterator[tuple[_Stretch, Floats]]:
    rate, before = manifest.rate_hz, None
    plan: list[_Stretch] = []
    for mark in manifest.frames:
        first, settled, end = round(mark.start_s * rate), math.ceil(mark.settled_s * rate), round(mark.end_s * rate)
        plan += [_Stretch(first, settled, mark, before), _Stretch(settled, end, mark, None)]
        before = mark
    plan.append(_Stretch(plan[-1].stop if plan else 0, manifest.samples, None, before))
    blocks, pending = reader.blocks(BLOCK), np.empty((0, len(manifest.channels)))
    for stretch in plan:
        while len(pending) < stretch.stop - stretch.first and (block := next(blocks, None)) is not None:
            pending = np.concatenate([pending, block])
        yield stretch, pending[: stretch.stop - stretch.first]
        pending = pending[stretch.stop - stretch.first :]
    next(blocks, None)


@dataclass
class _Drawing:
    """The envelopes of one channel, stretch by stretch; `last` is what stands at each carrier."""

    channel: Channel
    manifest: Manifest
    last: dict[int, complex] = field(default_factory=dict)

    def draw(self, stretch: _Stretch, volts: Floats) -> Iterator[Envelope]:
        """What draws these samples.

        Raises
        ------
        NotParametric
            When nothing does.
        """
        full, carriers = self.manifest.device.amplifier.volts, self._carriers(stretch)
        if not volts.any():
            carriers = ()
        try:
            for piece in pieces_of(volts, stretch.first, carriers, TOLERANCE * full, full * (1 - 1e-6)):
                yield from self._ended(piece.at, carriers)
                for turns, points in zip(carriers, piece.points, strict=True):
                    if len(points) > 1 or self.last.get(turns, 0j) != points[0]:
                        ramp = piece.samples if len(points) > 1 else 0
                        yield Envelope(piece.at, self.channel.index, ramp, turns, points)
                    self.last[turns] = points[-1]
        except NoPiece as where:
            raise NotParametric(
                f"{self.channel} at {where.at / self.manifest.rate_hz:.3f} s: this is no tone that changes smoothly; "
                f"a controller cannot draw it"
            ) from None

    def _ended(self, at: int, carriers: tuple[int, ...]) -> Iterator[Envelope]:
        for turns in [turns for turns, volts in self.last.items() if volts and turns not in carriers]:
            self.last[turns] = 0j
            yield Envelope(at, self.channel.index, 0, turns, (0j,))

    def _carriers(self, stretch: _Stretch) -> tuple[int, ...]:
        if self.channel.role is Role.BIAS:
            return (0,)
        row, device = self.channel.row, self.manifest.device
        omegas: dict[float, None] = {}
        for mark in (stretch.mark, stretch.before):
            if mark is not None:
                omegas |= dict.fromkeys([float(mark.omega[row]), *(mark.tones[row] if mark.tones else ())])
        dtau = device.tau_per_s / self.manifest.rate_hz
        return tuple(turns_of(omega, dtau) for omega in omegas if omega > 0)
