"""Text to a scene of Braille frames."""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Iterator
from dataclasses import dataclass, replace
from enum import StrEnum
from itertools import groupby
from operator import itemgetter
from typing import Any

import numpy as np

from ..choices import EmphasisChoice, ImageChoice, Mathematics, Presentation, Undefined
from ..errors import EmptyText, LayoutError
from ..scene import Frame, GridShape, Scene, TargetPattern
from . import louis_binding
from .alphabet import alphabet, own_letters_eight
from .back_check import BackCheck, FeltPage, back_check
from .dots import BLANK, HIGHEST_6_DOT
from .joining import emphases_within
from .layout import Cut, Layout, PlacedWord, cut_anywhere, paginate
from .presentation import MIN_PART_S, presenter, read_cells
from .readers.sources import SourceKind, TextSource
from .report import EncodingReport, ReportLog, Split
from .tables import resolve_tables, table_dots
from .transcribe import PARAGRAPH_END, Transcriber
from .undefined import writable

__all__ = ["TextFrames", "TextOptions", "TextScene", "encode_text"]

DEFAULT_RATE = 6.0
ROOM_FOR_SIGNS = 4
"""Cells of a run that has room for an indicator, what it governs and a hyphen."""
SHORT_PAGE_S = 1.0
"""A page with few cells lasts as long as it would with more, up to this."""
MOST_KEPT = 1 << 18
"""Actuators of all frames of a text together, up to which its frames are kept: 7281 frames of 6 x 6, some 10 MB."""


WIDE = 12
"""Cells of a line that has room for indicators of emphasis."""
_CHOICES: dict[str, type[StrEnum]] = {
    "undefined": Undefined, "presentation": Presentation, "emphasis": EmphasisChoice, "images": ImageChoice,
    "math": Mathematics,
}  # fmt: skip


@dataclass(frozen=True)
class TextOptions:
    """How a text is encoded.

    Attributes
    ----------
    table : translation table: a file name, a comma list, or a query such as ``language:de grade:2``.
    undefined : what becomes of characters the table cannot write.
    cell_gap, line_gap : actuators left free between cells and between lines.
    rate : cells per second; a page lasts (cells up to its last one) / rate, but at least 1 s or, where that is
        less, (cells it has room for) / rate. None means 6: 1 s for 3 x 2 cells.
    dwell_s : seconds a page lasts, instead of `rate`. Shown in parts, a page gives each part an equal share,
        but at least 0.6 s; it then lasts longer.
    presentation : dots together, by row, or by dot. None: together, and whoever plans it may take another.
    blank_between : a blank frame between paragraphs.
    dots : 6, 8, or None: 8 for an 8-dot table on a grid whose rows make cells of four, else 6.
    emphasis : whether emphasis of documents is written; None for lines of 12 cells or more.
    images : whether images of documents are words or pictures; pictures are for `dotwave.text`, here they are words.
    math : how formulas of documents are written, where a file is read.
    encoding : of the characters of a file that is read; None for what it says itself, else UTF-8.
    start_at : a page from 1, the words of a heading, or words of the text, at which to begin.
    pages : such as ``10-20``, counted from there.

    A choice may be given as its word.

    Raises
    ------
    LayoutError
        When a word is not one of its choices.
    """

    table: str = "en-ueb-g2.ctb"
    undefined: Undefined = Undefined.NAME
    cell_gap: int = 0
    line_gap: int = 0
    rate: float | None = None
    dwell_s: float | None = None
    presentation: Presentation | None = None
    blank_between: bool = False
    dots: int | None = None
    emphasis: EmphasisChoice | None = None
    images: ImageChoice = ImageChoice.WORDS
    math: Mathematics = Mathematics.NEMETH
    encoding: str | None = None
    start_at: str | int | None = None
    pages: str | int | None = None

    def __post_init__(self) -> None:
        for name, kind in _CHOICES.items():
            given = getattr(self, name)
            if given is None and name in ("emphasis", "presentation"):
                continue
            if given not in list(kind):
                raise LayoutError(f"{name}: expected one of {', '.join(kind)}, got {given!r}")
            object.__setattr__(self, name, kind(given))


@dataclass(frozen=True, repr=False)
class TextScene(Scene):
    """A scene of Braille; `text_frames` are its frames with their report and check."""

    @property
    def text_frames(self) -> TextFrames:
        """The frames, with `report` and `check`."""
        assert isinstance(self.frames, TextFrames)
        return self.frames


def encode_text(source: TextSource | str, shape: GridShape, options: TextOptions) -> TextScene:
    """The scene that shows `source` on a grid.

    Frames are made while they are consumed, in memory that does not grow with the text. ``encoding`` holds
    what a reader of the dots needs: kind, tables, dots, cell_gap, line_gap, lines, cells_per_line, run,
    hyphen and continuation (see `encoders.braille.layout`), passages, presentation, undefined, liblouis (its version),
    and where emphasis is written, emphases.

    Raises
    ------
    EmptyText, InvalidText
        When the text has nothing to show, or is broken.
    TableMissing, LouisMissing
        When the table, or the Braille library, cannot be used.
    LayoutError
        When the grid has no room, an 8-dot table meets a grid with cells of three rows, a time is not > 0, or there
        is no such page, heading or word to begin at.
    UndefinedCharacter
        When the policy is `error` and a character cannot be written.
    """
    if isinstance(source, str):
        source = TextSource.of_text(source)
    for name, value in (("rate", options.rate), ("dwell", options.dwell_s)):
        if value is not None and not (math.isfinite(value) and value > 0):
            raise LayoutError(f"{name}: expected a number > 0, got {value}")
    if options.start_at is not None or options.pages is not None:
        # Imported here: a text that is shown as a whole does without.
        from .excerpt import excerpt

        def page_spans(part: TextSource) -> Iterator[tuple[int, int]]:
            return _frames_of(part, shape, options).page_spans()

        source = excerpt(source, options.start_at, options.pages, page_spans)
        # What is chosen is chosen: the frames' source and options give the same frames again.
        options = replace(options, start_at=None, pages=None)
    frames = _frames_of(source, shape, options)
    return TextScene(shape, frames, frames.encoding)


def _frames_of(source: TextSource, shape: GridShape, options: TextOptions) -> TextFrames:
    tables = resolve_tables(options.table)
    dots = _dots(source, tables, shape, options)
    layout = Layout(shape, 3 if dots == 6 else 4, options.cell_gap, options.line_gap)
    transcriber = Transcriber(tables, options.undefined, dots, passages=layout.run < layout.capacity)
    _refuse_unwritable(source, transcriber)
    if source.kind is SourceKind.TEXT and layout.run >= ROOM_FOR_SIGNS:
        layout = replace(layout, hyphen=transcriber.hyphen(), continuation=transcriber.continuation())
    if _keeps_emphasis(options, layout) and source.document is not None:
        source = replace(source, emphases=source.document.emphases)
    encoding: dict[str, Any] = {
        "kind": source.kind.value,
        "tables": list(tables),
        "dots": dots,
        "cell_gap": options.cell_gap,
        "line_gap": options.line_gap,
        "lines": layout.lines,
        "cells_per_line": layout.cells_per_line,
        "run": layout.run,
        "hyphen": layout.hyphen,
        "continuation": layout.continuation,
        "passages": transcriber.passages,
        "presentation": (options.presentation or Presentation.TOGETHER).value,
        "undefined": options.undefined.value,
        "liblouis": louis_binding.liblouis_version(),
    }
    if source.emphases:
        encoding["emphases"] = [list(one) for one in source.emphases]
    return TextFrames(source, transcriber, layout, options, encoding)


def _keeps_emphasis(options: TextOptions, layout: Layout) -> bool:
    if options.emphasis is None:
        return layout.cells_per_line >= WIDE
    return options.emphasis is EmphasisChoice.KEEP


def _dots(source: TextSource, tables: tuple[str, ...], shape: GridShape, options: TextOptions) -> int:
    """6 or 8: what is asked for, else what the table or the cells of the source need and the grid can show."""
    if options.dots is not None:
        if options.dots not in (6, 8):
            raise LayoutError(f"dots: expected 6 or 8, got {options.dots}")
        return options.dots
    if source.kind is SourceKind.BRAILLE:
        eight, what = max(source.text) > HIGHEST_6_DOT, f"{source.name} holds 8-dot cells"
    else:
        stated = table_dots(tables)
        eight = stated == 8 or (not stated and own_letters_eight(source.text, tables))
        what = f"table {','.join(tables)} writes 8-dot cells"
    if not eight:
        return 6
    if (shape.rows + options.line_gap) % (4 + options.line_gap):
        raise LayoutError(
            f"{what} and a grid of {shape.rows} x {shape.cols} has cells of three rows; choose a 6-dot table, "
            "or give --dots 6 (dots 7 and 8 are left out)"
        )
    return 8


def _refuse_unwritable(source: TextSource, transcriber: Transcriber) -> None:
    """Look at the characters once before the first frame, so that a text that cannot be shown fails at once."""
    letters = alphabet(transcriber.tables)
    if source.kind is SourceKind.BRAILLE or not letters.lacks(source.text):
        return
    if transcriber.undefined is Undefined.ERROR:
        for start, end in transcriber.paragraphs(source):
            for _ in transcriber.words(source, start, end, ReportLog()):
                pass
    different = "".join(sorted(set(source.text)))
    if not writable(different, 0, letters, transcriber.undefined, ReportLog()).text.strip():
        raise EmptyText(
            f"{source.name}: the table {','.join(transcriber.tables)} can write none of its characters; "
            "choose another table, or --undefined name"
        )


class TextFrames:
    """The frames of a text: iterating encodes, and keeps the frames of a text that is not long.

    A text whose frames have more than `MOST_KEPT` actuators together is encoded again by every iteration. `report`
    tells what happened while it was encoded last, complete when that came to its end.
    """

    def __init__(
        self,
        source: TextSource,
        transcriber: Transcriber,
        layout: Layout,
        options: TextOptions,
        encoding: dict[str, Any],
    ) -> None:
        self.source = source
        self.layout = layout
        self.encoding = encoding
        self._transcriber = transcriber
        self.options = options
        self._headings = source.document.headings(source.text) if source.document else []
        self._log = ReportLog()
        self._kept: tuple[Frame, ...] | None = None
        self._show = presenter(layout, options.presentation or Presentation.TOGETHER)
        rate = options.rate or DEFAULT_RATE
        self._s_per_cell = 0.0 if options.dwell_s else 1 / rate
        self._shortest_s = options.dwell_s or min(SHORT_PAGE_S, layout.capacity / rate)

    @property
    def report(self) -> EncodingReport:
        """What happened while the frames were last consumed."""
        return self._log.report

    def __iter__(self) -> Iterator[Frame]:
        if self._kept is not None:
            yield from self._kept
            return
        kept: list[Frame] | None = []
        most = MOST_KEPT // (self.layout.shape.rows * self.layout.shape.cols)
        for number, frame in enumerate(self._encoded(), 1):
            if number > most:
                kept = None
            if kept is not None:
                kept.append(frame)
            yield frame
        self._kept = None if kept is None else tuple(kept)

    def _encoded(self) -> Iterator[Frame]:
        self._log = log = ReportLog()
        text, show = self.source.text, self._show
        between = False
        for page in paginate(self._words(log), self.layout, self._cut, self._note):
            if between:
                yield self._blank_frame(log, page.start)
            shown = show(page.cells)
            dwell_s = max(self._shortest_s, len(page.cells.rstrip(BLANK)) * self._s_per_cell)
            share_s = dwell_s if len(shown.parts) == 1 else max(dwell_s / len(shown.parts), MIN_PART_S)
            # A break between paragraphs belongs to the page before it, so that the spans tell where it was.
            gap = PARAGRAPH_END.match(text, page.end) if page.end_of_paragraph else None
            span = (page.start, gap.end() if gap else page.end)
            first, last = (bisect_left(self._headings, place, key=itemgetter(0)) for place in span)
            headings = tuple(heading for _, heading in self._headings[first:last])
            for pattern in shown.parts:
                yield Frame(pattern, share_s, log.pages, text[slice(*span)], span, shown.cells, page.goes_on, headings)
                headings = ()
            log.frames += len(shown.parts)
            log.cells += len(page.cells) - page.cells.count(BLANK)
            log.pages += 1
            between = self.options.blank_between and page.end_of_paragraph

    def page_spans(self) -> Iterator[tuple[int, int]]:
        """(start, end) in the source of every page, blank ones too; nothing is drawn."""
        between = False
        for page in paginate(self._words(ReportLog()), self.layout, self._cut, lambda word, cut: None):
            if between:
                yield page.start, page.start
            yield page.start, page.end
            between = self.options.blank_between and page.end_of_paragraph

    def _blank_frame(self, log: ReportLog, position: int) -> Frame:
        amplitude = np.zeros((self.layout.shape.rows, self.layout.shape.cols), dtype=np.complex128)
        amplitude.flags.writeable = False
        frame = Frame(TargetPattern(amplitude), self._shortest_s, log.pages, "", (position, position), "")
        log.pages += 1
        log.frames += 1
        return frame

    def _words(self, log: ReportLog) -> Iterator[PlacedWord]:
        for start, end in self._transcriber.paragraphs(self.source):
            yield from self._transcriber.words(self.source, start, end, log)
            yield PlacedWord("", "", end, end, None, 0, 0, False)

    def _cut(self, word: PlacedWord, room: int) -> Cut:
        if self.source.kind is SourceKind.BRAILLE:
            return cut_anywhere(word, room)
        return self._transcriber.cut(word, room, self.layout.hyphen, self.layout.continuation)

    def _note(self, word: PlacedWord, cut: Cut) -> None:
        start = self.source.text[word.start : min(word.end, word.start + 80)]
        self._log.split(Split(start, (word.start, word.end), self._log.pages, cut.hyphenated))

    def check(self) -> BackCheck:
        """Read all frames as fingers would, back-translate, and compare with the source: together, and page by page.

        Holds the whole text and its cells at once; for the frames of a book use it on a part. What the frames of a
        text that is not long were encoded for before serves here too.
        """
        pages: list[FeltPage] = []
        for _, group in groupby(self, key=lambda frame: frame.page):
            parts = list(group)
            dots = np.any([np.abs(part.pattern.amplitude) > 0.5 for part in parts], axis=0)
            emphases = emphases_within(self.source.emphases, *parts[0].span)
            pages.append(FeltPage(read_cells(dots, self.encoding), parts[0].text, parts[0].goes_on, emphases))
        return back_check(pages, self.source.text, self.encoding, self.source.emphases)
