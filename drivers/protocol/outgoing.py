"""A written waveform as the messages of one session, in the order in which a controller needs them."""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from heapq import merge

import numpy as np
from numpy.typing import NDArray

from chainsim import Device

from ..channels import Channel, Role
from ..errors import DriverError
from ..formats.samples import SampleReader
from ..waveform.coupling import CouplingEvent
from ..waveform.manifest import Manifest
from ..waveform.shaping import Shaper
from .measured import Measure, turns_of
from .messages import FULL_CODE, VERSION, Codes, LinkCoupling, Mark, SamplesMessage, StartMessage
from .packet import Kind, Packet
from .playout import Event
from .record import frame_note, scene_note
from .replies import Capabilities

__all__ = [
    "Coder", "End", "Message", "UnfitController", "check_fit", "fitting", "link_message", "measures",
    "session_messages",
]  # fmt: skip

# A packet lasts at most so long, so that what is lost with one costs little to send again.
PACKET_S = 0.006


class UnfitController(DriverError, ValueError):
    """The controller on the line is not the one this waveform was made for.

    Examples: another protocol version; another grid, number of channels or rate; a bias it cannot reach.
    """


@dataclass(frozen=True)
class End:
    """All `total` samples have been sent."""

    total: int

    def packet(self, number: int) -> Packet:
        """As bytes."""
        return Packet(Kind.END, number, struct.pack("<Q", self.total))


Message = StartMessage | Event | SamplesMessage | End


def check_fit(manifest: Manifest, found: Capabilities) -> None:
    """Compare what the waveform needs with what the controller is.

    Raises
    ------
    UnfitController
        With the first thing that differs.
    """
    device = manifest.device
    lam_max = max((max(event.lam, default=0.0) for event in manifest.coupling), default=0.0)
    if not 1 <= found.version <= VERSION:
        raise UnfitController(
            f"controller {found.name!r}: it speaks protocol version {found.version}, dotwave {VERSION} and older; "
            f"update dotwave or the firmware"
        )
    for name, wanted, have in (
        ("rows", device.rows, found.rows),
        ("columns", device.cols, found.cols),
        ("channels", len(manifest.channels), found.channels),
        ("samples per second", manifest.rate_hz, found.rate_hz),
        ("bits per sample", 16, found.bits),
    ):
        if wanted != have:
            raise UnfitController(
                f"controller {found.name!r}: {name}: it has {have}, the waveform needs {wanted}; "
                f"plan for the device that is connected, or connect {device.name}"
            )
    if not device.amplifier.volts * (1 - 1e-6) <= found.full_volts < np.inf:
        raise UnfitController(
            f"controller {found.name!r}: it gives {found.full_volts:g} V, the waveform needs {device.amplifier.volts:g}"
        )
    if lam_max > 0 and not (found.lam_step > 0 and lam_max <= found.lam_max * (1 + 1e-6)):
        raise UnfitController(f"controller {found.name!r}: its lam ends at {found.lam_max:g}, {lam_max:g} is needed")
    if SamplesMessage.most(found.channels, found.max_payload) < 1:
        raise UnfitController(f"controller {found.name!r}: one sample of {found.channels} channels fits no packet")


def session_messages(
    manifest: Manifest, reader: SampleReader, found: Capabilities, *, session: int
) -> Iterator[Message]:
    """START, then samples with the events before the samples they belong to, then END.

    A sample becomes one of 65535 codes: a constant voltage the nearest, a drive one within two steps, so that the
    error lies high above the resonances (`Shaper`). Links become the nearest multiple of lam_step; times of events
    the nearest sample.

    Raises
    ------
    UnfitController
        Before anything, when the waveform does not fit the controller.
    FileError, UnreadableWaveform
        In mid-stream, when the file is no longer what it was; what else the samples themselves raise while read.
    """
    check_fit(manifest, found)
    return _messages(manifest, reader, found, session)


def _messages(manifest: Manifest, reader: SampleReader, found: Capabilities, session: int) -> Iterator[Message]:
    yield StartMessage(session, False, manifest.rate_hz, manifest.samples, fitting(scene_note(manifest), found, 17))
    # Events go by time; in the manifest they do so within each row only.
    links = (
        link_message(event, manifest.rate_hz, found) for event in sorted(manifest.coupling, key=lambda event: event.t_s)
    )
    waiting = merge(links, _marks(manifest, found), _measures(manifest, found), key=lambda event: event.at)
    event = next(waiting, None)
    coder, first = Coder(manifest.channels, manifest.rate_hz, found), 0
    for volts in reader.blocks(coder.block):
        while event is not None and event.at < first + len(volts):
            yield event
            event = next(waiting, None)
        yield SamplesMessage(first, coder.codes(volts))
        first += len(volts)
    yield End(first)


class Coder:
    """Volts as the codes of a controller: constant ones the nearest, of drives with the error pushed up in frequency.

    Attributes
    ----------
    block : how many samples go into a packet.
    """

    def __init__(self, channels: Sequence[Channel], rate_hz: int, found: Capabilities) -> None:
        most = SamplesMessage.most(found.channels, found.max_payload)
        self.block = max(1, min(most, found.buffer_samples // 8, round(PACKET_S * rate_hz)))
        self._drives = [channel.index for channel in channels if channel.role is Role.DRIVE]
        self._shaper = Shaper(len(self._drives))
        self._scale = FULL_CODE / found.full_volts

    def codes(self, volts: NDArray[np.float64]) -> Codes:
        """The next samples, shape (S, channels), as int16 of that shape."""
        codes = volts * self._scale
        codes[:, self._drives] = self._shaper.round(codes[:, self._drives].T).T
        return np.rint(codes).clip(-FULL_CODE, FULL_CODE).astype(np.int16)


def link_message(event: CouplingEvent, rate_hz: int, found: Capabilities) -> LinkCoupling:
    """Links that begin to move, in samples and the controller's steps."""
    at = round(event.t_s * rate_hz)
    ramp = max(0, round((event.t_s + event.ramp_s) * rate_hz) - at)
    step = found.lam_step or 1.0
    return LinkCoupling(at, event.row, ramp, tuple(min(65535, round(lam / step)) for lam in event.lam))


def _marks(manifest: Manifest, found: Capabilities) -> Iterator[Event]:
    for number, mark in enumerate(manifest.frames):
        yield Mark(round(mark.start_s * manifest.rate_hz), number, fitting(frame_note(mark), found, 12))


def _measures(manifest: Manifest, found: Capabilities) -> Iterator[Event]:
    for number, mark in enumerate(manifest.frames):
        window = round((mark.settled_s + mark.end_s) / 2 * manifest.rate_hz), round(mark.end_s * manifest.rate_hz)
        yield from measures(manifest.device, number, window, mark.omega.tolist(), mark.moving, found)


def measures(
    device: Device,
    frame: int,
    window: tuple[int, int],
    omega: Sequence[float],
    moving: Sequence[bool],
    found: Capabilities,
) -> Iterator[Measure]:
    """What is asked of a controller that measures while a frame goes out: nothing where it does not fit into a packet.

    Parameters
    ----------
    window : first sample, and that after the last. Take the second half of the time its pattern stands: what is left of
        the way in, where actuators are not as planned, has had the first half to fade.
    omega, moving : of each row.
    """
    at, stop = window
    # Without a bias, what moves in a row that is to rest is asked for at the frequency of the others.
    others = max(omega) if device.bias == "none" else 0.0
    asked = [one if moves else others for one, moves in zip(omega, moving, strict=True)]
    turns = [turns_of(one, device.tau_per_s / device.amplifier.rate_hz) if one else 0 for one in asked]
    while len(turns) > 1 and turns[-1] == turns[-2]:
        turns.pop()
    if found.measures and stop > at and len(turns) <= Measure.most(found.max_payload):
        yield Measure(at, stop - at, frame, tuple(turns))


def fitting(note: bytes, found: Capabilities, fixed: int) -> bytes:
    """The note, or nothing when it is too long for a packet: it is for recorders only."""
    return note if fixed + len(note) <= found.max_payload else b""
