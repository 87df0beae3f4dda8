"""All icons of a set on one picture: each figure beside the pattern that is felt, with its name."""

from __future__ import annotations

import io
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import PurePosixPath

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from ..figures.card import draw_disc
from ..figures.lettering import INK, MUTED, PAPER, fit, font
from .set import Icon

__all__ = ["contact_sheets", "figure_picture"]

Pixels = NDArray[np.uint8]

# Sets up to this size show the figure beside the pattern; larger ones are drawn small.
MOST_LARGE = 400
MOST_ON_A_SHEET = 2400
SMOOTH = 4
DOUBT_LINES = 3
PANEL = (244, 246, 248)


@dataclass(frozen=True)
class _Size:
    """Pixels: `side` of a pattern's longer side, `pad` around a card, `gap` inside it, `text` of its name.

    `doubt` is that of the sentence below it, 0 where there is only room for a question mark.
    """

    side: int
    pad: int
    gap: int
    text: int
    figure: bool
    doubt: int


LARGE = _Size(side=108, pad=14, gap=12, text=15, figure=True, doubt=11)
SMALL = _Size(side=48, pad=6, gap=4, text=9, figure=False, doubt=0)


def contact_sheets(icons: Sequence[Icon]) -> dict[str, bytes]:
    """File names and PNG files: contact.png, and contact-2.png and so on for more than 2400 icons."""
    size = LARGE if len(icons) <= MOST_LARGE else SMALL
    sheets = {}
    for number, start in enumerate(range(0, len(icons), MOST_ON_A_SHEET), 1):
        file = io.BytesIO()
        _sheet(icons[start : start + MOST_ON_A_SHEET], size).save(file, "PNG", compress_level=4)
        sheets["contact.png" if number == 1 else f"contact-{number}.png"] = file.getvalue()
    return sheets


def _sheet(icons: Sequence[Icon], size: _Size) -> Image.Image:
    high, wide = _panel(icons[0].pattern.amplitude.shape, size).shape[:2]
    across = wide * 2 + size.gap if size.figure else wide
    doubt = DOUBT_LINES * (size.doubt + 3) if any(icon.doubt for icon in icons) else 0
    card = across + 2 * size.pad, high + 2 * size.pad + size.gap + size.text + (doubt if size.doubt else 0)
    columns = max(1, min(len(icons), round((len(icons) * card[1] / card[0] * 1.5) ** 0.5)))
    rows = -(-len(icons) // columns)
    picture = Image.new("RGB", (columns * card[0], rows * card[1]), PAPER)
    pen = ImageDraw.Draw(picture)
    letters = font(size.text)
    for place, icon in enumerate(icons):
        left, top = place % columns * card[0] + size.pad, place // columns * card[1] + size.pad
        if size.figure:
            drawn = Image.fromarray(figure_picture(icon.figure)).resize((wide, high), Image.Resampling.BICUBIC)
            picture.paste(drawn, (left, top))
        picture.paste(Image.fromarray(_pattern(icon.pattern.amplitude, size)), (left + across - wide, top))
        name = _name(icon.name, size.text, across, "? " if icon.doubt else "")
        colour = INK if icon.outcome == "ok" else MUTED
        pen.text((left, top + high + size.gap), name, font=letters, fill=colour, anchor="lt")
        if icon.doubt and size.doubt:
            small = font(size.doubt)
            lines = textwrap.wrap(f"Doubt: {icon.doubt}", int(across / small.getlength("n")))[:DOUBT_LINES]
            for number, line in enumerate(lines, 1):
                below = top + high + size.gap + size.text + number * (size.doubt + 3)
                pen.text((left, below), line, font=small, fill=INK, anchor="ls")
    return picture


def _name(name: str, size: int, room: int, mark: str) -> str:
    """The last part of a name without its suffix, after a mark, as much of it as there is room for."""
    stem = mark + PurePosixPath(name).stem
    long = font(size).getlength(stem) / room
    return stem if long <= 1 else fit(stem[: int(len(stem) / long) + 1], font(size), room)


def figure_picture(figure: Pixels) -> Pixels:
    """A figure (255) as grey values, the figure dark; uint8, the same shape."""
    return np.asarray(255 - figure.astype(np.uint16) * 235 // 255, np.uint8)


def _panel(shape: tuple[int, ...], size: _Size) -> Pixels:
    pitch = max(1, size.side // max(shape))
    return np.zeros((shape[0] * pitch, shape[1] * pitch, 3), np.uint8)


def _pattern(amplitude: NDArray[np.float64], size: _Size) -> Pixels:
    rows, cols = amplitude.shape
    pitch = max(1, size.side // max(rows, cols))
    stamps = np.stack([_stamp(pitch, level) for level in (0.0, 0.5, 1.0)])
    tiles = stamps[np.rint(2 * amplitude).astype(np.intp)]
    return np.ascontiguousarray(tiles.transpose(0, 2, 1, 3, 4).reshape(rows * pitch, cols * pitch, 3))


@lru_cache(maxsize=32)
def _stamp(pitch: int, level: float) -> Pixels:
    """One actuator, uint8, shape (pitch, pitch, 3): a ring, filled the more the stronger it is."""
    large = Image.new("RGB", (pitch * SMOOTH, pitch * SMOOTH), PANEL)
    middle = (pitch * SMOOTH - 1) / 2
    draw_disc(ImageDraw.Draw(large), (middle, middle), 0.44 * pitch * SMOOTH, level)
    return np.asarray(large.reduce(SMOOTH))
