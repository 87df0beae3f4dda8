"""Texture: parts of a picture told apart by colour or luminance, each given a wave or bars of its own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from ..scene import PatternKind
from .steps import luminance

__all__ = ["TEXTURES", "Direction", "Texture", "TexturedRegion", "dot_regions", "legend", "textured"]

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]

SWEEPS = 20
ALIKE = 0.02


class Direction(StrEnum):
    """Which way a wave runs, or bars follow one another: along the rows, or down the columns."""

    ALONG = "along"
    DOWN = "down"


@dataclass(frozen=True)
class Texture:
    """What a region feels like.

    Attributes
    ----------
    kind : `SINE`, a wave of equal amplitude with a phase lag per actuator; or `BARS`, actuators on and off in turn.
    lag_rad : phase lag per actuator (sine), 0 = all together.
    bar : actuators a bar is wide (bars).
    direction : which way.
    level : amplitude, 0..1.
    """

    kind: PatternKind
    direction: Direction
    level: float
    lag_rad: float = 0.0
    bar: int = 1


@dataclass(frozen=True)
class TexturedRegion:
    """A part of a picture and its texture.

    Attributes
    ----------
    colour : linear red, green and blue, 0..1.
    dots : how many dots belong to it.
    texture : None for the ground.
    """

    colour: tuple[float, float, float]
    dots: int
    texture: Texture | None


def legend(regions: Sequence[TexturedRegion]) -> tuple[str, ...]:
    """What each region feels like, in words, one clause each: size, brightness, texture."""
    whole = max(1, sum(region.dots for region in regions))
    return tuple(
        f"{100 * region.dots / whole:.0f} % {_brightness(region)}: {_feel(region.texture)}" for region in regions
    )


def _brightness(region: TexturedRegion) -> str:
    # As seen: the cube root of light is about linear in what is called half as bright.
    seen = float(np.cbrt(luminance(np.array(region.colour, np.float32))))
    return next(word for limit, word in ((0.4, "dark"), (0.7, "middling"), (np.inf, "bright")) if seen < limit)


def _feel(texture: Texture | None) -> str:
    if texture is None:
        return "flat"
    way = "along the rows" if texture.direction is Direction.ALONG else "down the columns"
    strength = f" at {100 * texture.level:.0f} %" if texture.level < 1 else ""
    if texture.kind is PatternKind.BARS:
        return f"bars {way}, {texture.bar} wide{strength}"
    lag = np.degrees(texture.lag_rad)
    return f"all together{strength}" if lag < 1 else f"a wave {way}, {lag:.0f} degrees a dot{strength}"


# Neighbours in the list differ in at least two of kind, direction and lag, and levels are 3 dB apart or equal.
TEXTURES = (
    Texture(PatternKind.SINE, Direction.ALONG, 1.0, lag_rad=0.0),
    Texture(PatternKind.SINE, Direction.ALONG, 0.7, lag_rad=2 * np.pi / 3),
    Texture(PatternKind.BARS, Direction.DOWN, 1.0),
    Texture(PatternKind.SINE, Direction.DOWN, 0.5, lag_rad=np.pi / 3),
    Texture(PatternKind.BARS, Direction.ALONG, 0.7, bar=2),
)


def dot_regions(colour: Floats, figure: Floats, count: int, by_colour: bool) -> Ints:
    """Tell regions apart.

    Parameters
    ----------
    colour : float64, shape (rows, cols, 3), mean linear light over each dot.
    figure : float64, shape (rows, cols), how much of each dot is figure; below 1/2 it belongs to the ground.
    count : the most regions.

    Returns
    -------
    intp, shape (rows, cols): 0 for the ground, then 1, 2 ... by falling size; equal sizes by rising luminance.
    """
    raised = figure >= 0.5
    seen = np.cbrt(np.clip(colour if by_colour else luminance(colour.astype(np.float32))[..., None], 0, 1))
    points = seen[raised].astype(np.float64)
    labels = np.zeros(figure.shape, np.intp)
    if not len(points):
        return labels
    member = _clustered(points, count)
    bright = points.mean(axis=1)
    order = sorted(set(member.tolist()), key=lambda k: (-int((member == k).sum()), float(bright[member == k].mean())))
    renamed = np.zeros(int(member.max()) + 1, np.intp)
    renamed[order] = np.arange(1, len(order) + 1)
    labels[raised] = renamed[member]
    return labels


def _clustered(points: Floats, count: int) -> Ints:
    """k-means from the farthest points, so that it needs no chance; clusters that are alike become one."""
    centres = points.mean(axis=0, keepdims=True)
    for _ in range(count - 1):
        far = ((points[:, None] - centres) ** 2).sum(axis=2).min(axis=1)
        if far.max() < ALIKE**2:
            break
        centres = np.vstack([centres, points[far.argmax()]])
        for _ in range(SWEEPS):
            member = ((points[:, None] - centres) ** 2).sum(axis=2).argmin(axis=1)
            kept = np.unique(member)
            moved = np.array([points[member == k].mean(axis=0) for k in kept])
            if moved.shape == centres.shape and np.allclose(moved, centres, atol=1e-9, rtol=0):
                break
            centres = moved
    nearest: Ints = ((points[:, None] - centres) ** 2).sum(axis=2).argmin(axis=1)
    return nearest


def textured(labels: Ints, textures: tuple[Texture, ...] = TEXTURES) -> NDArray[np.complex128]:
    """Target amplitudes of labelled dots: region k gets the k-th texture, the ground 0.

    Returns
    -------
    complex128, shape (rows, cols), modulus 0..1; a phase lag counts from the first row or column.
    """
    places = dict(zip(Direction, np.indices(labels.shape)[::-1], strict=True))
    amplitude = np.zeros(labels.shape, np.complex128)
    for index, texture in enumerate(textures, start=1):
        place = places[texture.direction]
        if texture.kind is PatternKind.BARS:
            wave = ((place // texture.bar) % 2 == 0).astype(np.complex128)
        else:
            wave = np.exp(-1j * texture.lag_rad * place)
        amplitude = np.where(labels == index, texture.level * wave, amplitude)
    return amplitude
