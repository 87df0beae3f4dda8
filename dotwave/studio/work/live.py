"""What a screen reader writes, shown while it writes it."""

from __future__ import annotations

import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ...bridges.run import LiveOptions, WindowSource, play_live
from .tell import Tell

__all__ = ["do"]

LINES_KEPT = 12


class _Lines(io.StringIO):
    """Tells the latest lines."""

    def __init__(self, tell: Tell) -> None:
        super().__init__()
        self._tell, self._lines = tell, [""]

    def write(self, words: str, /) -> int:
        *whole, rest = (self._lines.pop() + words).split("\n")
        self._lines = [*self._lines, *whole][-LINES_KEPT:]
        if whole:
            self._tell({"words": self._lines[-1], "lines": list(self._lines)})
        self._lines.append(rest)
        return len(words)


def do(folder: Path, asked: Mapping[str, Any], tell: Tell) -> dict[str, Any]:
    """Show windows until Ctrl-C.

    Parameters
    ----------
    asked : `device`, `source` of windows, and `sink` (empty: nothing is played).
    """
    options = LiveOptions(to=asked["sink"] or "none", show=True, record=folder / "session.jsonl")
    report = play_live(asked["device"], WindowSource(asked["source"]), options, _Lines(tell))
    return {"ok": report.ok, "live": bool(asked["sink"]), "lines": report.as_text().splitlines()}
