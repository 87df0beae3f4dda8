"""Plain ways from an icon to dots, beside which the encoder has to stand."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from recognition_sets import content, laid

__all__ = ["RIVALS"]

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

STRAIGHT_PX = 1.5


def cropped(ink: Floats, shape: tuple[int, int]) -> Bools:
    """Crop to the ink, mean over each dot, Otsu's threshold."""
    return _otsu(laid(ink, content(ink), shape))


def whole(ink: Floats, shape: tuple[int, int]) -> Bools:
    """The same with the whole frame."""
    return _otsu(laid(ink, (0, ink.shape[0], 0, ink.shape[1]), shape))


def outlined(ink: Floats, shape: tuple[int, int]) -> Bools:
    """Contours made of straight lines, as a tracer finds them, drawn as wide as a dot."""
    from PIL import Image, ImageDraw
    from skimage.measure import approximate_polygon, find_contours

    box = content(ink)
    pixels = max((box[1] - box[0]) / shape[0], (box[3] - box[2]) / shape[1])
    drawn = Image.new("L", ink.shape[::-1])
    pen = ImageDraw.Draw(drawn)
    for contour in find_contours(np.pad(ink, 1), 0.5):
        corners = approximate_polygon(contour - 1, STRAIGHT_PX)
        pen.line([(float(x), float(y)) for y, x in corners], fill=255, width=max(1, round(pixels)))
    return _otsu(laid(np.asarray(drawn) / 255.0, box, shape))


def _otsu(means: Floats) -> Bools:
    from skimage.filters import threshold_otsu

    return np.asarray(means > (threshold_otsu(means) if np.ptp(means) > 1e-9 else 0.5))


RIVALS: dict[str, Callable[[Floats, tuple[int, int]], Bools]] = {
    "crop, box, Otsu": cropped, "full frame": whole, "outline": outlined,
}  # fmt: skip
