"""Long work in a process of its own, with progress and cancel; one that is left alone ends by itself.

The process reads what to do as a line of JSON from its standard input and says how far it is in lines of its
standard output (`worker`). A line on its standard input, or its end, is Ctrl-C to it: so it also ends in order, with
outputs at zero, when this server is killed.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
import time
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any

from ..errors import AppError
from .results import Result

__all__ = ["Running", "Tasks"]

MOST_AT_ONCE = 4
UNSEEN_S, LEFT_S = 75.0, 5.0
"""Without a sign of a page (a hidden one gives one a minute), and after a page was closed."""

LOOK_EVERY_S = 0.2
BEGINNING = "starting"
ENDED = "The work ended without an answer; begin it again."


@dataclass
class Running:
    """Work that is going on.

    Attributes
    ----------
    work : module of `dotwave.studio.work`.
    plays : it may move actuators, so it ends when nobody looks any more.
    process : that does it.
    label, done, total : how far it is, in any unit; total None when unknown.
    error : one line when it failed.
    over : it has ended.
    shown : what there is to see of it.
    changes : how often any of these changed.
    unseen_until : by the monotonic clock: what plays ends then, unless a page looks.
    """

    work: str
    plays: bool
    process: subprocess.Popen[str]
    label: str = BEGINNING
    done: float = 0.0
    total: float | None = None
    error: str = ""
    over: bool = False
    changes: int = 0
    shown: dict[str, Any] = field(default_factory=dict)
    unseen_until: float = field(default_factory=lambda: time.monotonic() + UNSEEN_S)

    @property
    def share(self) -> float | None:
        """Done of total, 0 to 1; None when unknown."""
        return None if not self.total else min(1.0, self.done / self.total)

    def look(self) -> None:
        """A page is there."""
        self.unseen_until = time.monotonic() + UNSEEN_S

    def leave(self) -> None:
        """A page was closed; another one may be open, or opening."""
        self.unseen_until = time.monotonic() + LEFT_S

    def watch(self) -> None:
        """End the work when nobody looks any more."""
        while not self.over:
            if time.monotonic() > self.unseen_until:
                self.stop()
                return
            time.sleep(LOOK_EVERY_S)

    def stop(self) -> None:
        """Ask it to end, as Ctrl-C would."""
        pipe = self.process.stdin
        if pipe is not None and not pipe.closed:
            with suppress(BrokenPipeError):
                pipe.close()

    def listen(self, lines: IO[str]) -> None:
        """Follow what it says until it ends."""
        with lines:
            for line in lines:
                self._hear(json.loads(line))
        self.stop()
        if self.process.wait() and not self.error:
            self.error = ENDED
        self.over = True
        self.changes += 1

    def _hear(self, told: dict[str, Any]) -> None:
        if "shown" in told and self.label == BEGINNING:
            self.label = "going on"
        for name in ("label", "done", "total", "error", "shown"):
            if name in told:
                setattr(self, name, told[name])
        self.changes += 1


class Tasks:
    """All work of one run of the studio, by the name of its result."""

    def __init__(self) -> None:
        self._running: dict[str, Running] = {}

    def start(self, work: str, result: Result, *, plays: bool = False) -> Running:
        """Begin `dotwave.studio.work.<work>` on what `result` asks.

        Raises
        ------
        AppError
            When too much is going on already, or two would play.
        """
        if plays and self.playing():
            raise AppError("something plays already; STOP it first")
        if sum(not one.over for one in self._running.values()) >= MOST_AT_ONCE:
            raise AppError(f"{MOST_AT_ONCE} pieces of work are going on; wait for one, or cancel one")
        order = {"work": work, "folder": str(result.folder.absolute()), "asked": dict(result.asked)}
        environment = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
        process = subprocess.Popen(
            [sys.executable, "-m", "dotwave.studio.worker"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
            encoding="utf-8", env=environment, cwd=Path.cwd(), start_new_session=True,
        )  # fmt: skip
        if process.stdin is None or process.stdout is None:
            raise RuntimeError("the worker has no pipes")
        process.stdin.write(json.dumps(order) + "\n")
        process.stdin.flush()
        running = self._running[result.name] = Running(work, plays, process)
        threading.Thread(target=running.listen, args=(process.stdout,), daemon=True).start()
        if plays:
            threading.Thread(target=running.watch, daemon=True).start()
        return running

    def of(self, name: str) -> Running | None:
        """The work for a result; None when it was not begun by this run."""
        return self._running.get(name)

    def playing(self) -> list[Running]:
        """All that may move actuators."""
        return [one for one in self._running.values() if one.plays and not one.over]

    def going_on(self) -> dict[str, Running]:
        """All that has not ended, by the name of its result."""
        return {name: one for name, one in self._running.items() if not one.over}

    def close(self, patience_s: float) -> None:
        """Ask all to end, and wait for them."""
        for running in self._running.values():
            running.stop()
        for running in self._running.values():
            try:
                running.process.wait(patience_s)
            except subprocess.TimeoutExpired:
                running.process.kill()
