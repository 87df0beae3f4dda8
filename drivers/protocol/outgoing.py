"""A written waveform as the messages of one session, in the order in which a controller needs them."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from heapq import merge

import numpy as np

from ..channels import Role
from ..errors import DriverError
from ..formats.samples import SampleReader
from ..waveform.manifest import Manifest
from ..waveform.shaping import Shaper
from .measured import Measure, turns_of
from .messages import FULL_CODE, VERSION, LinkCoupling, Mark, SamplesMessage, StartMessage
from .packet import Kind, Packet
from .playout import Event
from .record import frame_note, scene_note
from .replies import Capabilities

__all__ = ["End", "Message", "UnfitController", "check_fit", "session_messages"]

# A packet lasts at most so long, so that what is lost with one costs little to send again.
PACKET_S = 0.006
START_FIXED = 17  # bytes before START's note


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
    yield StartMessage(
        session, False, manifest.rate_hz, manifest.samples, _fitting(scene_note(manifest), found, START_FIXED)
    )
    waiting = merge(
        _links(manifest, found), _marks(manifest, found), _measures(manifest, found), key=lambda event: event.at
    )
    event = next(waiting, None)
    most = SamplesMessage.most(found.channels, found.max_payload)
    block = max(1, min(most, found.buffer_samples // 8, round(PACKET_S * manifest.rate_hz)))
    drives = [channel.index for channel in manifest.channels if channel.role is Role.DRIVE]
    shaper, first = Shaper(len(drives)), 0
    for volts in reader.blocks(block):
        while event is not None and event.at < first + len(volts):
            yield event
            event = next(waiting, None)
        codes = volts * (FULL_CODE / found.full_volts)
        codes[:, drives] = shaper.round(codes[:, drives].T).T
        codes = np.rint(codes).clip(-FULL_CODE, FULL_CODE)
        yield SamplesMessage(first, codes.astype(np.int16))
        first += len(volts)
    yield End(first)


def _links(manifest: Manifest, found: Capabilities) -> Iterator[Event]:
    # Events go by time; in the manifest they do so within each row only.
    for event in sorted(manifest.coupling, key=lambda event: event.t_s):
        at = round(event.t_s * manifest.rate_hz)
        ramp = max(0, round((event.t_s + event.ramp_s) * manifest.rate_hz) - at)
        step = found.lam_step or 1.0
        codes = tuple(min(65535, round(lam / step)) for lam in event.lam)
        yield LinkCoupling(at, event.row, ramp, codes)


def _marks(manifest: Manifest, found: Capabilities) -> Iterator[Event]:
    for number, mark in enumerate(manifest.frames):
        yield Mark(round(mark.start_s * manifest.rate_hz), number, _fitting(frame_note(mark), found, 12))


def _measures(manifest: Manifest, found: Capabilities) -> Iterator[Event]:
    """A window for each frame, where the controller measures: the second half of the time its pattern stands.

    What is left there of the way in, where actuators are not as planned, has had the first half to fade.
    """
    if not found.measures:
        return
    device, rate = manifest.device, manifest.rate_hz
    for number, mark in enumerate(manifest.frames):
        at, stop = round((mark.settled_s + mark.end_s) / 2 * rate), round(mark.end_s * rate)
        # Without a bias, what moves in a row that is to rest is asked for at the frequency of the others.
        others = float(mark.omega.max()) if device.bias == "none" else 0.0
        asked = [omega if moving else others for omega, moving in zip(mark.omega.tolist(), mark.moving, strict=True)]
        turns = [turns_of(omega, device.tau_per_s / rate) if omega else 0 for omega in asked]
        while len(turns) > 1 and turns[-1] == turns[-2]:
            turns.pop()
        if stop > at and len(turns) <= Measure.most(found.max_payload):
            yield Measure(at, stop - at, number, tuple(turns))


def _fitting(note: bytes, found: Capabilities, fixed: int) -> bytes:
    """The note, or nothing when it is too long for a packet: it is for recorders only."""
    return note if fixed + len(note) <= found.max_payload else b""
