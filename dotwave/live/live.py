"""A grid that shows what comes, while it comes: the latest wins."""

from __future__ import annotations

import time
from collections.abc import Callable
from types import TracebackType
from typing import Self

from chainsim import Device
from drivers import KeyEvent
from encoders import TargetPattern

from ..api.scenes import AnyDevice
from .state import LiveState

__all__ = ["Live"]

Shown = TargetPattern | str


class Live:
    """Shows patterns on a grid while they come; a context manager.

    `show` returns at once. A window that comes while the grid is on its way waits; one that comes meanwhile takes its
    place, so none is shown that is no longer true. Every method may be called from any thread.

    Parameters
    ----------
    device : Device, name, file or mapping
        As `dotwave.device` takes it.
    sink : str
        ``controller:/dev/ttyACM0``, or ``none:`` to play to nobody at the same pace.
    lead_s : float
        Seconds of samples that are kept ahead of what is played.
    idle_s : float
        Seconds that a pattern stands after `hold`; then the grid rests.
    on_key : callable, optional
        Gets every `KeyEvent` of the buttons beside the grid, on a thread of `Live`; it must return soon.
    clock : callable
        Seconds, any origin.

    Attributes
    ----------
    device : Device
        The hardware.
    lines, cells_per_line : int
        Cells of 2 x 3 dots (2 x 4 on a grid whose rows make cells of four) that the grid has room for.
    """

    def __init__(
        self,
        device: AnyDevice,
        sink: str = "none:",
        *,
        lead_s: float = 0.06,
        idle_s: float = 30.0,
        on_key: Callable[[KeyEvent], None] | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        raise NotImplementedError

    device: Device
    lines: int
    cells_per_line: int

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()

    def show(self, what: Shown, note: str | None = None) -> None:
        """Show this next, whatever came before; returns at once.

        Parameters
        ----------
        what : TargetPattern or str
            A pattern of the grid's shape; Unicode Braille, cell for cell in reading order (newlines are passed over,
            what is missing is blank); or a text, of which the first page is shown.
        note : str, optional
            What it says, for mirrors and recordings; None: of a text the text, else nothing.

        Raises
        ------
        AppError
            When it is not of the grid's shape, or has more cells than the grid.
        DriverError
            When playing has come to an end by an error.
        """
        raise NotImplementedError

    def hold(self) -> None:
        """No source is left: what stands goes on standing, and rests after `idle_s`, unless something is shown."""
        raise NotImplementedError

    def rest(self) -> None:
        """Go to rest now."""
        raise NotImplementedError

    def close(self) -> None:
        """Go to rest and end; returns when the output is at zero.

        Raises
        ------
        DriverError
            When playing had come to an end by an error before.
        """
        raise NotImplementedError

    @property
    def state(self) -> LiveState:
        """What stands, what is under way, and how long the last change took."""
        raise NotImplementedError
