"""An entry of a pack as what reads waveforms takes: a manifest and samples; and as a session without samples."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from chainsim import Device, complaint_of

from ..channels import channels_of
from ..errors import UnreadableWaveform
from ..protocol.envelope import Envelope
from ..protocol.outgoing import End, Message, check_fit, link_coupling, marks_of, start_of
from ..protocol.parametric import check_draws
from ..protocol.playout import Event
from ..protocol.record import scene_note
from ..protocol.replies import Capabilities
from ..waveform.coupling import CouplingEvent
from ..waveform.manifest import SCHEMA, Manifest, digest_of
from ..waveform.manifest_reader import manifest_of
from .layout import NO_PATTERN
from .reader import Pack, PackEntry
from .sounding import PackSamples
from .writer import DEFAULTS

__all__ = ["PackSession", "read_packed"]


def read_packed(path: Path, name: str | None) -> tuple[Manifest, PackSamples]:
    """Manifest and samples of an entry: of `name`, or the only one there is.

    Raises
    ------
    FileError, UnreadableWaveform
        When the pack cannot be read, or a byte of it is not as it was written.
    NotInPack
        When there is no such entry, or several and none was named.
    """
    pack = Pack(path)
    pack.check_whole()
    entry = pack.only() if name is None else pack.find(name)
    frames = pack.frames(entry)
    samples = int(frames["samples"].sum(dtype="u8"))
    reader = PackSamples(pack, entry, samples)
    plain = {
        "schema": SCHEMA, "samples_file": path.name, "rate_hz": pack.header.rate_hz, "samples": samples,
        "digest": digest_of(path), "device": pack.device, "coupling": [],
    }  # fmt: skip
    about = pack.about(entry)
    plain |= {"encoding": about.get("encoding", {}), "headings": about.get("headings", [])}
    plain |= {"channels": _channels(path, pack), "frames": list(_frames(pack, entry, about.get("frames", [])))}
    manifest = manifest_of(path, plain)
    _check_header(path, pack, manifest.device)
    return replace(manifest, coupling=tuple(_coupling(pack, entry))), reader


@dataclass(frozen=True)
class PackSession:
    """What a controller of version 5 needs to draw an entry of a pack itself; nothing is fitted any more."""

    manifest: Manifest
    samples: PackSamples

    def messages(self, found: Capabilities, *, session: int) -> Iterator[Message]:
        """START, the events by time, END; as `ParametricSession.messages`."""
        check_fit(self.manifest, found, parametric=True)
        check_draws(found)
        return self._messages(found, session)

    def _messages(self, found: Capabilities, session: int) -> Iterator[Message]:
        yield start_of(session, found, self.manifest.samples, scene_note(self.manifest), parametric=True)
        marks = marks_of(self.manifest, found)
        for first, settled, events in _events(self.samples.pack, self.samples.entry):
            told: list[Event] = [next(marks)] if settled != NO_PATTERN else []
            told += (link_coupling(one, found) if isinstance(one, CouplingEvent) else one for one in events)
            yield from sorted(told, key=lambda event: max(event.at, first))
        yield End(self.manifest.samples)

    @property
    def pieces(self) -> int:
        """How many envelopes are sent."""
        pack = self.samples.pack
        ways = pack.frames(self.samples.entry)["ways"].ravel().tolist()
        return sum(len(pack.curve(at).at) for way in ways for _, at in pack.way(way).channels)


def _events(pack: Pack, entry: PackEntry) -> Iterator[tuple[int, int, list[Envelope | CouplingEvent]]]:
    """Of every frame its first sample, when it settles, and what happens."""
    first = 0
    for settled, samples, ways in pack.frames(entry).tolist():
        events: list[Envelope | CouplingEvent] = []
        for row, at in enumerate(ways):
            for place, curve_at in pack.way(at).channels:
                curve, channel = pack.curve(curve_at).cut(samples), int(pack.places[row, place])
                for piece, ramp, points in zip(
                    curve.at.tolist(), curve.ramp.tolist(), curve.points.tolist(), strict=True
                ):
                    told = tuple(points) if ramp else tuple(points[3:])
                    events.append(Envelope(first + piece, channel, ramp, curve.turns, told))
            events += _links(pack, row, pack.way(at).links, first)
        yield first, settled, events
        first += samples


def _coupling(pack: Pack, entry: PackEntry) -> Iterator[CouplingEvent]:
    """What moves the links of every row, by time."""
    first = 0
    for _, samples, ways in pack.frames(entry).tolist():
        found = [one for row, at in enumerate(ways) for one in _links(pack, row, pack.way(at).links, first)]
        yield from sorted(found, key=lambda event: event.t_s)
        first += samples


def _links(pack: Pack, row: int, at: int | None, first: int) -> Iterator[CouplingEvent]:
    if at is None:
        return
    curve, rate = pack.link_curve(at), pack.header.rate_hz
    for piece, ramp, lam in zip(curve.at.tolist(), curve.ramp.tolist(), curve.lam.tolist(), strict=True):
        yield CouplingEvent((first + piece) / rate, row, tuple(lam), ramp / rate)


def _frames(pack: Pack, entry: PackEntry, abouts: Any) -> Iterator[dict[str, Any]]:
    """Frames as a manifest has them."""
    first, rate, told = 0, pack.header.rate_hz, iter(abouts if isinstance(abouts, list) else [])
    for settled, samples, ways in pack.frames(entry).tolist():
        if settled != NO_PATTERN:
            about = next(told, None)
            rows = [pack.way(at) for at in ways]
            yield {
                **DEFAULTS, **(about if isinstance(about, dict) else {}),
                "start_s": first / rate, "settled_s": (first + settled) / rate, "end_s": (first + samples) / rate,
                "omega": [row.omega for row in rows], "moving": [row.moving for row in rows],
                "target": [list(row.target) for row in rows], "wish": [list(row.wish) for row in rows],
                "tones": [list(row.tones) for row in rows],
                "phase": [list(row.phase or [None] * pack.header.cols) for row in rows],
            }  # fmt: skip
        first += samples


def _channels(path: Path, pack: Pack) -> list[dict[str, Any]]:
    try:
        return [channel.as_dict() for channel in channels_of(Device.model_validate(pack.device))]
    except ValidationError as error:
        raise UnreadableWaveform(f"{path}: device: {complaint_of(error).sentence}") from None


def _check_header(path: Path, pack: Pack, device: Device) -> None:
    """What the header says for a firmware is what the profile says."""
    header = pack.header
    said = (header.rows, header.cols, header.channels, header.rate_hz)
    if said != (device.rows, device.cols, len(channels_of(device)), device.amplifier.rate_hz):
        raise UnreadableWaveform(f"{path}: header and device profile do not agree; write the pack again")
