"""Words and Braille cells in pictures: colours, the built-in font, and cells drawn as dots."""

from __future__ import annotations

from functools import cache

from PIL import Image, ImageColor, ImageDraw, ImageFont

from ..plain import one_line

__all__ = [
    "ACCENT",
    "FAINT",
    "INK",
    "MUTED",
    "PAPER",
    "cells_width",
    "draw_cells",
    "fit",
    "font",
    "has_glyphs",
    "mix",
    "plain_letters",
]

INK = "#14213D"
MUTED = "#55607A"
FAINT = "#C3CAD5"
PAPER = "#FFFFFF"
ACCENT = "#B42318"

Font = ImageFont.FreeTypeFont | ImageFont.ImageFont

BRAILLE = 0x2800
DOT_PLACES = ((0, 0), (0, 1), (0, 2), (1, 0), (1, 1), (1, 2), (0, 3), (1, 3))
"""Column and row of dots 1 to 8, in the order of the bits of U+2800 + bits."""

DASHES = {ord(dash): "-" for dash in "\u2010\u2011\u2012\u2013\u2014"}

CELL_PITCHES = 3.2
LINE_PITCHES = 2.0
SMOOTH = 4


@cache
def font(size: int) -> Font:
    """Pillow's built-in font; it has the letters of ASCII and few more."""
    return ImageFont.load_default(size)


@cache
def _missing(size: int) -> bytes:
    return bytes(font(size).getmask("\U0010fffd"))


@cache
def _has_glyph(character: str) -> bool:
    return character == " " or bytes(font(24).getmask(character)) != _missing(24)


def has_glyphs(words: str) -> bool:
    """Whether the built-in font can write all of `words`."""
    return all(map(_has_glyph, words))


def plain_letters(words: str) -> str:
    """`words` on one line, with the dashes that every font has; what must not be shown as it is as escapes."""
    return one_line(" ".join(words.translate(DASHES).split()))


def fit(words: str, letters: Font, room: float) -> str:
    """`words`, cut with an ellipsis so that they are at most `room` pixels wide."""
    if letters.getlength(words) <= room:
        return words
    while words and letters.getlength(words + "...") > room:
        words = words[:-1]
    return words.rstrip() + "..."


def mix(weak: str, strong: str, amount: float) -> tuple[int, int, int]:
    """The colour `amount` (0..1) of the way from `weak` to `strong`."""
    share = min(max(amount, 0.0), 1.0)
    red, green, blue = (
        round(low + share * (high - low))
        for low, high in zip(ImageColor.getrgb(weak)[:3], ImageColor.getrgb(strong)[:3], strict=True)
    )
    return red, green, blue


def cells_width(cells: str, pitch: float) -> float:
    """Pixels that `draw_cells` takes in width."""
    lines = cells.split("\n")
    return pitch * (CELL_PITCHES * sum(map(len, lines)) + LINE_PITCHES * (len(lines) - 1))


def draw_cells(picture: Image.Image, corner: tuple[int, int], cells: str, pitch: float) -> None:
    """Draw Unicode Braille as dots on one line, `pitch` pixels between dots; lines of cells get a wider gap."""
    left, top = corner
    size = (max(1, round(cells_width(cells, pitch))), round(4 * pitch))
    large = Image.new("RGB", (size[0] * SMOOTH, size[1] * SMOOTH), PAPER)
    pen = ImageDraw.Draw(large)
    x = 0.5 * pitch
    for line in cells.split("\n"):
        for cell in line:
            _draw_cell(pen, x * SMOOTH, ord(cell) - BRAILLE, pitch * SMOOTH)
            x += CELL_PITCHES * pitch
        x += LINE_PITCHES * pitch
    picture.paste(large.reduce(SMOOTH), (left, top))


def _draw_cell(pen: ImageDraw.ImageDraw, x: float, bits: int, pitch: float) -> None:
    """One cell with its first dot at `x`; flat dots are small and pale, dots 7 and 8 shown only when raised."""
    for bit, (col, row) in enumerate(DOT_PLACES):
        raised = bits >> bit & 1
        if not raised and row == 3:
            continue
        radius = pitch * (0.40 if raised else 0.14)
        dot_x, dot_y = x + col * pitch, (row + 0.5) * pitch
        box = (dot_x - radius, dot_y - radius, dot_x + radius, dot_y + radius)
        pen.ellipse(box, fill=INK if raised else FAINT)
