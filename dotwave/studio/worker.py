"""The process that does one piece of long work for the studio: ``python -m dotwave.studio.worker``."""

from __future__ import annotations

import json
import os
import signal
import sys
import threading
import time
from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from typing import IO, Any

from drivers import atomic_file

from ..errors import bad_input
from ..progress import told_to

__all__ = ["WORK", "main"]

WORK = ("device", "emulator", "icons", "live", "play", "tradeoff", "write")
"""Modules of `dotwave.studio.work`; each has ``do(folder, asked, tell)``, which gives plain JSON types.

`tell` takes what there is to see meanwhile, also plain JSON types.
"""

SAY_EVERY_S = 0.05


class _Line:
    """Says how things are, a JSON object a line."""

    def __init__(self, out: IO[str]) -> None:
        self._out = out
        self._last = -SAY_EVERY_S

    def progress(self, label: str, done: float, total: float | None) -> None:
        """How far the work is; not more often than a person can see."""
        now = time.monotonic()
        if now - self._last >= SAY_EVERY_S:
            self._last = now
            self.say(label=label, done=done, total=total)

    def show(self, shown: Mapping[str, Any]) -> None:
        """What there is to see."""
        self.say(shown=dict(shown))

    def say(self, **told: Any) -> None:
        """One object."""
        self._out.write(json.dumps(told) + "\n")
        self._out.flush()


def _end_when_asked() -> None:
    """Ctrl-C for the main thread at a line of standard input, and at its end: nobody waits for us any more."""
    sys.stdin.readline()
    signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGINT)


def _order() -> dict[str, Any]:
    order = json.loads(sys.stdin.readline())
    if order["work"] not in WORK:
        raise ValueError(f"no such work: {order['work']}")
    return dict(order)


def main() -> int:
    """Do what the first line of standard input asks."""
    # What libraries print is not for whoever reads our lines.
    line = _Line(os.fdopen(os.dup(1), "w", encoding="utf-8"))
    os.dup2(2, 1)
    order = _order()
    threading.Thread(target=_end_when_asked, daemon=True).start()
    folder = Path(order["folder"])
    refusals: tuple[type[Exception], ...] = (*bad_input(), OSError)
    try:
        with told_to(line.progress):
            answer = import_module(f".work.{order['work']}", __package__).do(folder, order["asked"], line.show)
        with atomic_file(folder / "answer.json") as file:
            file.write(json.dumps(answer, ensure_ascii=False).encode())
    except KeyboardInterrupt:
        line.say(error="Cancelled.")
        return 130
    except refusals as error:
        line.say(error=" ".join(str(error).split()))
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
