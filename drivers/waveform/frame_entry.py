"""A planned frame as it stands in a manifest."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, replace
from typing import Any

import numpy as np

from chainsim import Device
from encoders import SMOOTHNESS
from planner import FramePlan, OperatingPoint

from ..errors import WaveformError

__all__ = ["frame_entry"]

DIGITS = 12  # significant digits of a target in the file


def frame_entry(device: Device, frame: FramePlan, number: int) -> dict[str, Any]:
    """A frame as it stands in a manifest, `number` in it; raises WaveformError where that cannot say it."""
    assert frame.frame is not None
    assert frame.wish is not None
    rows = [tuple(states) for states in _by_row(device, frame)]
    places = [f"frame {number}, row {index}" for index in range(device.rows)]
    moving = [_moving(row, place) for row, place in zip(rows, places, strict=True)]
    mark = {
        "start_s": frame.start_s,
        "settled_s": frame.settled_s,
        "end_s": frame.end_s,
        "moving": moving,
        "omega": [
            _common_omega(row, place) if moves else 0.0 for row, place, moves in zip(rows, places, moving, strict=True)
        ],
        "target": [[_rounded(v) for state in row for v in state.target.tolist()] for row in rows],
        "wish": [[None if np.isnan(v) else _rounded(v) for v in row] for row in frame.wish.level.tolist()],
        "cells": frame.frame.cells,
        "text": frame.frame.text,
        "outcome": frame.outcome.value,
        "page": frame.frame.page,
        "span": list(frame.frame.span),
    }
    goes_on, page_number = [asdict(one) for one in frame.frame.goes_on], frame.frame.number
    rare = {"contrast_db": frame.wish.contrast_db, "goes_on": goes_on, "number": page_number and asdict(page_number)}
    mark |= {key: value for key, value in rare.items() if value}
    if frame.frame.travels:
        mark["smoothness"] = SMOOTHNESS
    if any(state.modulated for state in frame.states):
        mark["modulated"] = [any(state.modulated for state in row) for row in rows]
    if any(state.walks for state in frame.states):
        mark["tones"] = [sorted({tone.omega for state in row for tone in state.tones if not tone.side}) for row in rows]
    if any(state.beats is not None for state in frame.states):
        mark["beats"] = [next((state.beats for state in row if state.beats is not None), None) for row in rows]
    if any(state.phase is not None for state in frame.states):
        mark["phase"] = [[phase for state in row for phase in _phases(state)] for row in rows]
    if frame.spread is not None:
        mark["spread"] = frame.spread.as_dict()
    return mark


def _by_row(device: Device, frame: FramePlan) -> Iterator[Sequence[OperatingPoint]]:
    """The states of every row; of a grid that is one chain its parts."""
    per_row, cols = device.chains_per_row, device.cols
    for row in range(device.rows):
        if device.grid:
            own = slice(row * cols, (row + 1) * cols)
            whole = frame.states[0]
            phase = None if whole.phase is None else whole.phase[own]
            yield [replace(whole, target=whole.target[own], phase=phase)]
        else:
            yield frame.states[row * per_row : (row + 1) * per_row]


def _moving(states: tuple[OperatingPoint, ...], place: str) -> bool:
    moving = any(state.moving for state in states)
    if moving and any(np.any(state.bias) for state in states):
        raise WaveformError(f"{place}: some of its chains vibrate and some stand still")
    return moving


def _phases(state: OperatingPoint) -> list[float | None]:
    if state.phase is None:
        return [None] * len(state.target)
    return [None if np.isnan(phase) else _rounded(phase) for phase in state.phase.tolist()]


def _common_omega(states: tuple[OperatingPoint, ...], place: str) -> float:
    driven = {state.omega for state in states if state.epsilon} or {states[0].omega}
    if len(driven) > 1:
        raise WaveformError(f"{place}: its chains are driven at omega {sorted(driven)}; plan one omega for a row")
    return float(driven.pop())


def _rounded(value: float) -> float:
    return float(f"{value:.{DIGITS}g}")
