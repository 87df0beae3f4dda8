"""Patterns that travel: one follows the other without a rest, and every level goes a smooth way between them.

What is wanted at any moment is exact (`levels_at`). On its way from one actuator to the next a dot is felt in both, and
half way as much in one as in the other; a row of raised dots stays raised.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .scene import SMOOTHNESS, Frame, GridShape, Scene, TargetPattern
from .textures import TextureError, bars

__all__ = [
    "ArrowDirection", "TravelFrames", "arrow", "circle", "crossing", "levels_at", "moving_dot",
    "path", "scrolled_bars",
]  # fmt: skip

Floats = NDArray[np.float64]
Place = tuple[int, int]

LEAD_S = 0.6
"""How long the first pattern stands before it begins to travel."""
SLOWEST, QUICKEST = 0.1, 100.0
"""Patterns in a second that can be asked for; what a device can do is less."""


class ArrowDirection(StrEnum):
    """Where an arrow leads."""

    RIGHT = "right"
    LEFT = "left"
    UP = "up"
    DOWN = "down"


def crossing(share: ArrayLike) -> Floats:
    """How much of the way from one level to the next is done after a share of its time.

    The smooth step ``x^(k+1) sum_j C(k+j, j) (1-x)^j`` with k = `SMOOTHNESS`: 0 up to x = 0, 1/2 at x = 1/2, 1 from
    x = 1 on. As its two halves mirror each other, levels that change places add up to what they were.
    """
    x = np.clip(np.asarray(share, dtype=np.float64), 0.0, 1.0)
    rest = np.zeros_like(x)
    for j in range(SMOOTHNESS, -1, -1):
        rest = rest * (1 - x) + math.comb(SMOOTHNESS + j, j)
    return np.asarray(x ** (SMOOTHNESS + 1) * rest)


def levels_at(scene: Scene, time_s: float) -> Floats:
    """What a scene wants at a moment, on the way of what travels too.

    Parameters
    ----------
    time_s : seconds from the start of the scene. What does not travel is wanted for the whole of its frame, and of
        bars that walk, and waves, their amplitude; nothing is before the first frame and after the last.

    Returns
    -------
    float64, shape (rows, cols), 0..1.
    """
    before = np.zeros((scene.shape.rows, scene.shape.cols))
    start_s = 0.0
    for frame in scene.frames if time_s >= 0 else ():
        after = np.abs(frame.pattern.amplitude)
        share = (time_s - start_s) / frame.dwell_s
        if share < 1:
            return np.asarray(before + (after - before) * crossing(share)) if frame.travels else after
        before, start_s = after, start_s + frame.dwell_s
    return np.zeros_like(before)


@dataclass(frozen=True)
class TravelFrames:
    """Frames of patterns that follow each other, made as they are iterated; the first stands for a moment.

    Attributes
    ----------
    level_at : the levels of a step, 0..1, shape (rows, cols).
    count : how many patterns follow the first.
    per_s : how many of them in a second.
    """

    level_at: Callable[[int], Floats]
    count: int
    per_s: float

    def __iter__(self) -> Iterator[Frame]:
        for step in range(self.count + 1):
            amplitude = self.level_at(step).astype(np.complex128)
            amplitude.flags.writeable = False
            yield Frame(TargetPattern(amplitude), 1 / self.per_s if step else LEAD_S, travels=step > 0, leads=not step)


def scrolled_bars(
    shape: GridShape, *, width: int, gap: int, columns_per_s: float, lasting_s: float, level: float = 1.0
) -> TravelFrames:
    """Vertical bars that move to the left by so many columns a second, for about `lasting_s`.

    Raises
    ------
    TextureError
        When the bars or the speed cannot be.
    """

    def level_at(step: int) -> Floats:
        return bars(shape, vertical=True, width=width, gap=gap, first=-step, level=level).amplitude.real

    level_at(0)
    return TravelFrames(level_at, _count(columns_per_s, lasting_s, "columns_per_s"), columns_per_s)


def circle(shape: GridShape, radius: float) -> list[Place]:
    """Rows and columns of actuators once around the middle of the grid, clockwise from the top.

    Raises
    ------
    TextureError
        When the radius is below 0.5 actuators or the circle leaves the grid.
    """
    most = (min(shape.rows, shape.cols) - 1) / 2
    if not 0.5 <= radius <= most:
        raise TextureError(f"circle: expected a radius from 0.5 to {most:g} actuators, got {radius:g}")
    row, col = (shape.rows - 1) / 2, (shape.cols - 1) / 2
    angles = np.arange(0.0, 2 * math.pi, 0.1 / radius)
    around = [(_inwards(row, -radius * math.cos(one)), _inwards(col, radius * math.sin(one))) for one in angles]
    return [place for place, after in pairwise([*around, around[0]]) if place != after]


def _inwards(middle: float, offset: float) -> int:
    """The nearest whole number; of two that are as near the one at the middle."""
    place = middle + offset
    return math.ceil(place - 0.5 - 1e-9) if offset > 0 else math.floor(place + 0.5 + 1e-9)


def path(shape: GridShape, corners: Sequence[Place]) -> list[Place]:
    """The actuators on straight lines from corner to corner, each a neighbour of the one before, aslant too.

    Raises
    ------
    TextureError
        When there are fewer than two corners, one is the same as that before it, or lies outside of the grid.
    """
    if len(corners) < 2:
        raise TextureError(f"path: expected two corners or more, got {len(corners)}")
    for number, (row, col) in enumerate(corners):
        if not (0 <= row < shape.rows and 0 <= col < shape.cols):
            raise TextureError(f"path: corner {number}: ({row}, {col}) is not on a grid of {shape.rows} x {shape.cols}")
    found = [(corners[0][0], corners[0][1])]
    for number, (one, other) in enumerate(pairwise(corners), 1):
        steps = max(abs(other[0] - one[0]), abs(other[1] - one[1]))
        if not steps:
            raise TextureError(f"path: corner {number} is where the one before it is")
        for step in range(1, steps + 1):
            row, col = (round(a + (b - a) * step / steps) for a, b in zip(one, other, strict=True))
            found.append((row, col))
    return found


def arrow(shape: GridShape, direction: ArrowDirection) -> list[Place]:
    """The actuators through the middle of the grid from edge to edge."""
    along = direction in (ArrowDirection.RIGHT, ArrowDirection.LEFT)
    middle, length = ((shape.rows - 1) // 2, shape.cols) if along else ((shape.cols - 1) // 2, shape.rows)
    places = range(length) if direction in (ArrowDirection.RIGHT, ArrowDirection.DOWN) else range(length - 1, -1, -1)
    return [(middle, place) if along else (place, middle) for place in places]


def moving_dot(
    shape: GridShape, places: Sequence[Place], *, per_s: float, lasting_s: float, closed: bool = False
) -> TravelFrames:
    """One dot that goes from place to place, `per_s` in a second, for about `lasting_s`, again and again.

    Parameters
    ----------
    closed : the first place follows the last; else the dot goes out there, and begins anew.

    Raises
    ------
    TextureError
        When the speed cannot be.
    """
    turn = tuple(places) if closed else (*places, None)
    count = _count(per_s, lasting_s, "actuators_per_s")
    return TravelFrames(lambda step: _dot(shape, turn[step % len(turn)]), count, per_s)


def _count(per_s: float, lasting_s: float, what: str) -> int:
    if not SLOWEST <= per_s <= QUICKEST:
        raise TextureError(f"{what}: expected a number from {SLOWEST:g} to {QUICKEST:g}, got {per_s:g}")
    return max(1, round(lasting_s * per_s))


def _dot(shape: GridShape, place: Place | None) -> Floats:
    grid = np.zeros((shape.rows, shape.cols))
    if place is not None:
        grid[place] = 1.0
    return grid
