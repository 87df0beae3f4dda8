"""The named steps from a picture to its figure, in order, each kept so that it can be shown."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .options import Invert, PictureOptions, Style, Threshold
from .steps import (
    adaptive_figure,
    background_light,
    composite,
    edges,
    even_contrast,
    inverted,
    luminance,
    otsu,
    soft_figure,
    thickened,
    widened,
)

__all__ = ["Step", "figure_steps", "spaced_steps", "style_of"]

Floats = NDArray[np.float32]

ICON_SEPARATION = 0.85
FAINT = 0.02
CLEAR_SHARE = 0.005
SURROUND = 0.4


@dataclass(frozen=True)
class Step:
    """A step of the encoding and what came out.

    Attributes
    ----------
    name : what was done.
    image : float32, shape (height, width) or (height, width, 3), 0..1 linear.
    """

    name: str
    image: NDArray[np.float32]

    def pixels(self) -> NDArray[np.uint8]:
        """The image coded as sRGB; uint8, same shape."""
        light = np.clip(self.image, 0, 1)
        coded = np.where(light <= 0.0031308, 12.92 * light, 1.055 * np.maximum(light, 1e-6) ** (1 / 2.4) - 0.055)
        return (coded * 255 + 0.5).astype(np.uint8)


def style_of(bright: Floats) -> Style:
    """Icon when two tones explain most of the variance of the luminance (Otsu's measure), else photograph."""
    return Style.ICON if otsu(np.sqrt(np.clip(bright, 0, 1)))[1] >= ICON_SEPARATION else Style.PHOTO


def figure_steps(light: Floats, options: PictureOptions) -> list[Step]:
    """Composite, luminance, local contrast, edges, threshold, invert; the last one is the figure.

    Parameters
    ----------
    light : float32, shape (height, width, 4), linear light times alpha, and alpha.
    options : resolved for a style.
    """
    colour = composite(light, background_light(light, options.background))
    bright = luminance(colour)
    steps = [Step("composite", colour), Step("luminance", bright)]
    values = bright
    if options.contrast:
        values = even_contrast(values, max(1, round(SURROUND * max(values.shape))))
        steps.append(Step("local contrast", values))
    if options.edges:
        values = edges(values)
        steps.append(Step("edges", values))
    figure = _thresholded(values, options)
    steps.append(Step(f"threshold ({options.threshold})", figure))
    if options.invert is Invert.YES:
        figure = 1 - figure
    elif options.invert is Invert.AUTO and not options.edges:
        clear = light[..., 3] < 0.5
        figure = inverted(figure, clear if float(clear.mean()) > CLEAR_SHARE else None)
    steps.append(Step("invert", figure))
    return steps


def spaced_steps(figure: Floats, options: PictureOptions, pixels_per_m: float) -> list[Step]:
    """Thicken; then the minimum stroke, and the minimum gap where it is more than one actuator.

    Parameters
    ----------
    pixels_per_m : how many pixels of the picture are laid on a metre of the grid.
    """
    steps = []
    pitch = min(options.pitch_m)
    if options.thicken:
        figure = thickened(figure, options.thicken * pitch * pixels_per_m)
        steps.append(Step("thicken", figure))
    # A gap of one actuator comes by itself, as dots do not touch.
    for name, least_m in (
        ("minimum stroke", options.stroke_m),
        ("minimum gap", options.gap_m if (options.gap_m or 0.0) > pitch else 0.0),
    ):
        if not least_m:
            continue
        raised, wide = figure >= 0.5, least_m * pixels_per_m
        mask = widened(raised, wide) if name == "minimum stroke" else ~widened(~raised, wide, outside=True)
        figure = np.where(mask == raised, figure, mask).astype(np.float32)
        steps.append(Step(name, figure))
    return steps


def _thresholded(values: Floats, options: PictureOptions) -> Floats:
    if options.threshold is Threshold.ADAPTIVE:
        return adaptive_figure(values, max(1, round(SURROUND * max(values.shape))))
    if options.threshold is Threshold.FIXED:
        return soft_figure(values, options.threshold_value)
    if float(np.ptp(values)) < FAINT:
        return np.zeros_like(values)
    return soft_figure(values, otsu(values)[0])
