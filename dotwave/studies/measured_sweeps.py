"""The table of a measured frequency sweep: CSV to what each chain did."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from chainsim import Device, first_bytes

from ..errors import AppError
from ..source import standard_input

if TYPE_CHECKING:
    from planner import Sweep

__all__ = ["COLUMNS", "ChainPlace", "read_sweeps"]

# Columns a table must have, in any order; others are passed over.
COLUMNS = ("row", "col", "frequency_hz", "drive_v", "amplitude", "phase_rad")
MAX_BYTES = 64_000_000
# Short lines make many of few bytes; each takes 0.2 kB of memory.
MOST_POINTS = 2_000_000
# Of anything that was measured, in its unit here; squares of it are still numbers.
HIGHEST = 1e12


@dataclass(frozen=True)
class ChainPlace:
    """Where a chain is: its row, and which chain of that row, both from 0."""

    row: int
    chain: int


class _Point(NamedTuple):
    """One line of the table."""

    line: int
    frequency_hz: float
    drive_v: float
    phasor: complex


def read_sweeps(source: str, device: Device) -> dict[ChainPlace, Sweep]:
    """The sweeps of every chain in a CSV file; ``-`` is standard input.

    Columns: ``row``, ``col`` (from 0), ``frequency_hz``, ``drive_v`` (amplitude of the chain's drive
    ``cos(2 pi f t)``, volts), ``amplitude`` (of the displacement's first harmonic, over the device's length_m) and
    ``phase_rad`` (of it, negative = lag behind the drive). Lines that start with # are passed over. The lines of one
    actuator are in the order in which they were measured, up and down sweeps one after another; every actuator of a
    chain has the same frequencies and drives, and where nothing was measured amplitude and phase are empty.

    Raises
    ------
    AppError
        When the file cannot be read or does not fit; with the line and the column.
    """
    points: dict[tuple[int, int], list[_Point]] = {}
    for number, (actuator, point) in enumerate(_points(source, device)):
        if number == MOST_POINTS:
            raise AppError(f"{source}: more than {MOST_POINTS} points; sweep fewer, or a row at a time")
        points.setdefault(actuator, []).append(point)
    if not points:
        raise AppError(f"{source}: no line with numbers below the header; nothing to fit")
    chains: dict[ChainPlace, dict[int, list[_Point]]] = {}
    for (row, col), measured in sorted(points.items()):
        place = ChainPlace(row, col // device.chain_length)
        chains.setdefault(place, {})[col] = measured
    return {place: _sweep(source, place, columns, device) for place, columns in chains.items()}


def _text(source: str) -> str:
    try:
        raw = standard_input().read(MAX_BYTES + 1) if source == "-" else first_bytes(Path(source), MAX_BYTES + 1)
        if len(raw) > MAX_BYTES:
            raise AppError(f"{source}: more than {MAX_BYTES} bytes; sweep fewer points, or a row at a time")
        return raw.decode("utf-8-sig")
    except OSError as error:
        raise AppError(f"{source}: {error.strerror or error}") from None
    except UnicodeDecodeError as error:
        raise AppError(f"{source}: not UTF-8 at byte {error.start}; save it as CSV in UTF-8") from None


def _points(source: str, device: Device) -> Iterator[tuple[tuple[int, int], _Point]]:
    """Every measured line with the place of its actuator."""
    table = csv.reader(io.StringIO(_text(source), newline=""), skipinitialspace=True)
    places: dict[str, int] | None = None
    try:
        for cells in table:
            if not any(cell.strip() for cell in cells) or cells[0].startswith("#"):
                continue
            if places is None:
                places = _header(source, table.line_num, cells)
            else:
                yield _point(f"{source}:{table.line_num}", table.line_num, cells, places, device)
    except csv.Error as error:
        raise AppError(f"{source}:{table.line_num}: not CSV: {error}") from None
    if places is None:
        raise AppError(f"{source}: empty; expected a header with {', '.join(COLUMNS)}")


def _header(source: str, line: int, cells: list[str]) -> dict[str, int]:
    names = [cell.strip() for cell in cells]
    for name in COLUMNS:
        if names.count(name) != 1:
            problem = "missing" if name not in names else "given twice"
            raise AppError(f"{source}:{line}: column {name} is {problem}; the header needs {', '.join(COLUMNS)}")
    return {name: names.index(name) for name in COLUMNS}


def _point(
    place: str, line: int, cells: list[str], places: dict[str, int], device: Device
) -> tuple[tuple[int, int], _Point]:
    words = {name: cells[at].strip() if at < len(cells) else "" for name, at in places.items()}
    row = _whole(place, "row", words["row"], device.rows)
    col = _whole(place, "col", words["col"], device.cols)
    frequency = _number(place, "frequency_hz", words["frequency_hz"])
    if frequency <= 0:
        raise AppError(f"{place}: column frequency_hz: expected a number > 0, got {words['frequency_hz']}")
    drive = _number(place, "drive_v", words["drive_v"], lowest=0.0)
    if not words["amplitude"] and not words["phase_rad"]:
        return (row, col), _Point(line, frequency, drive, complex(math.nan, math.nan))
    amplitude = _number(place, "amplitude", words["amplitude"], lowest=0.0)
    phase = _number(place, "phase_rad", words["phase_rad"])
    return (row, col), _Point(line, frequency, drive, amplitude * complex(math.cos(phase), math.sin(phase)))


def _number(place: str, column: str, word: str, lowest: float = -math.inf) -> float:
    try:
        value = float(word)
    except ValueError:
        value = math.nan
    if not (math.isfinite(value) and value >= lowest):
        wanted = "a number" if lowest == -math.inf else f"a number >= {lowest:g}"
        raise AppError(f"{place}: column {column}: expected {wanted}, got {word[:40]!r}")
    if abs(value) > HIGHEST:
        raise AppError(f"{place}: column {column}: {value:g} is nothing that was measured; check its unit")
    return value


def _whole(place: str, column: str, word: str, count: int) -> int:
    if not (word.isascii() and word.isdigit() and len(word) < 6 and int(word) < count):
        raise AppError(f"{place}: column {column}: expected a whole number 0..{count - 1}, got {word[:40]!r}")
    return int(word)


def _sweep(source: str, place: ChainPlace, columns: dict[int, list[_Point]], device: Device) -> Sweep:
    """The points of one chain side by side; the first actuators of it without a gap."""
    from planner import Sweep

    start = place.chain * device.chain_length
    for col in range(start, max(columns)):
        if col not in columns:
            raise AppError(
                f"{source}: row {place.row} has column {max(columns)} but not column {col}, which comes before it; "
                "measure every actuator of a chain up to the last one"
            )
    first = columns[start]
    for col, points in columns.items():
        for mine, theirs in zip(points, first, strict=False):
            for name in ("frequency_hz", "drive_v"):
                if getattr(mine, name) != getattr(theirs, name):
                    raise AppError(
                        f"{source}:{mine.line}: column {name}: {getattr(mine, name):g} where line {theirs.line} of the "
                        f"chain's first actuator has {getattr(theirs, name):g}; give all the same list, in one order"
                    )
        if len(points) != len(first):
            raise AppError(
                f"{source}:{points[-1].line}: column col: actuator {col} of row {place.row} has {len(points)} lines, "
                f"the first of its chain {len(first)}; leave amplitude and phase_rad empty where nothing was measured"
            )
    return Sweep(
        omega=np.array([point.frequency_hz for point in first]) / device.f0_hz,
        volts=np.array([point.drive_v for point in first]),
        phasor=np.array([[point.phasor for point in columns[col]] for col in sorted(columns)]).T,
    )
