"""Playing a written waveform to a sink, behind the safety gate; a dry run unless live."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import nullcontext
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

from drivers import (
    GateLimits,
    GateReport,
    Manifest,
    OpenSink,
    SampleReader,
    SinkReport,
    open_sink,
    pass_gate,
    read_waveform,
    serial_ports,
)

from ..errors import AppError
from ..progress import progress
from .adapting import Adapting

__all__ = ["PlayReport", "PortsReport", "list_ports", "play"]

SINKS = "give one of --port, --audio, --to"


@dataclass(frozen=True)
class PlayReport:
    """What was played, or would be.

    Attributes
    ----------
    live : False after a dry run.
    sink : its name, or none.
    gate : how near the limits it comes.
    said : what the sink says of it.
    seconds : wall time of playing.
    """

    path: str
    device: str
    live: bool
    sink: str
    duration_s: float
    frames: int
    channels: int
    rate_hz: int
    limits: GateLimits
    gate: GateReport
    said: SinkReport = field(default_factory=SinkReport)
    seconds: float = 0.0

    @property
    def ok(self) -> bool:
        """Whether nothing was held up on the way out."""
        return self.said.ok

    @property
    def notes(self) -> tuple[str, ...]:
        """What else to know or do."""
        return self.said.notes if self.live else (*self.said.notes, "Give --live to play it.")

    def as_dict(self) -> dict[str, Any]:
        """Plain JSON types."""
        plain = {name: getattr(self, name) for name in ("path", "device", "live", "sink", "duration_s", "frames")}
        plain |= {"channels": self.channels, "rate_hz": self.rate_hz, "ok": self.ok, "seconds": self.seconds}
        plain |= {"gate": asdict(self.gate), "limits": asdict(self.limits), "notes": list(self.notes)}
        return {**self.said.facts, **plain}

    def as_text(self) -> str:
        """Lines of plain text."""
        return "\n".join(self._lines())

    def _lines(self) -> Iterator[str]:
        state = "played" if self.live else "dry run, nothing was sent"
        yield f"{self.path}: {state}"
        yield (
            f"  {self.duration_s:.2f} s, {self.frames} frames, {self.channels} channels x {self.rate_hz} Hz "
            f"for {self.device}"
        )
        gate, limits = self.gate, self.limits
        yield (
            f"  gate passed: {gate.volts:.1f} of {limits.volts:g} V, {gate.slew_v_per_s:.3g} of "
            f"{limits.slew_v_per_s:.3g} V/s, mean {gate.dc_volts:.2f} of {limits.dc_volts:g} V, duty "
            f"{gate.duty:.0%} of {limits.duty:.0%}"
        )
        yield (
            f"  current {1e3 * gate.current_a:.2f} of {1e3 * limits.current_a:g} mA a channel, "
            f"{1e3 * gate.supply_a:.1f} of {1e3 * limits.supply_a:g} mA in all, heat {1e3 * gate.energy_j:.3f} of "
            f"{1e3 * limits.energy_j:g} mJ a second"
        )
        yield from (f"  {line}" for line in (*self.said.lines, *self.notes))


@dataclass(frozen=True)
class PortsReport:
    """The serial ports of this machine."""

    ports: tuple[tuple[str, str, str], ...]

    def as_dict(self) -> dict[str, Any]:
        """Plain JSON types."""
        return {"ports": [{"name": n, "description": d, "hardware": h} for n, d, h in self.ports]}

    def as_text(self) -> str:
        """Lines of plain text."""
        lines = [f"{name}  {description}  {hardware}".rstrip() for name, description, hardware in self.ports]
        return "\n".join(lines) or "No serial port was found; plug the controller in, or run `dotwave emulate`."


def list_ports() -> PortsReport:
    """The serial ports of this machine.

    Raises
    ------
    DriverError
        When pyserial is not installed.
    """
    return PortsReport(tuple((port.name, port.description, port.hardware) for port in serial_ports()))


def play(
    path: Path,
    *,
    live: bool,
    port: str | None = None,
    board: bool = False,
    audio: str | None = None,
    to: str | None = None,
    limits: GateLimits | None = None,
    adapt: Adapting | None = None,
    icon: str | None = None,
    **options: object,
) -> PlayReport:
    """Hold a written waveform against the safety gate and, when `live`, play it.

    Parameters
    ----------
    port : of the controller, or with `board` of the DRV2667 board.
    audio : a sound card's name or number.
    to : any sink, as ``name:place``.
    limits : of the actuators and the amplifier where they are known; None: those of the
        profile.
    adapt : correct while playing, from what the controller measures.
    icon : name of the entry of a pack that has several.
    options : of the sink (`drivers.open_sink`); None is left out.

    Raises
    ------
    AppError
        When there is no one sink to play to.
    DriverError
        When the gate refuses, the hardware does not fit, or the line is lost.
    """
    address = _address(port, board, audio, to)
    if live and (address is None or (board and port is None)):
        raise AppError(f"--live: {SINKS}; `dotwave ports` lists ports")
    manifest, reader = read_waveform(path, icon)
    limits = limits or GateLimits.of(manifest.device, len(manifest.channels))
    given = {name: value for name, value in options.items() if value is not None}
    adaptation = None
    if adapt is not None:
        if address is None or not address.startswith("controller:"):
            raise AppError("--adapt: only a controller measures what it plays; give its --port")
        if given.get("parametric"):
            raise AppError("--adapt and --parametric: what is corrected goes out as samples; leave one of them out")
        adaptation, plan = adapt.to(manifest)
        given |= {"frames": plan.frames, "on_measured": adaptation.learned, "frame_limits": limits}
    with nullcontext() if address is None else open_sink(address, limits=limits, **given) as sink:
        gate, said = _checked(sink, manifest, reader, limits)
        report = PlayReport(
            path=str(reader.path), device=manifest.device.name, live=live, sink=sink.name if sink else "none",
            duration_s=manifest.duration_s, frames=len(manifest.frames), channels=len(manifest.channels),
            rate_hz=manifest.rate_hz, limits=limits, gate=gate, said=said,
        )  # fmt: skip
        if sink is None or not live:
            return report
        began = time.perf_counter()
        with progress("playing") as update:
            said = sink.play(manifest, reader, lambda done: update(done, manifest.duration_s))
        if adaptation is not None:
            told = adaptation.report()
            said = replace(
                said, facts={**said.facts, "adaptation": told.as_dict()}, lines=(*said.lines, *told.as_lines())
            )
        return replace(report, said=said, seconds=time.perf_counter() - began)


def _address(port: str | None, board: bool, audio: str | None, to: str | None) -> str | None:
    """The one sink that is asked for; None for none."""
    if (port is not None or board) and audio is not None:
        raise AppError(f"{'--board' if board else '--port'} and --audio: {SINKS}, not both")
    if to is not None and (port is not None or board or audio is not None):
        raise AppError(f"--to and another: {SINKS}, not both")
    if board:
        return f"drv2667:{port or ''}"
    if audio is not None:
        return f"audio:{audio}"
    return to if port is None else f"controller:{port}"


def _checked(
    sink: OpenSink | None, manifest: Manifest, reader: SampleReader, limits: GateLimits
) -> tuple[GateReport, SinkReport]:
    with progress("checking") as update:

        def told(done: float) -> None:
            update(done, manifest.duration_s)

        if sink is None:
            return pass_gate(manifest, reader, limits, progress=told), SinkReport()
        checked = sink.check(manifest, reader, told)
        return checked.gate, checked.report
