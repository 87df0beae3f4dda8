"""Textures as targets: waves, bars and levels, and regions of them side by side."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .errors import EncodeError
from .scene import GridShape, PatternKind, TargetPattern, UnlockedBeats, WalkingBars

__all__ = [
    "Region", "TextureError", "bars", "levels", "plane_wave", "regions", "rings", "slanted_bars", "unlocked",
    "walking_bars",
]  # fmt: skip

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

EDGE_DECIMALS = 9


class TextureError(EncodeError, ValueError):
    """A texture cannot be what it is asked to be.

    Examples: a level above 1; bars of width 0; regions that overlap or leave the grid.
    """


def plane_wave(shape: GridShape, *, lag_deg: float, row_lag_deg: float = 0.0, level: float = 1.0) -> TargetPattern:
    """A sinusoidal wave of one amplitude: each actuator lags its left neighbour by `lag_deg` and its upper
    one by `row_lag_deg`, so that it travels right (and down) where the lags are positive.

    Raises
    ------
    TextureError
        When a lag is not finite or the level is not in (0, 1].
    """
    if not (math.isfinite(lag_deg) and math.isfinite(row_lag_deg)):
        raise TextureError(f"wave: expected finite lags, got {lag_deg} and {row_lag_deg}")
    row, col = np.ogrid[: shape.rows, : shape.cols]
    # Turns are left out first: however large a lag is, its multiples are numbers.
    phase = -np.deg2rad(math.fmod(lag_deg, 360.0) * col + math.fmod(row_lag_deg, 360.0) * row)
    return _target(_level(level) * np.exp(1j * phase), PatternKind.SINE, phase_matters=True)


def bars(
    shape: GridShape, *, vertical: bool, width: int, gap: int, first: int = 0, level: float = 1.0
) -> TargetPattern:
    """Still bars: `width` raised columns (vertical) or rows, `gap` flat ones between; the first begins at `first`.

    Raises
    ------
    TextureError
        When width or gap is below 1, or the level is not in (0, 1].
    """
    if width < 1 or gap < 1:
        raise TextureError(f"bars: expected width and gap of 1 or more actuators, got {width} and {gap}")
    places = range(shape.cols if vertical else shape.rows)
    line = np.where([(place - first) % (width + gap) < width for place in places], _level(level), 0.0)
    grid = np.broadcast_to(line if vertical else line[:, None], (shape.rows, shape.cols))
    return _target(grid, PatternKind.BARS)


def slanted_bars(
    shape: GridShape, *, angle_deg: float, width: float, gap: float, first: float = 0.0, level: float = 1.0
) -> TargetPattern:
    """Still bars at an angle: 0 lies, 90 stands, between them they rise to the right.

    Parameters
    ----------
    width, gap : of a bar and of what is flat between two, in actuators across the bars.
    first : where a bar begins, actuators across the bars from the upper left actuator.

    Raises
    ------
    TextureError
        When a number is not finite, width or gap is below 1, or the level is not in (0, 1].
    """
    if not (math.isfinite(angle_deg) and math.isfinite(first)):
        raise TextureError(f"slanted bars: expected a finite angle and first, got {angle_deg} and {first}")
    row, col = np.mgrid[: shape.rows, : shape.cols]
    angle = math.radians(math.fmod(angle_deg, 360.0))
    return _striped(col * math.sin(angle) + row * math.cos(angle) - first, width, gap, level, "slanted bars")


def rings(
    shape: GridShape, *, row: float, col: float, width: float, gap: float, first: float = 0.0, level: float = 1.0
) -> TargetPattern:
    """Still rings around a point, which may lie between actuators or beside the grid.

    Parameters
    ----------
    row, col : the point, counted from 0.
    width, gap : of a ring and of what is flat between two, in actuators outwards.
    first : where a ring begins, actuators from the point; 0 makes a raised disc of it.

    Raises
    ------
    TextureError
        When a number is not finite, width or gap is below 1, or the level is not in (0, 1].
    """
    if not (math.isfinite(row) and math.isfinite(col) and math.isfinite(first)):
        raise TextureError(f"rings: expected a finite row, col and first, got {row}, {col} and {first}")
    rows, cols = np.mgrid[: shape.rows, : shape.cols]
    return _striped(np.hypot(rows - row, cols - col) - first, width, gap, level, "rings")


def walking_bars(
    shape: GridShape, *, width: float | None = None, rate_hz: float | None = None, level: float = 1.0
) -> TargetPattern:
    """Vertical bars that walk: two tones whose lags differ by pi/width beat with bars `width` actuators wide.

    On coupled chains width and rate hang together (theory.md section 2.5: the rate is f0 delta tan(pi / 2 width) for
    equal unit gains): give one of them. Single actuators take both.

    Parameters
    ----------
    rate_hz : bars that pass an actuator in a second.

    Raises
    ------
    TextureError
        When neither is given, the width is below 1.2 (lags beyond 165 degrees), the rate is not above 0, or the level
        is not in (0, 1].
    """
    if width is None and rate_hz is None:
        raise TextureError("walking bars: expected a width, a rate or both")
    if width is not None and not (math.isfinite(width) and width >= 1.2):
        raise TextureError(f"walking bars: expected a width of at least 1.2 actuators, got {width}")
    if rate_hz is not None and not (math.isfinite(rate_hz) and rate_hz > 0):
        raise TextureError(f"walking bars: expected a rate above 0 Hz, got {rate_hz}")
    grid = np.full((shape.rows, shape.cols), _level(level))
    walking = WalkingBars(math.nan if width is None else width, math.nan if rate_hz is None else rate_hz)
    return _target(grid, PatternKind.BARS, walking=walking)


def unlocked(shape: GridShape, *, depth: float, period_s: float) -> TargetPattern:
    """A motion that never settles: every row beats by itself, as deep and as often as is asked.

    Raises
    ------
    TextureError
        When the depth is not in (0, 1] or the period is not above 0.
    """
    if not 0 < depth <= 1:
        raise TextureError(f"unlocked: expected a depth above 0 and at most 1, got {depth}")
    if not (math.isfinite(period_s) and period_s > 0):
        raise TextureError(f"unlocked: expected a period above 0 s, got {period_s}")
    amplitude: Complexes = np.ones((shape.rows, shape.cols), dtype=np.complex128)
    amplitude.flags.writeable = False
    return TargetPattern(amplitude, PatternKind.BARS, unlocked=UnlockedBeats(depth, period_s))


def levels(amplitude: ArrayLike) -> TargetPattern:
    """A map of still levels, shape (rows, cols), each 0..1.

    Raises
    ------
    TextureError
        When it is not a table of such numbers.
    """
    try:
        grid = np.asarray(amplitude, dtype=np.float64)
    except (TypeError, ValueError):
        raise TextureError("levels: expected rows of as many numbers each") from None
    if grid.ndim != 2 or not grid.size:
        raise TextureError(f"levels: expected rows of numbers, got shape {grid.shape}")
    if not np.all((grid >= 0) & (grid <= 1)):
        wrong = grid[~((grid >= 0) & (grid <= 1))].flat[0]
        raise TextureError(f"levels: expected numbers from 0 to 1, got {wrong}")
    return _target(grid, PatternKind.ON_OFF)


@dataclass(frozen=True)
class Region:
    """A texture on some rows and columns of the grid: `top` <= row < `bottom`, `left` <= col < `right`."""

    top: int
    bottom: int
    left: int
    right: int
    texture: TargetPattern


def regions(shape: GridShape, parts: Sequence[Region]) -> TargetPattern:
    """Textures side by side; what no region covers is flat.

    Each region shows its part of a texture made for the whole grid. The phase is part of the wish where it is in
    that of the region.

    Raises
    ------
    TextureError
        When a region leaves the grid, overlaps another, holds walking bars, or was made for another grid.
    """
    amplitude = np.zeros((shape.rows, shape.cols), dtype=np.complex128)
    taken, any_phase = np.zeros(amplitude.shape, dtype=np.bool_), np.ones(amplitude.shape, dtype=np.bool_)
    for number, part in enumerate(parts):
        inside = 0 <= part.top < part.bottom <= shape.rows and 0 <= part.left < part.right <= shape.cols
        if not inside or part.texture.amplitude.shape != amplitude.shape:
            raise TextureError(f"region {number}: does not fit a grid of {shape.rows} x {shape.cols}")
        if part.texture.unlocked is not None:
            raise TextureError(f"region {number}: what never settles fills whole rows; show it in a frame of its own")
        if part.texture.walking is not None:
            raise TextureError(f"region {number}: walking bars fill whole rows; show them in a frame of their own")
        window = (slice(part.top, part.bottom), slice(part.left, part.right))
        if taken[window].any():
            raise TextureError(f"region {number}: overlaps one before it")
        taken[window] = True
        amplitude[window] = part.texture.amplitude[window]
        any_phase[window] = not part.texture.phase_matters
    any_phase.flags.writeable = False
    waves = [part.texture.kind for part in parts if part.texture.phase_matters]
    target = _target(amplitude, waves[0] if waves else PatternKind.ON_OFF, phase_matters=bool(waves))
    return replace(target, any_phase=any_phase) if waves and any_phase.any() else target


def _striped(place: Floats, width: float, gap: float, level: float, name: str) -> TargetPattern:
    """Raised where the remainder of a place, by width and gap together, is below the width."""
    if not (1 <= width < math.inf and 1 <= gap < math.inf):
        raise TextureError(f"{name}: expected width and gap of 1 or more actuators, got {width} and {gap}")
    # What lies on an edge does so whatever the angle's sine was rounded to.
    part = np.mod(np.round(place, EDGE_DECIMALS), width + gap)
    return _target(np.where(part < width, _level(level), 0.0), PatternKind.BARS)


def _level(level: float) -> float:
    if not 0 < level <= 1:
        raise TextureError(f"level: expected a number above 0 and up to 1, got {level}")
    return level


def _target(
    amplitude: ArrayLike, kind: PatternKind, *, phase_matters: bool = False, walking: WalkingBars | None = None
) -> TargetPattern:
    grid: Complexes = np.array(amplitude, dtype=np.complex128)
    grid.flags.writeable = False
    return TargetPattern(grid, kind, phase_matters=phase_matters, walking=walking)
