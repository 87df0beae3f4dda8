"""A written waveform as the messages of one session, in the order in which a controller needs them."""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from heapq import merge
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from chainsim import Device

from ..channels import Channel, Role, channels_of
from ..errors import DriverError
from ..formats.samples import SampleReader
from ..waveform.coupling import CouplingEvent, on_samples
from ..waveform.manifest import Manifest
from ..waveform.shaping import Shaper
from .measured import Measure, turns_of
from .messages import FULL_CODE, VERSION, Codes, LinkCoupling, Links, Mark, SamplesMessage, StartMessage
from .packet import Kind, Packet
from .playout import Event
from .record import frame_note, scene_note
from .replies import OPEN_SINCE, Capabilities

__all__ = [
    "MARK_FIXED", "Coder", "End", "Message", "UnfitController", "block_of", "check_fit", "check_fit_for", "fitting",
    "link_coupling", "links_of", "marks_of", "measures", "session_messages", "start_of",
]  # fmt: skip

# A packet lasts at most so long, so that what is lost with one costs little to send again.
PACKET_S = 0.006
LINKS_SINCE = 6  # version
START_FIXED, PREFILL_FIXED, MARK_FIXED = 17, 4, 12  # bytes before the notes of START and MARK


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


def check_fit(manifest: Manifest, found: Capabilities, *, parametric: bool = False) -> None:
    """Compare what the waveform needs with what the controller is; `parametric`: it needs no room for samples.

    Raises
    ------
    UnfitController
        With the first thing that differs.
    """
    lam_max = max((max(event.lam, default=0.0) for event in manifest.coupling), default=0.0)
    check_fit_for(manifest.device, found, lam_max, parametric=parametric)


def check_fit_for(device: Device, found: Capabilities, lam_max: float, *, parametric: bool = False) -> None:
    """The same for any waveform of `device` whose links go up to `lam_max`."""
    if not 1 <= found.version <= VERSION:
        raise UnfitController(
            f"controller {found.name!r}: it speaks protocol version {found.version}, dotwave {VERSION} and older; "
            f"update dotwave or the firmware"
        )
    for name, wanted, have in (
        ("rows", device.rows, found.rows),
        ("columns", device.cols, found.cols),
        ("channels", len(channels_of(device)), found.channels),
        ("samples per second", device.amplifier.rate_hz, found.rate_hz),
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
    if device.grid:
        raise UnfitController(
            f"controller {found.name!r}: its links go along rows, those of {device.name} also downwards; "
            "only files hold them (-o)"
        )
    if lam_max > 0 and not (found.lam_step > 0 and lam_max <= found.lam_max * (1 + 1e-6)):
        raise UnfitController(f"controller {found.name!r}: its lam ends at {found.lam_max:g}, {lam_max:g} is needed")
    if parametric:
        return
    if not found.buffer_samples:
        raise UnfitController(f"controller {found.name!r}: it has no room for samples; play with --parametric")
    if SamplesMessage.most(found.channels, found.max_payload) < 1:
        raise UnfitController(f"controller {found.name!r}: one sample of {found.channels} channels fits no packet")


def session_messages(
    manifest: Manifest, reader: SampleReader, found: Capabilities, *, session: int
) -> Iterator[Message]:
    """START, then samples with the events before the samples they belong to, then END.

    A sample becomes one of 65535 codes: a constant voltage the nearest, a drive one within two steps, so that the
    error lies high above the resonances (`Shaper`). Links become the nearest multiple of lam_step,
    from version 6 on they are not rounded; times of events become the nearest sample.

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
    yield start_of(session, found, manifest.samples, scene_note(manifest))
    waiting = merge(
        links_of(manifest, found), marks_of(manifest, found), _measures(manifest, found), key=lambda event: event.at
    )
    event = next(waiting, None)
    coder, first = Coder(manifest.channels, found.full_volts), 0
    for volts in reader.blocks(block_of(found)):
        while event is not None and event.at < first + len(volts):
            yield event
            event = next(waiting, None)
        yield SamplesMessage(first, coder.codes(volts))
        first += len(volts)
    yield End(first)


def start_of(
    session: int, found: Capabilities, total: int, note: bytes, prefill_s: float = 0.0, *, parametric: bool = False
) -> StartMessage:
    """START, its note where there is room for it.

    Parameters
    ----------
    total : samples; 0 is open.
    prefill_s : seconds in store that are enough to begin, where the controller knows of that; 0: half of its buffer.
    parametric : no samples follow.
    """
    prefill = max(1, round(prefill_s * found.rate_hz)) if prefill_s and found.version >= OPEN_SINCE else 0
    fixed = START_FIXED + (PREFILL_FIXED if prefill else 0)
    return StartMessage(session, parametric, found.rate_hz, total, fitting(note, found, fixed), prefill)


def block_of(found: Capabilities) -> int:
    """How many samples of all channels go into a packet."""
    most = SamplesMessage.most(found.channels, found.max_payload)
    return max(1, min(most, found.buffer_samples // 8, round(PACKET_S * found.rate_hz)))


class Coder:
    """Samples as codes: drives with the error pushed up in frequency, constant voltages the nearest.

    Parameters
    ----------
    channels : what each column of a block is.
    full_volts : volts of code `FULL_CODE`.
    """

    def __init__(self, channels: Sequence[Channel], full_volts: float) -> None:
        self._drives = [channel.index for channel in channels if channel.role is Role.DRIVE]
        self._shaper, self._per_volt = Shaper(len(self._drives)), FULL_CODE / full_volts

    def codes(self, volts: NDArray[np.float64]) -> Codes:
        """The next samples, float64, shape (S, channels), volts."""
        codes = volts * self._per_volt
        codes[:, self._drives] = self._shaper.round(codes[:, self._drives].T).T
        return np.rint(codes).clip(-FULL_CODE, FULL_CODE).astype(np.int16)


def links_of(manifest: Manifest, found: Capabilities) -> Iterator[Event]:
    """What moves the links, by time."""
    device = manifest.device
    events = on_samples(manifest.coupling, manifest.rate_hz, device.rows, device.cols)
    # Events go by time; in the manifest they do so within each row only.
    for event in sorted(events, key=lambda event: event.t_s):
        yield link_coupling(event, found)


def link_coupling(event: CouplingEvent, found: Capabilities) -> LinkCoupling | Links:
    """Links that move, as a controller is told of them; one of version 6 need not round them."""
    at = round(event.t_s * found.rate_hz)
    ramp = max(0, round((event.t_s + event.ramp_s) * found.rate_hz) - at)
    if found.version >= LINKS_SINCE:
        return Links(at, event.row, ramp, event.lam)
    step = found.lam_step or 1.0
    return LinkCoupling(at, event.row, ramp, tuple(min(65535, round(lam / step)) for lam in event.lam))


def marks_of(manifest: Manifest, found: Capabilities) -> Iterator[Event]:
    """A mark for each frame."""
    for number, mark in enumerate(manifest.frames):
        yield Mark(round(mark.start_s * manifest.rate_hz), number, fitting(frame_note(mark), found, MARK_FIXED))


def _measures(manifest: Manifest, found: Capabilities) -> Iterator[Event]:
    for number, mark in enumerate(manifest.frames):
        yield from measures(manifest.device, number, mark, mark.omega.tolist(), mark.moving, found)


class _Stands(Protocol):
    """A frame, planned or written: when its pattern stands, in seconds."""

    @property
    def settled_s(self) -> float: ...

    @property
    def end_s(self) -> float: ...


def measures(
    device: Device, number: int, frame: _Stands, omega: Sequence[float], moving: Sequence[bool], found: Capabilities
) -> Iterator[Measure]:
    """A window for a frame, where the controller measures: the second half of the time its pattern stands.

    What is left there of the way in, where actuators are not as planned, has had the first half to fade. Nothing is
    asked for where it does not fit into a packet.

    Parameters
    ----------
    number : of the frame, from 0.
    omega, moving : of each row.
    """
    rate = device.amplifier.rate_hz
    at, stop = round((frame.settled_s + frame.end_s) / 2 * rate), round(frame.end_s * rate)
    # Without a bias, what moves in a row that is to rest is asked for at the frequency of the others.
    others = max(omega) if device.bias == "none" else 0.0
    asked = [one if moves else others for one, moves in zip(omega, moving, strict=True)]
    turns = [turns_of(one, device.tau_per_s / rate) if one else 0 for one in asked]
    while len(turns) > 1 and turns[-1] == turns[-2]:
        turns.pop()
    if found.measures and stop > at and len(turns) <= Measure.most(found.max_payload):
        yield Measure(at, stop - at, number, tuple(turns))


def fitting(note: bytes, found: Capabilities, fixed: int) -> bytes:
    """The note, or nothing when it is too long for a packet: it is for recorders only."""
    return note if fixed + len(note) <= found.max_payload else b""
