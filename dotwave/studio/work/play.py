"""A written waveform held against the safety gate and, when asked for, played."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ...playing.play import play
from .tell import Tell

__all__ = ["do"]


def do(folder: Path, asked: Mapping[str, Any], tell: Tell) -> dict[str, Any]:
    """Play, or only check, and say how it went; Ctrl-C brings the outputs to zero.

    Parameters
    ----------
    asked : `waveform` (a path), `sink` (empty for none), `live` (really play).
    """
    report = play(Path(asked["waveform"]), live=bool(asked["live"]), to=asked["sink"] or None)
    return {"ok": report.ok, "live": report.live, "lines": report.as_text().splitlines()}
