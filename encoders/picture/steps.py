"""The steps from a picture to its figure, each a pure function of arrays.

Light is linear, 0 dark and 1 bright; a figure is 1 where something should be felt and 0 on the ground, with the values
between at its edges.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .errors import PictureError
from .reading import linear

__all__ = [
    "adaptive_figure", "background_light", "composite", "content_box", "dilated", "edges", "even_contrast", "inverted",
    "luminance", "otsu", "smoothed", "soft_figure", "thickened", "widened",
]  # fmt: skip

Floats = NDArray[np.float32]
Bools = NDArray[np.bool_]

WEIGHTS = np.array([0.2126, 0.7152, 0.0722], np.float32)


def background_light(light: Floats, background: str) -> Floats:
    """Linear colour to lay under a picture: ``#rrggbb``, or for ``auto`` white or black, whichever it shows on.

    Parameters
    ----------
    light : float32, shape (height, width, 4), linear light times alpha, and alpha.

    Returns
    -------
    float32, shape (3,), 0..1.

    Raises
    ------
    PictureError
        When the colour is not written ``#rrggbb``.
    """
    if background == "auto":
        covered = float(light[..., 3].sum(dtype=np.float64))
        bright = float((light[..., :3] @ WEIGHTS).sum(dtype=np.float64))
        return np.full(3, 0.0 if covered and bright > 0.5 * covered else 1.0, np.float32)
    digits = background.removeprefix("#")
    if len(digits) != 6 or any(digit not in "0123456789abcdefABCDEF" for digit in digits):
        raise PictureError(f"picture.background: expected auto or a colour such as #ffffff, got {background!r}")
    return linear(np.frombuffer(bytes.fromhex(digits), np.uint8) / 255)


def composite(light: Floats, background: Floats) -> Floats:
    """Lay a picture over a colour; float32, shape (height, width, 3), linear light."""
    if light[..., 3].min(initial=1.0) >= 1.0:
        return light[..., :3]
    over: Floats = light[..., :3] + (1 - light[..., 3:]) * background
    return over


def luminance(colour: Floats) -> Floats:
    """Relative luminance of linear light (Rec. 709); float32, shape (height, width), 0..1."""
    bright: Floats = colour @ WEIGHTS
    return bright


def smoothed(values: Floats, radius: int) -> Floats:
    """Mean over a square of 2 radius + 1 pixels, the border repeated; float32, same shape."""
    if radius < 1:
        return values
    for axis in (0, 1):
        width = [(0, 0), (0, 0)]
        width[axis] = (radius + 1, radius)
        sums = np.cumsum(np.pad(values, width, mode="edge"), axis=axis, dtype=np.float64)
        size = values.shape[axis]
        upper = np.take(sums, np.arange(2 * radius + 1, 2 * radius + 1 + size), axis=axis)
        values = ((upper - np.take(sums, np.arange(size), axis=axis)) / (2 * radius + 1)).astype(np.float32)
    return values


def even_contrast(bright: Floats, radius: int) -> Floats:
    """Local contrast: how far each place is from its surroundings, in units of their spread, as 0..1.

    The luminance is taken to the power 1/2.2 first, so that dark and bright parts count as they are seen.
    """
    seen = np.maximum(bright, 0) ** np.float32(1 / 2.2)
    mean = smoothed(seen, radius)
    spread = np.sqrt(np.maximum(smoothed((seen - mean) ** 2, radius), 0))
    floor = 0.25 * float(seen.std()) + 1e-3
    contrast: Floats = np.clip(0.5 + (seen - mean) / (4 * (spread + np.float32(floor))), 0, 1)
    return contrast


def edges(bright: Floats) -> Floats:
    """Size of the gradient after a smoothing of one pixel, as 0..1 of its 99th percentile."""
    across, along = np.gradient(smoothed(bright, 1)) if min(bright.shape) > 1 else (bright * 0, bright * 0)
    size = np.hypot(across, along)
    top = max(float(np.percentile(size, 99)), 1e-6)
    return np.clip(size / np.float32(top), 0, 1).astype(np.float32)


def otsu(values: Floats) -> tuple[float, float]:
    """Otsu's threshold of values 0..1, and the share of the variance that it explains (0..1)."""
    counts = np.bincount((np.clip(values, 0, 1) * 255 + 0.5).astype(np.uint8).ravel(), minlength=256)
    levels = np.arange(256) / 255
    below = np.cumsum(counts)[:-1]
    above = values.size - below
    first = np.cumsum(counts * levels)
    means = first[:-1] / np.maximum(below, 1), (first[-1] - first[:-1]) / np.maximum(above, 1)
    between = below * above * (means[1] - means[0]) ** 2 / values.size**2
    total = float((counts * levels**2).sum() / values.size - (first[-1] / values.size) ** 2)
    best = np.flatnonzero(between >= between.max() * (1 - 1e-9))
    return float(levels[best].mean() + 0.5 / 255), float(between.max() / total) if total > 1e-9 else 0.0


def soft_figure(values: Floats, threshold: float) -> Floats:
    """Bright parts as 1, dark ones as 0; edges keep their share: 1/2 at the threshold, 0 and 1 at the class means."""
    above = values >= threshold
    if above.all() or not above.any():
        return above.astype(np.float32)
    low, high = float(values[~above].mean()), float(values[above].mean())
    share: Floats = np.clip((values - np.float32(low)) / np.float32(max(high - low, 1e-6)), 0, 1)
    return share


def adaptive_figure(values: Floats, radius: int) -> Floats:
    """As `soft_figure`, with the mean of the surroundings (2 radius + 1 pixels) as the threshold of each place."""
    mean = smoothed(values, radius)
    spread = max(float(np.abs(values - mean).mean()), 1e-6)
    share: Floats = np.clip(0.5 + (values - mean) / np.float32(2 * spread), 0, 1)
    return share


def inverted(figure: Floats, clear: Bools | None = None) -> Floats:
    """Raise the figure: turned over when the ground is mostly raised.

    The ground is what is `clear` (transparent in the picture; bool, same shape), or when None the border.
    """
    border = [figure[0], figure[-1], figure[:, 0], figure[:, -1]]
    ground = np.concatenate(border) if clear is None else figure[clear]
    if float(ground.mean()) > 0.5:
        figure = 1 - figure
    return figure


def content_box(figure: Floats) -> tuple[int, int, int, int]:
    """Top, bottom, left and right of what is raised by half or more; the whole when nothing is."""
    raised = figure >= 0.5
    rows, columns = np.flatnonzero(raised.any(axis=1)), np.flatnonzero(raised.any(axis=0))
    if not rows.size:
        return 0, figure.shape[0], 0, figure.shape[1]
    return int(rows[0]), int(rows[-1]) + 1, int(columns[0]), int(columns[-1]) + 1


def dilated(mask: Bools, radius: float) -> Bools:
    """Every place within `radius` pixels of a true one; bool, same shape."""
    whole = int(radius)
    if whole < 1:
        return mask
    height, width = mask.shape
    # Of each row, the disc covers one run; a running count tells whether the run meets a true place.
    count = np.cumsum(np.pad(mask, ((whole, whole), (whole + 1, whole))), axis=1, dtype=np.int32)
    grown = np.zeros_like(mask)
    for down in range(-whole, whole + 1):
        half = int((radius * radius - down * down) ** 0.5)
        rows = count[whole + down : whole + down + height]
        last, first = whole + half + 1, whole - half
        grown |= rows[:, last : last + width] > rows[:, first : first + width]
    return grown


def thickened(figure: Floats, radius: float) -> Floats:
    """Strokes widened by `radius` pixels on each side; float32, same shape."""
    return figure if radius < 1 else np.maximum(figure, dilated(figure >= 0.5, radius).astype(np.float32))


def widened(mask: Bools, width: float, outside: bool = False) -> Bools:
    """Strokes narrower than `width` pixels brought to that width, wider ones left as they are.

    Applied to the ground, which goes on beyond the picture, it gives the smallest gap between parts:
    ``~widened(~mask, gap, outside=True)``.
    """
    radius = (width - 1) / 2
    if radius < 1:
        return mask
    edge = int(width) + 1
    padded = np.pad(mask, edge, constant_values=outside)
    around = np.pad(~padded, 1, constant_values=not outside)
    opened = dilated(~dilated(around, radius)[1:-1, 1:-1], radius) & padded
    # Corners and tips of wide parts are not strokes.
    thin = padded & ~dilated(opened, radius + 1)
    return (padded | dilated(thin, radius))[edge:-edge, edge:-edge]
