"""One frame as a picture: what was wanted beside what is felt, with its text, cells and levels."""

from __future__ import annotations

import math
from dataclasses import dataclass

from PIL import Image, ImageDraw

from ..reports.text import FrameCheck, decibels
from .lettering import (
    ACCENT,
    FAINT,
    INK,
    MUTED,
    PAPER,
    cells_width,
    draw_cells,
    fit,
    font,
    has_glyphs,
    mix,
    plain_letters,
)

__all__ = ["CardShape", "draw_card", "draw_disc"]

SMOOTH = 3
"""Shapes are drawn this many times larger and reduced, which rounds their edges."""

PAD = 20
INSET = 10
GAP = 24
TITLE_Y = 18
CAPTION_Y = 46
CAPTION_BASE = 64
LABEL_Y = 84
PANEL_Y = 106
CELLS_HEIGHT = 38
FOOT_HEIGHT = 36
PANEL = "#F4F6F8"
WEAK = "#A9BED0"
STRONG = "#0B3A5B"
DOT_PITCH = 6
CAPTION_DOT_PITCH = 8
LEAST_CROSS = 6


@dataclass(frozen=True)
class CardShape:
    """Size of every card of a grid, in pixels."""

    rows: int
    cols: int

    @property
    def pitch(self) -> int:
        """Distance between actuators."""
        return max(6, min(27, 560 // self.cols))

    @property
    def panel(self) -> tuple[int, int]:
        """Width and height of one panel."""
        return max(170, self.cols * self.pitch + 2 * INSET), self.rows * self.pitch + 2 * INSET

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the card."""
        width, height = self.panel
        return 2 * PAD + 2 * width + GAP, PANEL_Y + height + CELLS_HEIGHT + FOOT_HEIGHT

    @property
    def panel_x(self) -> tuple[int, int]:
        """Left edges of the two panels."""
        return PAD, PAD + self.panel[0] + GAP


def draw_card(shape: CardShape, frame: FrameCheck, number: int) -> Image.Image:
    """Draw frame `number` (from 1) as an RGB picture of ``shape.size``."""
    width, height = shape.size
    large = Image.new("RGB", (width * SMOOTH, height * SMOOTH), PAPER)
    pen = ImageDraw.Draw(large)
    for left, felt in zip(shape.panel_x, (False, True), strict=True):
        _draw_panel(pen, shape, frame, left, felt=felt)
    card = large.reduce(SMOOTH)
    _draw_words(ImageDraw.Draw(card), shape, frame, number)
    _draw_caption(card, shape, frame)
    for left, cells in zip(shape.panel_x, (frame.wanted_cells, frame.felt_cells), strict=True):
        top = PANEL_Y + shape.panel[1] + 10
        if cells_width(cells, DOT_PITCH) <= shape.panel[0]:
            draw_cells(card, (left, top), cells, DOT_PITCH)
    return card


def draw_disc(pen: ImageDraw.ImageDraw, centre: tuple[float, float], full: float, amplitude: float) -> None:
    """A disc whose area is `amplitude` of the ring around it (radius `full`); stronger is also darker."""
    x, y = centre
    line = max(1, round(full / 12))
    pen.ellipse((x - full, y - full, x + full, y + full), fill=PAPER, outline=FAINT, width=line)
    radius = full * math.sqrt(min(max(amplitude, 0.0), 1.0))
    if radius > 0:
        pen.ellipse((x - radius, y - radius, x + radius, y + radius), fill=mix(WEAK, STRONG, amplitude))


def _draw_panel(pen: ImageDraw.ImageDraw, shape: CardShape, frame: FrameCheck, left: int, *, felt: bool) -> None:
    width, height = shape.panel
    box = (left * SMOOTH, PANEL_Y * SMOOTH, (left + width) * SMOOTH, (PANEL_Y + height) * SMOOTH)
    pen.rounded_rectangle(box, radius=8 * SMOOTH, fill=PANEL)
    amplitudes = frame.felt if felt else frame.target
    wrong = frame.felt_dots != frame.wanted_dots
    inset = (width - shape.cols * shape.pitch) / 2
    for row in range(shape.rows):
        for col in range(shape.cols):
            x = (left + inset + (col + 0.5) * shape.pitch) * SMOOTH
            y = (PANEL_Y + INSET + (row + 0.5) * shape.pitch) * SMOOTH
            amplitude = float(amplitudes[row, col])
            full = 0.43 * shape.pitch * SMOOTH
            draw_disc(pen, (x, y), full, amplitude if math.isfinite(amplitude) else 0.0)
            if felt and (wrong[row, col] or not math.isfinite(amplitude)):
                _cross(pen, x, y, full)


def _cross(pen: ImageDraw.ImageDraw, x: float, y: float, full: float) -> None:
    """Marks a wrong dot by its form, so that nothing depends on seeing the colour."""
    reach, line = max(full, LEAST_CROSS * SMOOTH), max(LEAST_CROSS * SMOOTH / 3, full / 4)
    for sign in (1, -1):
        pen.line((x - reach, y - sign * reach, x + reach, y + sign * reach), fill=ACCENT, width=round(line))


def _draw_words(pen: ImageDraw.ImageDraw, shape: CardShape, frame: FrameCheck, number: int) -> None:
    width, height = shape.size
    times = f"{frame.start_s:.2f} to {frame.end_s:.2f} s"
    pen.text((PAD, TITLE_Y), f"Frame {number}", font=font(16), fill=MUTED, anchor="lt")
    pen.text((width - PAD, TITLE_Y), times, font=font(16), fill=MUTED, anchor="rt")
    for left, name in zip(shape.panel_x, ("wanted", "felt"), strict=True):
        pen.text((left, LABEL_Y), name, font=font(15), fill=MUTED, anchor="lt")
    wrong = f"{frame.wrong_dots} wrong dot{'' if frame.wrong_dots == 1 else 's'}"
    facts = [f"contrast {decibels(frame.contrast_db)}", f"error {100 * frame.amplitude_error:.2f} %", wrong]
    if frame.outcome != "ok":
        facts[0] = frame.outcome
    line = fit(("" if frame.ok else "failed: ") + ", ".join(facts), font(15), width - 2 * PAD)
    pen.text((PAD, height - FOOT_HEIGHT + 8), line, font=font(15), fill=INK if frame.ok else ACCENT, anchor="lt")


def _draw_caption(card: Image.Image, shape: CardShape, frame: FrameCheck) -> None:
    """The text of the frame; its cells when the built-in font lacks a letter of it."""
    words = plain_letters(frame.text)
    # The number of a page has cells and no text.
    shown = words or frame.wanted_cells.strip("\u2800\n")
    room = shape.size[0] - 2 * PAD
    pen = ImageDraw.Draw(card)
    if words and has_glyphs(words):
        pen.text((PAD, CAPTION_BASE), fit(words, font(24), room), font=font(24), fill=INK, anchor="ls")
    elif shown and cells_width(frame.wanted_cells, CAPTION_DOT_PITCH) <= room:
        draw_cells(card, (PAD, CAPTION_Y), frame.wanted_cells, CAPTION_DOT_PITCH)
    elif not shown:
        pen.text((PAD, CAPTION_BASE), "blank", font=font(24), fill=MUTED, anchor="ls")
