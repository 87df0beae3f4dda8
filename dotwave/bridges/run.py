"""Live sessions and their recordings from beginning to end: what the commands `live` and `replay` do."""

from __future__ import annotations

import asyncio
import statistics
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any, TextIO

from chainsim import Device, load_device
from drivers import KeyEvent, atomic_file, naming
from encoders import CellGrid, LayoutError, TextOptions, resolve_tables

from ..errors import AppError
from ..live.live import Live
from ..live.state import LiveState
from ..plain import printable
from ..scenes import shape_of
from .baum import MOST_CELLS, BaumDisplay
from .brlapi import BrlapiServer
from .brlapi_client import BrlapiDisplay
from .brlapi_port import BrlapiPort
from .canute import CanuteDisplay
from .glyphs import COMPUTER_TABLE, glyphs
from .grid_fold import GridFold
from .key_inputs import KeyFile, TerminalKeys
from .line_source import LineSource
from .mirror import LiveMirror
from .port import WindowPort
from .pty_port import PtyPort
from .replay_port import ReplayPort
from .session import LiveSession
from .session_file import SessionWriter, fitted, read_session
from .stdin_port import StdinPort

__all__ = ["LiveOptions", "LiveReport", "WindowSource", "fold_of", "play_live", "replay"]

_AFTER_REPLAY_S = 1.0


class WindowSource(StrEnum):
    """Where windows come from."""

    BRLAPI = "brlapi"
    BAUM = "baum"
    CANUTE = "canute"
    LINES = "lines"


@dataclass(frozen=True)
class LiveOptions:
    """How a session is run.

    Attributes
    ----------
    to : ``controller:PORT``, or none.
    show : write what is felt to the terminal.
    record : where the session is kept; None for nowhere.
    table : of the characters; None for the source's own.
    cursor : whether it is drawn.
    idle_s : seconds that a pattern stands once nobody is left.
    link : a stable name for a display's port.
    key_file : a file or named pipe with further keys.
    secret : BrlAPI's key file, which clients then must know.
    """

    to: str = "none"
    show: bool = False
    record: Path | None = None
    table: str | None = None
    cursor: bool = True
    idle_s: float = 30.0
    link: Path | None = None
    key_file: Path | None = None
    secret: Path | None = None


@dataclass(frozen=True)
class LiveReport:
    """What a session was.

    Attributes
    ----------
    windows : that came.
    keys : that went back.
    latency_s, worst_s : median and largest, from a window to the moment its pattern stood; None without one.
    state : the grid's last word.
    record : where it was kept, empty for nowhere.
    """

    device: str
    source: str
    sink: str
    windows: int
    keys: int
    latency_s: float | None
    worst_s: float | None
    state: LiveState
    record: str

    @property
    def ok(self) -> bool:
        """The buffer never ran dry, and the last pattern could be made."""
        return not self.state.underruns and not self.state.refused

    def as_dict(self) -> dict[str, Any]:
        """Plain JSON types."""
        return {
            "device": self.device, "source": self.source, "sink": self.sink, "windows": self.windows,
            "shown": self.state.shown, "passed_over": self.state.coalesced, "keys": self.keys,
            "latency_s": self.latency_s, "worst_latency_s": self.worst_s, "underruns": self.state.underruns,
            "refused": self.state.refused, "record": self.record, "ok": self.ok,
        }  # fmt: skip

    def as_text(self) -> str:
        """Lines of plain text."""
        lines = [
            f"{self.device}, {self.source} to {self.sink}: {self.windows} windows came, {self.state.shown} stood, "
            f"{self.state.coalesced} were passed over for newer ones; {self.keys} keys went back"
        ]
        if self.latency_s is not None and self.worst_s is not None:
            lines.append(f"  felt after {1e3 * self.latency_s:.0f} ms (median), {1e3 * self.worst_s:.0f} ms at worst")
        if self.state.underruns:
            lines.append(f"  the buffer ran dry {self.state.underruns} times")
        if self.state.refused:
            lines.append(f"  {self.state.refused}")
        if self.record:
            lines.append(f"  recorded: {self.record}; try `dotwave replay {self.record} --device {self.device}`")
        return "\n".join(lines)


def play_live(device: str, source: WindowSource, options: LiveOptions, out: TextIO | None = None) -> LiveReport:
    """Show what a screen reader writes, until Ctrl-C or the end of the source.

    Parameters
    ----------
    device : profile name or file.
    source : where windows come from.
    options : how.
    out : for what is shown; standard output by default.

    Raises
    ------
    AppError, ChainError, DriverError, EncodeError
        When the device, the table, a port or a file cannot be used, or playing ends by an error.
    """
    profile = load_device(device)
    fold = fold_of(profile)
    if options.link is not None and source not in (WindowSource.BAUM, WindowSource.CANUTE):
        raise AppError(f"--link belongs to --from baum and canute, not to {source}; leave it out")
    if options.secret is not None and source is not WindowSource.BRLAPI:
        raise AppError(f"--key-file belongs to --from brlapi, not to {source}; leave it out")
    return _run(profile, fold, _port(profile, fold, source, options), options, out)


def replay(path: Path, device: str, options: LiveOptions, out: TextIO | None = None) -> LiveReport:
    """Show a recorded session again, window for window and at its own pace.

    Parameters
    ----------
    path : of the recording.
    device : profile name or file; another than it was recorded on will do, if it has the cells.
    options : how.
    out : for what is shown; standard output by default.

    Raises
    ------
    AppError, ChainError, DriverError
        When the recording or the device cannot be used, or playing ends by an error.
    """
    profile = load_device(device)
    fold = fold_of(profile)
    port = ReplayPort(fitted(read_session(path), fold, path))
    return _run(profile, fold, port, options, out)


def fold_of(device: Device) -> GridFold:
    """The cells of a grid, as it shows them.

    Raises
    ------
    AppError
        When it has no room for one.
    """
    try:
        grid = CellGrid(shape_of(device))
    except LayoutError as error:
        raise AppError(f"{device.name}: {error}") from None
    return GridFold(grid.lines, grid.cells_per_line, grid.dots)


def _port(profile: Device, fold: GridFold, source: WindowSource, options: LiveOptions) -> WindowPort:
    if source is WindowSource.LINES:
        text = TextOptions(dots=fold.dots) if options.table is None else TextOptions(options.table, dots=fold.dots)
        resolve_tables(text.table)
        return StdinPort(LineSource(shape_of(profile), text))
    if source is WindowSource.BRLAPI:
        display = BrlapiDisplay(fold.columns, fold.rows, profile.name, _secret(options.secret))
        return BrlapiPort(BrlapiServer(display, glyphs(options.table or COMPUTER_TABLE)))
    if options.table is not None:
        raise AppError(f"--table: over {source} the screen reader writes cells; choose the table there")
    if source is WindowSource.BAUM:
        return PtyPort(source, BaumDisplay(min(fold.columns, MOST_CELLS)), options.link)
    return PtyPort(source, CanuteDisplay(min(fold.columns, 255), min(fold.rows, 255)), options.link)


def _secret(path: Path | None) -> bytes | None:
    if path is None:
        return None
    with naming(path):
        secret = path.read_bytes()[:4096]
    if not secret.strip():
        raise AppError(f"{path}: empty, and everybody would be let in; write a key into it, or leave --key-file out")
    return secret


def _run(profile: Device, fold: GridFold, port: WindowPort, options: LiveOptions, out: TextIO | None) -> LiveReport:
    sink = "none:" if options.to == "none" else options.to
    idle_s = _AFTER_REPLAY_S if isinstance(port, ReplayPort) else options.idle_s
    sessions: list[LiveSession] = []

    def pressed(event: KeyEvent) -> None:
        for session in sessions:
            session.on_grid_key(event)

    with ExitStack() as stack:
        key_file = None if options.key_file is None else KeyFile(options.key_file)
        if key_file is not None:
            stack.callback(key_file.close)
        writer = stack.enter_context(_writer(options.record, profile, port, fold))
        live = stack.enter_context(Live(profile, sink, idle_s=idle_s, on_key=pressed))
        terminal = TerminalKeys() if port.kind != WindowSource.LINES else None
        if terminal is not None:
            stack.callback(terminal.close)
        mirror = LiveMirror(out or sys.stdout, fold.per_line) if options.show else None
        session = LiveSession(
            port, live, fold, blink=options.cursor, writer=writer, mirror=mirror, key_file=key_file, terminal=terminal
        )
        sessions.append(session)
        # Ctrl-C is how such a session ends.
        with suppress(KeyboardInterrupt):
            asyncio.run(session.run(_say))
    late = session.counts.latencies_s
    return LiveReport(
        profile.name, port.kind, options.to, session.counts.windows, session.counts.keys,
        statistics.median(late) if late else None, max(late, default=None), live.state, str(options.record or ""),
    )  # fmt: skip


@contextmanager
def _writer(path: Path | None, profile: Device, port: WindowPort, fold: GridFold) -> Iterator[SessionWriter | None]:
    if path is None:
        yield None
        return
    if path.suffix != ".jsonl":
        raise AppError(f"--record {path}: sessions are kept as .jsonl; give it that ending")
    with atomic_file(path) as file:
        yield SessionWriter(file, profile.name, port.kind, fold.columns, fold.rows)


def _say(line: str) -> None:
    sys.stderr.write(printable(line) + "\n")
    sys.stderr.flush()
