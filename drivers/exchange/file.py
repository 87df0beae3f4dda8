"""Haptic exchange files: MPEG HJIF for the whole grid, Apple AHAP and Meta .haptic for one actuator or the mean.

Sources: ISO/IEC 23090-31 (HJIF, as MPEG's reference software reads it), Apple's AHAP schema (version 1.0),
Meta's .haptic 1.0. Each keeps levels and their times to a millisecond; only HJIF keeps the grid and the phase.
"""

from __future__ import annotations

import json
from pathlib import Path

from planner import Plan

from ..errors import UnreadableWaveform
from ..files.whole import atomic_file, first_of_plain, naming
from ..formats.table import EXCHANGE_SUFFIXES, format_of
from ..waveform.manifest import MOST_BYTES
from .curves import HapticCurves

__all__ = ["read_exchange", "write_exchange"]


def write_exchange(plan: Plan, path: Path | str, *, actuator: tuple[int, int] | None = None) -> None:
    """Write `plan` as the haptic file that the ending of `path` names.

    Parameters
    ----------
    actuator : (row, col) for .ahap and .haptic; None is the mean over the grid. HJIF takes the whole grid.

    Raises
    ------
    WaveformError
        When the plan holds patterns still, or the grid has no such actuator.
    FileError
        When the ending is none of these, or the file system refuses.
    """
    path = Path(path)
    content = format_of(path, EXCHANGE_SUFFIXES).writer_module().content_of(plan, actuator)
    text = json.dumps(content, ensure_ascii=False, indent=1, allow_nan=False) + "\n"
    with atomic_file(path) as file, naming(path):
        file.write(text.encode())


def read_exchange(path: Path | str) -> HapticCurves:
    """Check a haptic file against the rules of its format and give its curves back.

    Raises
    ------
    FileError
        When it cannot be read, or its ending is none of these.
    UnreadableWaveform
        With the rule it breaks, and where.
    """
    path = Path(path)
    form = format_of(path, EXCHANGE_SUFFIXES)
    raw = first_of_plain(path, MOST_BYTES + 1)
    if len(raw) > MOST_BYTES:
        raise UnreadableWaveform(f"{path}: more than {MOST_BYTES} bytes; a haptic file has at most so many")
    try:
        curves: HapticCurves = form.reader_module().curves_of(json.loads(raw))
    except KeyError as error:
        raise UnreadableWaveform(f"{path}: the key {error} is missing") from None
    except (ValueError, TypeError, AttributeError, IndexError, ArithmeticError, RecursionError) as error:
        raise UnreadableWaveform(f"{path}: {error}") from None
    return curves
