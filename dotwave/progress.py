"""A bar on stderr for whatever takes more than two seconds; silent when stderr is not a terminal.

A program without a terminal may listen instead (`told_to`).
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TYPE_CHECKING, Protocol, cast

if TYPE_CHECKING:
    from rich.progress import Progress, TaskID

__all__ = ["Update", "listening", "progress", "told_to"]

PATIENCE_S = 2.0

Listener = Callable[[str, float, float | None], None]
_listener: ContextVar[Listener | None] = ContextVar("listener", default=None)


class Update(Protocol):
    """Tells the bar how far the work is: `done` of `total`, in any unit; total None when unknown."""

    def __call__(self, done: float, total: float | None = None) -> None:
        """Show `done` of `total`."""
        ...


class _Bar:
    def __init__(self, label: str) -> None:
        self.label = label
        self.started = time.monotonic()
        self.bar: Progress | None = None
        self.task = cast("TaskID", 0)

    def __call__(self, done: float, total: float | None = None) -> None:
        if self.bar is None and time.monotonic() - self.started >= PATIENCE_S:
            self._open()
        if self.bar is not None:
            self.bar.update(self.task, completed=done, total=total)

    def _open(self) -> None:
        # Imported here: most commands end before the bar is due, and rich takes longer than they do.
        from rich.console import Console
        from rich.progress import Progress

        self.bar = Progress(console=Console(stderr=True), transient=True)
        self.bar.start()
        self.task = self.bar.add_task(self.label, total=None)

    def close(self) -> None:
        if self.bar is not None:
            self.bar.stop()


@contextmanager
def progress(label: str) -> Iterator[Update]:
    """A function to call as often as wanted; it draws a bar once the work has taken two seconds.

    Parameters
    ----------
    label : what is being done, in a word or two.
    """
    listener = listening()
    if listener is not None:
        yield lambda done, total=None: listener(label, done, total)
        return
    if not sys.stderr.isatty():
        yield lambda done, total=None: None
        return
    bar = _Bar(label)
    try:
        yield bar
    finally:
        bar.close()


def listening() -> Listener | None:
    """Who listens; None where nobody does."""
    return _listener.get()


@contextmanager
def told_to(listener: Listener) -> Iterator[None]:
    """While the body runs, `listener` is called with label, done and total in place of a bar."""
    before = _listener.set(listener)
    try:
        yield
    finally:
        _listener.reset(before)
