"""How far a set of icons is: a bar with rate and time left on a terminal, or told to whoever listens."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from ..progress import Update, listening, progress

__all__ = ["icon_progress"]


@contextmanager
def icon_progress(label: str, total: int) -> Iterator[Callable[[bool], None]]:
    """A function to call after each icon: with True when it was worked on, False when an earlier run had done it.

    Only the former count for the rate.
    """
    if listening() is not None:
        with progress(label) as update:
            yield _counted(update, total)
        return
    if not sys.stderr.isatty():
        yield lambda worked: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

    columns = (TextColumn(label), BarColumn(), MofNCompleteColumn(), TextColumn("{task.fields[pace]}"))
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(label, total=total, pace="")
        began, done, ready = time.monotonic(), 0, 0

        def step(worked: bool) -> None:
            nonlocal done, ready
            done, ready = done + worked, ready + (not worked)
            rate = done / max(time.monotonic() - began, 1e-3)
            pace = f"{rate:.0f}/s, {(total - ready - done) / rate:.0f} s left" if rate else ""
            bar.update(task, completed=ready + done, pace=pace)

        yield step


def _counted(update: Update, total: int) -> Callable[[bool], None]:
    done = 0

    def step(worked: bool) -> None:
        nonlocal done
        done += 1
        update(done, total)

    return step
