"""Pictures of a verified waveform: a contact sheet (PNG), an animation (GIF), and the same as text."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, BinaryIO

from PIL import Image, ImageDraw

from drivers import atomic_files, naming

from ..errors import AppError
from ..plain import one_line, printable
from ..progress import Update, progress
from ..reports.spoken import spoken
from ..reports.text import VerifyReport, decibels
from .card import CardShape, draw_card, draw_disc
from .lettering import INK, MUTED, fit, font, plain_letters

__all__ = ["Preview", "write_preview"]

FRAMES_PER_PICTURE = 48
PIXELS_PER_PICTURE = 16_000_000
FRAMES_IN_ANIMATION = 240
SHEET_WIDTH = 1860
GUTTER = 14
HEADER = 132
DESK = "#E3E7EC"
LEGEND = (1.0, 0.5, 0.25, 0.1, 0.0)
SHORTEST_CS = 2
"""Viewers slow down what is shorter than two hundredths of a second."""


@dataclass(frozen=True)
class Preview:
    """What was drawn: the files in order, and sentences a person should read."""

    frames: int
    files: tuple[str, ...]
    notes: tuple[str, ...]

    def as_dict(self) -> dict[str, Any]:
        """The same in plain JSON types."""
        return {"frames": self.frames, "files": list(self.files), "notes": list(self.notes)}

    def as_text(self) -> str:
        """One line per file."""
        lines = [f"Drawn: {self.frames} frames.", *self.notes, *(f"Written: {name}" for name in self.files)]
        return "\n".join(map(one_line, lines))


def write_preview(report: VerifyReport, start: Path) -> Preview:
    """Draw `report` into ``START.png``, ``START.gif`` and ``START.txt``; a long one into START-2.png and so on.

    Raises
    ------
    AppError
        When there is no frame to draw.
    drivers.FileError
        When the disk refuses.
    """
    if not report.frames:
        raise AppError(f"{report.path}: has no frames to draw; render it again")
    notes = []
    with progress("drawing") as update:
        cards = _Cards(report, update)
        pages = _pages(cards.shape, len(report.frames))
        writers = {
            _suffixed(start, ".png" if number == 1 else f"-{number}.png"): partial(_paint, cards, page)
            for number, page in enumerate(pages, 1)
        }
        writers[_suffixed(start, ".gif")] = partial(_animate, cards)
        writers[_suffixed(start, ".txt")] = partial(_spell, report)
        with atomic_files(*writers) as files:
            for (path, write), file in zip(writers.items(), files, strict=True):
                with naming(path):
                    write(file)
    if len(pages) > 1:
        notes.append(f"The frames fill {len(pages)} pictures of at most {len(pages[0])} each.")
    if len(report.frames) > FRAMES_IN_ANIMATION:
        notes.append(f"The animation shows the first {FRAMES_IN_ANIMATION} frames.")
    return Preview(len(report.frames), tuple(map(str, writers)), tuple(notes))


class _Cards:
    """Draws cards of a report, and tells how many of all that will be drawn are done."""

    def __init__(self, report: VerifyReport, update: Update) -> None:
        rows, cols = report.frames[0].target.shape
        self.report, self.shape = report, CardShape(rows, cols)
        self._update, self._done = update, 0
        self._all = len(report.frames) + min(len(report.frames), FRAMES_IN_ANIMATION)

    def draw(self, index: int) -> Image.Image:
        self._update(self._done, self._all)
        self._done += 1
        return draw_card(self.shape, self.report.frames[index], index + 1)


def _suffixed(start: Path, end: str) -> Path:
    return start.with_name(start.name + end)


def _pages(shape: CardShape, frames: int) -> list[range]:
    width, height = shape.size
    most = max(1, min(FRAMES_PER_PICTURE, PIXELS_PER_PICTURE // (width * height)))
    return [range(first, min(first + most, frames)) for first in range(0, frames, most)]


def _paint(cards: _Cards, page: range, file: BinaryIO) -> None:
    _sheet(cards, page).save(file, "PNG")


def _sheet(cards: _Cards, page: range) -> Image.Image:
    width, height = cards.shape.size
    columns = max(1, min(len(page), (SHEET_WIDTH - GUTTER) // (width + GUTTER)))
    lines = -(-len(page) // columns)
    size = (max(900, columns * (width + GUTTER) + GUTTER), HEADER + lines * (height + GUTTER))
    sheet = Image.new("RGB", size, DESK)
    for place, index in enumerate(page):
        line, column = divmod(place, columns)
        corner = (GUTTER + column * (width + GUTTER), HEADER + line * (height + GUTTER))
        sheet.paste(cards.draw(index), corner)
    _head(sheet, cards.report, page)
    return sheet


def _head(sheet: Image.Image, report: VerifyReport, page: range) -> None:
    """Title, totals and the key to the discs, above the cards."""
    pen = ImageDraw.Draw(sheet)
    room = sheet.width - 2 * GUTTER
    title = plain_letters(f"{Path(report.path).name} on {report.device}")
    shown = f"frames {page.start + 1} to {page.stop} of {len(report.frames)}"
    same = {True: ", text comes back", False: ", text differs", None: ""}[report.text_equal]
    error = f"error {100 * report.amplitude_error:.2f} %"
    facts = f"{shown}: {report.wrong_dots} wrong dots, contrast from {decibels(report.contrast_db)}, {error}{same}"
    pen.text((GUTTER, 20), fit(title, font(28), room), font=font(28), fill=INK, anchor="lt")
    pen.text((GUTTER, 60), fit(facts, font(18), room), font=font(18), fill=INK, anchor="lt")
    _key(sheet)


def _key(sheet: Image.Image) -> None:
    smooth, height = 3, 28
    words = "amplitude by area, % of full scale:"
    left = GUTTER + round(font(16).getlength(words)) + 12
    strip = Image.new("RGB", (len(LEGEND) * 70 * smooth, height * smooth), DESK)
    pen = ImageDraw.Draw(strip)
    for place, amplitude in enumerate(LEGEND):
        draw_disc(pen, ((place * 70 + 14) * smooth, height / 2 * smooth), 11 * smooth, amplitude)
    sheet.paste(strip.reduce(smooth), (left, 90))
    pen = ImageDraw.Draw(sheet)
    pen.text((GUTTER, 104), words, font=font(16), fill=MUTED, anchor="lm")
    for place, amplitude in enumerate(LEGEND):
        pen.text((left + place * 70 + 30, 104), f"{100 * amplitude:.0f}", font=font(16), fill=MUTED, anchor="lm")


def _animate(cards: _Cards, file: BinaryIO) -> None:
    """Every frame for as long as it is felt; times are rounded so that they add up."""
    frames = cards.report.frames[:FRAMES_IN_ANIMATION]
    lengths = [max(SHORTEST_CS, round(100 * f.end_s) - round(100 * f.start_s)) * 10 for f in frames]
    pictures = (cards.draw(index).quantize(64, dither=Image.Dither.NONE) for index in range(len(frames)))
    first = next(pictures)
    first.save(file, "GIF", save_all=True, append_images=pictures, duration=lengths, loop=0, disposal=1)


def _spell(report: VerifyReport, file: BinaryIO) -> None:
    for line in spoken(report):
        file.write(f"{printable(line)}\n".encode())
