"""Playing a written waveform: the gate, then a controller, the DRV2667 board or a sound card; a dry run unless live."""

from __future__ import annotations

import random
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

from drivers import (
    BOARD_BAUD,
    BUFFER_S,
    BoardPlan,
    Firmware,
    GateLimits,
    GateReport,
    HostSession,
    Manifest,
    SampleReader,
    StreamReport,
    Timing,
    Uart,
    grid_line,
    parse_outputs,
    pass_gate,
    plan_board,
    play_audio,
    play_grid_lines,
    read_waveform,
    run_session,
    serial_ports,
    session_messages,
)

from ..errors import AppError
from ..progress import progress

__all__ = ["PlayReport", "PortsReport", "buffer_notes", "list_ports", "play"]

SINKS = "give one of --port, --audio"


@dataclass(frozen=True)
class PlayReport:
    """What was played, or would be.

    Attributes
    ----------
    live : False after a dry run. sink : controller, drv2667, audio, or none. gate : how near the limits it comes.
    stream : of a controller. board : of the DRV2667. seconds : wall time of playing.
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
    stream: StreamReport | None = None
    board: BoardPlan | None = None
    seconds: float = 0.0
    notes: tuple[str, ...] = field(default=())

    @property
    def ok(self) -> bool:
        """Whether nothing was held up on the way out."""
        return self.stream is None or (self.stream.underruns == 0 and self.stream.lost_s == 0)

    def as_dict(self) -> dict[str, Any]:
        """Plain JSON types."""
        plain = {name: getattr(self, name) for name in ("path", "device", "live", "sink", "duration_s", "frames")}
        plain |= {"channels": self.channels, "rate_hz": self.rate_hz, "ok": self.ok, "seconds": self.seconds}
        plain |= {"gate": asdict(self.gate), "limits": asdict(self.limits), "notes": list(self.notes)}
        if self.stream is not None:
            plain["stream"] = _stream_dict(self.stream)
        if self.board is not None:
            plain["board"] = _board_dict(self.board)
        return plain

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
        if self.board is not None:
            board = self.board
            yield (
                f"  board: gain {board.gain}, frequency off by {board.frequency_error_hz:.2f} Hz, level off by "
                f"{board.level_error:.1%}, loading {1e3 * board.load_s:.0f} ms of I2C, start skew "
                f"{1e3 * board.skew_s:.1f} ms"
            )
        if self.stream is not None:
            yield from _stream_lines(self.stream)
        yield from (f"  {note}" for note in self.notes)


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
    baud: int | None = None,
    patience_s: float = 10.0,
    board: bool = False,
    firmware: Firmware = Firmware.TEST_PIXEL,
    audio: str | None = None,
    mapping: str = "",
    limits: GateLimits | None = None,
) -> PlayReport:
    """Hold a written waveform against the safety gate and, when `live`, play it.

    Parameters
    ----------
    port : of the controller, or with `board` of the DRV2667 board. baud : bits per second, None: its own.
    patience_s : how long to wait for a controller that is not heard. firmware : on the board.
    audio : a sound card's name or number. mapping : ``channel:output,...`` of the sound card.
    limits : of the actuators and the amplifier where they are known; None: those of the profile.

    Raises
    ------
    AppError
        When there is no one sink to play to.
    DriverError
        When the gate refuses, the hardware does not fit, or the line is lost.
    """
    if port is not None and audio is not None:
        raise AppError(f"--port and --audio: {SINKS}, not both")
    if live and port is None and audio is None:
        raise AppError(f"--live: {SINKS}; `dotwave ports` lists ports")
    manifest, reader = read_waveform(path)
    limits = limits or GateLimits.of(manifest.device, len(manifest.channels))
    with progress("checking") as update:
        gate = pass_gate(manifest, reader, limits, progress=lambda done: update(done, manifest.duration_s))
    report = PlayReport(
        path=str(reader.path), device=manifest.device.name, live=live, sink="none", duration_s=manifest.duration_s,
        frames=len(manifest.frames), channels=len(manifest.channels), rate_hz=manifest.rate_hz, limits=limits,
        gate=gate,
    )  # fmt: skip
    began = time.perf_counter()
    with progress("playing") as update:

        def told(done: float) -> None:
            update(done, manifest.duration_s)

        if board:
            report = _to_board(report, manifest, reader, firmware, port, baud, told)
        elif audio is not None:
            report = _to_audio(report, manifest, reader, audio, mapping, told)
        elif port is not None:
            report = _to_controller(report, manifest, reader, port, baud, patience_s, told)
    notes = () if live else ("Give --live to play it.",)
    return replace(report, seconds=time.perf_counter() - began, notes=(*report.notes, *notes))


def _to_controller(
    report: PlayReport, manifest: Manifest, reader: SampleReader, port: str, baud: int | None, patience_s: float,
    told: Callable[[float], None],
) -> PlayReport:  # fmt: skip
    if not report.live:
        return replace(report, sink="controller")
    number = random.SystemRandom().randrange(1, 1 << 32)
    session = HostSession(
        lambda found: session_messages(manifest, reader, found, session=number, limits=report.limits),
        session=number,
        timing=Timing(),
    )

    def open_line() -> Uart:
        return Uart(port) if baud is None else Uart(port, baud)

    run_session(session, open_line, patience_s=patience_s, progress=told)
    note = f"Samples went out in 16 bits: off by at most {1e3 * manifest.device.amplifier.volts / 65534:.2f} mV."
    return replace(report, sink="controller", stream=session.report, notes=(note, *buffer_notes(session.report)))


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


def _to_board(
    report: PlayReport, manifest: Manifest, reader: SampleReader, firmware: Firmware, port: str | None,
    baud: int | None, told: Callable[[float], None],
) -> PlayReport:  # fmt: skip
    plan = plan_board(manifest, reader)
    report = replace(report, sink="drv2667", board=plan)
    if not report.live or port is None:
        return report
    lines = [(frame.start_s, grid_line(frame.dots, firmware)) for frame in plan.frames]
    dark = lines[0][1].replace(b"1", b"0") if lines else b""
    line = Uart(port, baud or BOARD_BAUD)
    try:
        play_grid_lines([*lines, (manifest.duration_s, b"")], line, silence=dark, progress=told)
    finally:
        line.close()
    note = "The board got on/off dots and makes its own waveform: no firmware yet loads the records over this line."
    return replace(report, notes=(note,))


def _to_audio(
    report: PlayReport, manifest: Manifest, reader: SampleReader, audio: str, mapping: str,
    told: Callable[[float], None],
) -> PlayReport:  # fmt: skip
    outputs = parse_outputs(mapping, len(manifest.channels))
    if report.live:
        device: str | int | None = int(audio) if audio.isdecimal() else (audio or None)
        play_audio(manifest, reader, device=device, outputs=outputs, progress=told)
    note = "A sound card carries no coupling: links stay as they are." if manifest.coupling else ""
    return replace(report, sink="audio", notes=(note,) if note else ())


def _stream_lines(stream: StreamReport) -> Iterator[str]:
    late, reported = (
        1e3 * max(map(abs, values.values()), default=0.0) for values in (stream.late_s, stream.reported_late_s)
    )
    yield (
        f"  {stream.samples} samples in {stream.packets} packets, {stream.resent} sent again, {stream.reconnects} "
        f"reconnections, {stream.bad_there + stream.bad_here} broken packets seen"
    )
    yield (
        f"  {stream.underruns} underruns, {stream.lost_s:.2f} s lost, least in store "
        f"{1e3 * _finite(stream.least_buffer_s):.0f} ms, frames within {late:.1f} ms of their marks, reported "
        f"within {reported:.1f} ms"
    )


def _stream_dict(stream: StreamReport) -> dict[str, Any]:
    plain = asdict(stream)
    for name in ("late_s", "reported_late_s"):
        plain[name] = {str(frame): late for frame, late in plain[name].items()}
    plain["least_buffer_s"] = _finite(stream.least_buffer_s)
    return plain


def _finite(value: float) -> float:
    return value if value < float("inf") else 0.0


def _board_dict(board: BoardPlan) -> dict[str, Any]:
    frames = [
        {
            "start_s": frame.start_s,
            "duration_s": frame.duration_s,
            "load_s": frame.load_s,
            "skew_s": frame.skew_s,
            "records": [
                {"mux": mux, "port": port, "bytes": [list(bytes(record)) for record in records]}
                for (mux, port), records in sorted(frame.records.items())
            ],
        }
        for frame in board.frames
    ]
    return {
        "gain": board.gain, "frequency_error_hz": board.frequency_error_hz, "level_error": board.level_error,
        "load_s": board.load_s, "skew_s": board.skew_s, "frames": frames,
    }  # fmt: skip
