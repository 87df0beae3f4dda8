"""A stand-in for a controller: what would be felt, while something plays to it."""

from __future__ import annotations

import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from drivers import ControllerSpec, Emulator

from ...api.scenes import device as device_of
from ...icon_sets.words import in_words
from .tell import Tell

__all__ = ["do"]

STEP_S, SHOW_EVERY_S = 0.002, 0.2
RAISED = 0.5
MOST_S = 8 * 3600.0


def do(folder: Path, asked: Mapping[str, Any], tell: Tell) -> dict[str, Any]:
    """Stand in until Ctrl-C.

    Parameters
    ----------
    asked : `device`, a profile's name or file.
    """
    device = device_of(asked["device"])
    emulator = Emulator(device, ControllerSpec.of(device))
    began = shown = time.monotonic()
    before: dict[str, Any] = {}
    try:
        while time.monotonic() - began < MOST_S:
            emulator.step(STEP_S)
            if time.monotonic() - shown < SHOW_EVERY_S:
                continue
            shown = time.monotonic()
            now = _seen(emulator)
            if now != before:
                before = now
                tell(now)
    finally:
        emulator.close()
    return {"ok": True, "live": False, "lines": [f"The stand-in for {device.name} has ended."]}


def _seen(emulator: Emulator) -> dict[str, Any]:
    status = emulator.status()
    # What rings down after the end is not integrated any more.
    levels = 0.0 * status.levels if emulator.idle else status.levels.round(2)
    state = status.state.name.lower()
    felt = in_words((levels >= RAISED).astype(np.float64))
    words = f"{state} at {status.played_s:.1f} s, {status.underruns} underruns. {felt}"
    return {"port": emulator.port, "words": words, "levels": levels.tolist(), "volts": round(status.peak_volts, 2)}
