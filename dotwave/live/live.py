"""A grid that shows what comes, while it comes: the latest wins."""

from __future__ import annotations

import random
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from types import TracebackType
from typing import Self

from chainsim import Device
from drivers import (
    Capabilities,
    ControllerSpec,
    DriverError,
    HostSession,
    KeyEvent,
    LiveEnded,
    LiveMessages,
    LoopLine,
    SerialLine,
    StreamReport,
    Timing,
    Uart,
    VirtualController,
    run_session,
)
from encoders import CellGrid, Frame, TargetPattern, TextOptions, TextSource, are_cells

from ..api.scenes import AnyDevice, device as device_of
from ..errors import AppError
from ..scenes import shape_of, text_scene
from .core import LiveCore
from .state import LiveState

__all__ = ["Live"]

PATIENCE_S = 10.0
CLOSING_S = 5.0
IDLE_PLAN_S = 0.05
SWITCH_S = 0.0005


class Live:
    """Shows patterns on a grid while they come; a context manager.

    `show` returns at once. A window that comes while the grid is on its way waits; one that comes meanwhile takes its
    place, so none is shown that is no longer true. Every method may be called from any thread.

    Parameters
    ----------
    device : Device, name, file or mapping
        As `dotwave.device` takes it.
    sink : str or callable
        ``controller:/dev/ttyACM0``, or ``none:`` to play to nobody at the same pace; or what opens a line.
    lead_s : float
        Seconds of samples that are kept ahead of what is played; more where a busy machine needs them.
    idle_s : float
        Seconds that a pattern stands after `hold`; then the grid rests.
    on_key : callable, optional
        Gets every `drivers.KeyEvent` of the keys beside the grid, on a thread of `Live`; it must return soon.
    dots : int, optional
        Of a cell, 6 or 8; None: 8 where the grid's rows make cells of four and not of three.
    baud : int, optional
        Bits per second of a port, None: the controller's own.
    clock : callable
        Seconds, any origin.

    Attributes
    ----------
    device : Device
        The hardware.

    Raises
    ------
    AppError
        When there is no such sink for live playing.
    drivers.DriverError
        When the port cannot be opened.

    Examples
    --------
    >>> import dotwave as dw
    >>> with dw.Live("paper-6x6") as live:
    ...     live.show("⠓⠊")
    ...     live.cells_per_line, live.lines
    (3, 2)
    """

    def __init__(
        self,
        device: AnyDevice,
        sink: str | Callable[[], SerialLine] = "none:",
        *,
        lead_s: float = 0.06,
        idle_s: float = 30.0,
        on_key: Callable[[KeyEvent], None] | None = None,
        dots: int | None = None,
        baud: int | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        if not 0.02 <= lead_s <= 1:
            raise AppError(f"lead_s: expected 0.02 to 1 s, got {lead_s}")
        if not idle_s >= 0:
            raise AppError(f"idle_s: expected a number of seconds from 0 on, got {idle_s}")
        self.device: Device = device_of(device)
        self._cells = CellGrid(shape_of(self.device), dots)
        self._lead_s, self._clock = lead_s, clock
        self._open_line = self._line_to(sink, baud)
        self._core = LiveCore(self.device, idle_s=idle_s, clock=clock)
        # What is compiled, or read from the disk, at the first pattern must not hold up a stream.
        self._core.warm_up()
        number = random.SystemRandom().randrange(1, 1 << 32)
        self._session = HostSession(
            lambda found: self._messages(found, number), session=number, timing=Timing(lead_s=lead_s), on_key=on_key
        )
        self._error: DriverError | None = None
        self._stop, self._ended = threading.Event(), threading.Event()
        first: list[SerialLine] = [self._open_line()]
        play = threading.Thread(target=self._play, args=(first,), name="dotwave live", daemon=True)
        plan = threading.Thread(target=self._plan, name="dotwave live planner", daemon=True)
        self._threads = plan, play
        for thread in self._threads:
            thread.start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        try:
            self.close()
        except DriverError:
            # What went wrong first is what a person has to hear.
            if error is None:
                raise

    @property
    def lines(self) -> int:
        """Lines of cells that the grid has room for."""
        return self._cells.lines

    @property
    def cells_per_line(self) -> int:
        """Cells in each of them."""
        return self._cells.cells_per_line

    def show(self, what: TargetPattern | str, note: str | None = None) -> None:
        """Show this next, whatever came before; returns at once.

        Parameters
        ----------
        what : TargetPattern or str
            A pattern of the grid's shape; Unicode Braille, cell for cell in reading order (a newline ends a line, what
            is missing is blank); or a text, of which the first page is shown.
        note : str, optional
            What it says, for mirrors and recordings; None: of a text the text, else nothing.

        Raises
        ------
        AppError
            When a pattern is not of the grid's shape.
        encoders.EncodeError
            When there are more cells than the grid has room for, or a text cannot be written in Braille.
        drivers.DriverError
            When playing has come to an end by an error.

        Examples
        --------
        >>> import dotwave as dw
        >>> with dw.Live("linked-6x6") as live:
        ...     live.show("⠓⠑", note="he")
        ...     live.show("hello")
        """
        frame = self._frame(what, note)
        self._raise_error()
        self._core.show(frame)

    def hold(self) -> None:
        """No source is left: what stands goes on standing, and rests after `idle_s`, unless something is shown.

        Examples
        --------
        >>> import dotwave as dw
        >>> with dw.Live("paper-6x6", idle_s=5.0) as live:
        ...     live.show("⠓⠊")
        ...     live.hold()
        """
        self._core.hold()

    def rest(self) -> None:
        """Go to rest now.

        Examples
        --------
        >>> import dotwave as dw
        >>> with dw.Live("paper-6x6") as live:
        ...     live.rest()
        """
        self._core.rest()

    def close(self) -> None:
        """Go to rest and end; returns when the output is at zero. A second time nothing happens.

        On Ctrl-C meanwhile, or when the way to rest is not gone in time, the controller is stopped, which takes its
        output to zero on its own ramp.

        Raises
        ------
        drivers.DriverError
            When playing had come to an end by an error before.

        Examples
        --------
        >>> import dotwave as dw
        >>> live = dw.Live("paper-6x6")
        >>> live.close()
        >>> live.state.connected
        False
        """
        self._core.close()
        try:
            self._ended.wait(CLOSING_S)
        finally:
            self._stop.set()
            for thread in self._threads:
                thread.join(CLOSING_S)
        self._raise_error()

    @property
    def state(self) -> LiveState:
        """What stands, what is under way, and how long the last change took.

        Examples
        --------
        >>> import dotwave as dw
        >>> with dw.Live("paper-6x6") as live:
        ...     live.state.resting
        True
        """
        session = self._session
        connected = session.capabilities is not None and not self._ended.is_set()
        return replace(self._core.state, connected=connected, underruns=session.report.underruns)

    @property
    def report(self) -> StreamReport:
        """How the line does so far."""
        return self._session.report

    def _frame(self, what: TargetPattern | str, note: str | None) -> Frame:
        if isinstance(what, TargetPattern):
            wanted = self.device.rows, self.device.cols
            if what.amplitude.shape != wanted:
                raise AppError(f"pattern: expected {wanted[0]} x {wanted[1]} numbers, got {what.amplitude.shape}")
            return Frame(what, 1.0, text=note or "")
        if are_cells(what) or not what.strip():
            return self._cells.frame(what.strip(" "), note or "")
        options = TextOptions(dots=self._cells.dots)
        first = next(iter(text_scene(TextSource.of_text(what), shape_of(self.device), options).frames))
        return self._cells.frame(first.cells, first.text if note is None else note)

    def _messages(self, found: Capabilities, number: int) -> LiveMessages:
        return LiveMessages(
            self.device, found, self._core, session=number, encoding=self._cells.encoding, prefill_s=self._lead_s / 2
        )

    def _line_to(self, sink: str | Callable[[], SerialLine], baud: int | None) -> Callable[[], SerialLine]:
        if not isinstance(sink, str):
            return sink
        name, _, port = sink.partition(":")
        if name == "controller" and port:
            return lambda: Uart(port) if baud is None else Uart(port, baud)
        if name == "none":
            controller = VirtualController(ControllerSpec.of(self.device), now=self._clock(), name="nobody")
            return lambda: LoopLine(controller, self._clock)
        files = "; a sound card plays written files (dotwave play OUT --audio CARD)" if name == "audio" else ""
        raise AppError(
            f"{sink}: expected controller:PORT or none: to play live, such as controller:/dev/ttyACM0{files}"
        )

    def _play(self, first: list[SerialLine]) -> None:
        def line() -> SerialLine:
            return _StoppableLine(first.pop() if first else self._open_line(), self._stop)

        # Planning is one long piece of work; a stream that waits for its turn must get it soon.
        before = sys.getswitchinterval()
        sys.setswitchinterval(min(before, SWITCH_S))
        try:
            run_session(self._session, line, patience_s=PATIENCE_S, progress=self._core.played, clock=self._clock)
        except (LiveEnded, _Stopped):
            pass
        except DriverError as error:
            self._error = error
        finally:
            sys.setswitchinterval(before)
            self._ended.set()
            self._core.wake()

    def _plan(self) -> None:
        try:
            while not self._ended.is_set():
                if not self._core.plan() and not self._core.plan_ahead():
                    self._core.wait(IDLE_PLAN_S)
        finally:
            # Without it nothing would ever change again.
            self._stop.set()

    def _raise_error(self) -> None:
        if self._error is not None:
            raise self._error


class _Stopped(Exception):
    """Playing is to stop at once."""


class _StoppableLine:
    """A line that ends when it is asked to."""

    def __init__(self, line: SerialLine, stop: threading.Event) -> None:
        if stop.is_set():
            line.close()
            raise _Stopped
        self._line, self._stop = line, stop
        self.write, self.close = line.write, line.close

    def read(self, wait_s: float) -> bytes:
        """As the line's own."""
        if self._stop.is_set():
            raise _Stopped
        return self._line.read(wait_s)
