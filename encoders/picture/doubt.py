"""When the similarity says more than a finger will know: one sentence on why to look again."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from .steps import content_box, otsu

__all__ = ["doubt_of", "is_block"]

Floats = NDArray[np.float32]
Bools = NDArray[np.bool_]

# A wordmark is so much wider than high, and has so many letters or more.
WORD_SHAPE, LETTERS = 2.5, 4
# Letters stand on a line: their middles differ by less than this part of their height.
ON_A_LINE = 0.5
FULL_SHARE, TONES = 0.9, 0.8
LITTLE = 0.6


def doubt_of(bright: Floats, figure: Floats, dots: Bools, similarity: float, notes: Sequence[str], icon: bool) -> str:
    """Why a pattern may not be known, in one sentence; empty where nothing speaks against it.

    Parameters
    ----------
    bright : float32, shape (height, width), luminance 0..1.
    figure : float32, shape (height, width), 0..1.
    dots : bool, shape (rows, cols), what is raised.
    similarity : of the dots with the figure.
    notes : what was left out while reading.
    icon : whether it was taken for an icon, which has two tones.
    """
    if any(note.startswith("<text") for note in notes):
        return "Its text is lost: only shapes are drawn; turn the text into paths."
    if _is_word(figure):
        return "It is a word or a row of signs: no letter can be known on so few dots."
    if _is_line(dots):
        return "All that is left is one straight line."
    if _is_full(dots):
        return "It is felt as a nearly full rectangle."
    if icon and otsu(np.sqrt(np.clip(bright, 0, 1)))[1] < TONES:
        return "Its tones run into one another: where figure and ground are parted is a guess."
    if similarity < LITTLE:
        return "Little of it fits on so few dots."
    return ""


def _is_word(figure: Floats) -> bool:
    """Whether the figure is several parts beside one another, on one line, and much wider than high."""
    top, bottom, left, right = content_box(figure)
    if right - left < WORD_SHAPE * (bottom - top):
        return False
    from scipy.ndimage import find_objects, label

    parts = find_objects(label(figure[top:bottom, left:right] >= 0.5)[0])
    tall = [part for part in parts if part[0].stop - part[0].start > ON_A_LINE * (bottom - top)]
    return len(tall) >= LETTERS


def _is_line(dots: Bools) -> bool:
    """Whether all that is raised is one bar, at least three times as long as wide."""
    places = np.argwhere(dots)
    if len(places) < 2:
        return False
    height, width = np.ptp(places, axis=0) + 1
    return bool(max(height, width) >= 3 * min(height, width) and len(places) == height * width)


def _is_full(dots: Bools) -> bool:
    return is_block(dots) and min(np.ptp(np.argwhere(dots), axis=0)) > 0


def is_block(dots: Bools) -> bool:
    """Whether what is raised nearly fills a rectangle, be it one dot wide."""
    places = np.argwhere(dots)
    if not len(places):
        return False
    height, width = np.ptp(places, axis=0) + 1
    return bool(len(places) >= FULL_SHARE * height * width)
