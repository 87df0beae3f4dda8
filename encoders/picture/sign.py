"""Signs on tiles and in rings: what is told apart where the tile or the ring says nothing."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .steps import content_box

__all__ = ["Framed", "framed_sign"]

Floats = NDArray[np.float32]
Bools = NDArray[np.bool_]

# The outline of a tile covers so much of its box, a disc 0.785, and is its own mirror image.
TILE_SHARE, LOPSIDED = 0.75, 0.02
# The sign takes so much of the box, not all as the hole of a ring does, and keeps so much away from its edge.
SIGN_SHARES, RIM = (0.02, 0.33), 0.1
FEWEST_PIXELS = 16


class Framed:
    """A sign and where it stands.

    Attributes
    ----------
    sign : float32, shape (height, width), 0..1, without its tile or ring.
    cut : whether it is cut out of a tile, not in a ring.
    inside : bool, the same shape: the box around the sign.
    """

    def __init__(self, sign: Floats, cut: bool) -> None:
        self.sign, self.cut = sign, cut
        top, bottom, left, right = content_box(sign)
        self.inside = np.zeros(sign.shape, np.bool_)
        self.inside[top:bottom, left:right] = True

    def left(self, dots: Bools, inside: Bools) -> Bools:
        """What dots show of it, all bool, shape (rows, cols): none where it is one with the ring around it.

        Parameters
        ----------
        inside : where its box is.
        """
        from scipy.ndimage import binary_dilation

        seen: Bools = (dots != self.cut) & inside
        around = binary_dilation(inside, np.ones((3, 3)))
        return seen if self.cut or not dots[around].all() else np.zeros_like(seen)


def framed_sign(figure: Floats) -> Framed | None:
    """The sign that is cut out of a tile, or stands in a ring; None where there is neither.

    A tile or a ring has the outline of a rectangle or a disc, rounded or not. What is cut from its edge, or stands
    in another form, is part of a figure.

    Parameters
    ----------
    figure : float32, shape (height, width), 0..1.
    """
    top, bottom, left, right = content_box(figure)
    inner = figure[top:bottom, left:right]
    if min(inner.shape) < FEWEST_PIXELS:
        return None
    raised = inner >= 0.5
    filled = _filled(raised)
    if float(filled.mean()) < TILE_SHARE or max(float((filled ^ filled[::-1]).mean()), _lopsided(filled)) > LOPSIDED:
        return None
    for cut, mask, values in ((True, filled & ~raised, 1 - inner), (False, raised & ~_outer(raised), inner)):
        if SIGN_SHARES[0] <= float(mask.mean()) <= SIGN_SHARES[1] and _away_from_the_edge(mask):
            sign = np.zeros_like(figure)
            sign[top:bottom, left:right] = mask * values
            return Framed(sign, cut)
    return None


def _lopsided(filled: Bools) -> float:
    return float((filled ^ filled[:, ::-1]).mean())


def _filled(raised: Bools) -> Bools:
    """What is raised, and its holes."""
    from scipy.ndimage import label

    ground, _ = label(np.pad(~raised, 1, constant_values=True))
    filled: Bools = (ground != ground[0, 0])[1:-1, 1:-1]
    return filled


def _outer(raised: Bools) -> Bools:
    """The part that the left side of the box touches: the ring, if there is one."""
    from scipy.ndimage import label

    parts, _ = label(raised)
    row = int(np.flatnonzero(parts[:, 0])[0])
    outer: Bools = parts == parts[row, 0]
    return outer


def _away_from_the_edge(mask: Bools) -> bool:
    rim = int(RIM * min(mask.shape))
    return bool(mask[rim:-rim, rim:-rim].sum() == mask.sum())
