"""Text to a scene of Braille frames."""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import groupby
from operator import itemgetter
from typing import Any

import numpy as np

from ..choices import EmphasisChoice, PageNumbering, Presentation, TextOptions
from ..errors import LayoutError
from ..scene import Frame, GridShape, Heading, PageNumber, Scene, TargetPattern
from . import louis_binding
from .alphabet import own_letters_eight
from .back_check import BackCheck, FeltPage, back_check
from .dots import BLANK, HIGHEST_6_DOT
from .filling import paginate
from .joining import emphases_within
from .layout import FLUSH, Cut, Layout, LineStyle, Page, PlacedWord, cut_anywhere
from .presentation import MIN_PART_S, presenter, read_page
from .readers.sources import SourceKind, TextSource
from .report import EncodingReport, ReportLog, Split
from .tables import resolve_tables, table_dots
from .transcribe import LINE_END, PARAGRAPH_END, Transcriber, paragraphs, refuse_unwritable

__all__ = ["TextFrames", "TextScene", "encode_text"]

DEFAULT_RATE = 6.0
ROOM_FOR_SIGNS = 4
"""Cells of a run that has room for an indicator, what it governs and a hyphen."""
SHORT_PAGE_S = 1.0
"""A page with few cells lasts as long as it would with more, up to this."""
MOST_KEPT = 1 << 18
"""Actuators of all frames of a text together, up to which its frames are kept: 7281 frames of 6 x 6, some 10 MB."""
WIDE = 12
"""Cells of a line that has room for indicators of emphasis, and for the number of the page."""


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
    hyphen and continuation (see `encoders.braille.layout`), passages, presentation, undefined, liblouis (its version);
    emphases where emphasis is written, and page_numbers where they are shown.

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
    height = 3 if dots == 6 else 4
    if options.presentation is Presentation.SCROLL:
        # Imported here: pages that stand do without.
        from .scroll import scroll_layout

        layout = scroll_layout(shape, height, options)
    else:
        layout = Layout(shape, height, options.cell_gap, options.line_gap)
    transcriber = Transcriber(tables, options.undefined, dots, passages=layout.run < layout.capacity)
    refuse_unwritable(source, transcriber)
    corner = options.page_numbers is PageNumbering.CORNER
    if corner and layout.capacity < 2:
        raise LayoutError("page-numbers: a page of one cell has no room for a number; choose frame or none")
    status = corner and layout.cells_per_line < WIDE
    if source.kind is SourceKind.TEXT and layout.run - status * (not layout.lined) >= ROOM_FOR_SIGNS:
        layout = replace(layout, hyphen=transcriber.hyphen(), continuation=transcriber.continuation())
    if _by_lines(source, options, layout):
        # Imported here, as below: words that run on over small pages do without.
        from .lines import with_lines

        source = with_lines(source, options.lines, layout)
    if _keeps_emphasis(options, layout) and source.document is not None:
        source = replace(source, emphases=source.document.emphases)
    encoding: dict[str, Any] = {
        "kind": source.kind.value,
        "tables": list(tables),
        "dots": dots,
        "cell_gap": layout.cell_gap,
        "line_gap": layout.line_gap,
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
    if options.page_numbers is not PageNumbering.NONE:
        encoding["page_numbers"] = options.page_numbers.value
    if source.emphases:
        encoding["emphases"] = [list(one) for one in source.emphases]
    return TextFrames(source, transcriber, layout, options, encoding, shape)


def _by_lines(source: TextSource, options: TextOptions, layout: Layout) -> bool:
    """Whether lines, of the text or of the page, say where words stand."""
    braille = source.kind is SourceKind.BRAILLE
    return layout.lined or options.lines is not None or braille or LINE_END in source.text


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
        shape: GridShape,
    ) -> None:
        self.source = source
        self.layout = layout
        self.shape = shape
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
        kept: list[Frame] = []
        most = MOST_KEPT // (self.layout.shape.rows * self.layout.shape.cols)
        for frame in (frames := self._moved()):
            yield frame
            kept.append(frame)
            if len(kept) > most:
                kept.clear()
                yield from frames
                return
        self._kept = tuple(kept)

    def _moved(self) -> Iterator[Frame]:
        if self.options.presentation is not Presentation.SCROLL:
            return self._encoded()
        from .scroll import scrolled

        return scrolled(self._encoded(), self.layout, self.shape, self.options.rate)

    def _encoded(self) -> Iterator[Frame]:
        self._log = log = ReportLog()
        text, between = self.source.text, False
        own_frame = self.options.page_numbers is PageNumbering.FRAME
        total = sum(1 for _ in self.page_spans()) if own_frame else 0
        for number, page in enumerate(self._pages(log)):
            if between:
                yield self._blank_frame(log, page.start)
            if own_frame:
                yield from self._number_frames(log, number + 1, total, page.start)
            # A break between paragraphs belongs to the page before it, so that the spans tell where it was.
            gap = PARAGRAPH_END.match(text, page.end) if page.end_of_block else None
            span = start, end = page.start, gap.end() if gap else page.end
            for word, cut in page.cuts:
                self._note(log, word, cut)
            yield from self._shown(log, page, text[start:end], span)
            log.cells += len(page.cells) - page.cells.count(BLANK)
            between = self.options.blank_between and page.end_of_paragraph

    def _shown(self, log: ReportLog, page: Page, text: str, span: tuple[int, int]) -> Iterator[Frame]:
        """The frames of a page: its cells in one part or several, and how long."""
        shown, headings = self._show(page.cells), self._headings_of(span) if self._headings else ()
        said = page.cells if page.number is None else page.cells[: page.number.at]
        cells = len(said.rstrip(BLANK)) + (len(page.number.cells) if page.number else 0)
        share_s = max(self._shortest_s, cells * self._s_per_cell)
        if len(shown.parts) > 1:
            share_s = max(share_s / len(shown.parts), MIN_PART_S)
        for pattern in shown.parts:
            yield Frame(pattern, share_s, log.pages, text, span, shown.cells, page.goes_on, headings, page.number)
            headings = ()
            log.frames += 1
        log.pages += 1

    def _headings_of(self, span: tuple[int, int]) -> tuple[Heading, ...]:
        """The headings that begin in a span of the source."""
        first, last = (bisect_left(self._headings, at, key=itemgetter(0)) for at in span)
        return tuple(heading for _, heading in self._headings[first:last])

    def _number_frames(self, log: ReportLog, number: int, total: int, position: int) -> Iterator[Frame]:
        """The number of the page to come and of all, on a page or where that is too small on two."""
        write, room = self._transcriber.number, self.layout.capacity
        whole = write(f"{number}/{total}")
        for cells in [whole] if len(whole) <= room else [write(f"{number}"), write(f"/{total}")]:
            sign = cells[-room:]
            page = Page(sign.ljust(room, BLANK), position, position, False, False, number=PageNumber(0, sign))
            yield from self._shown(log, page, "", (position, position))

    def _corner(self, number: int) -> str:
        """The cells at the end of a page with its number: on narrow lines the last digit alone."""
        cells = self._transcriber.number(str(number))
        return 2 * BLANK + cells if self.layout.cells_per_line >= WIDE else cells[-1:]

    def _pages(self, log: ReportLog) -> Iterator[Page]:
        numbered = self._corner if self.options.page_numbers is PageNumbering.CORNER else None
        blanks = self.options.blank_between
        return paginate(self._words(log), self.layout, self._cut, numbered, blanks)

    def page_spans(self) -> Iterator[tuple[int, int]]:
        """(start, end) in the source of every page, blank ones too, but not of numbers; nothing is drawn."""
        between = False
        for page in self._pages(ReportLog()):
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

    def _words(self, log: ReportLog) -> Iterator[PlacedWord | LineStyle]:
        source, layout, transcriber = self.source, self.layout, self._transcriber
        if not _by_lines(source, self.options, layout):
            for start, end in paragraphs(source.text):
                yield FLUSH
                yield from transcriber.words(source, start, end, log)
            return
        from .lines import keeps_cells, styled_blocks, styled_lines

        if keeps_cells(source, self.options.lines, layout):
            for start, end, style in styled_lines(source):
                yield style
                yield from transcriber.kept_line(source, start, end, log)
            return
        for start, end, style in styled_blocks(source, layout, self.options.blank_between):
            yield style
            yield from transcriber.words(source, start, end, log)

    def _cut(self, word: PlacedWord, room: int) -> Cut:
        if self.source.kind is SourceKind.BRAILLE:
            return cut_anywhere(word, room)
        return self._transcriber.cut(word, room, self.layout.hyphen, self.layout.continuation)

    def _note(self, log: ReportLog, word: PlacedWord, cut: Cut) -> None:
        start = self.source.text[word.start : min(word.end, word.start + 80)]
        log.split(Split(start, (word.start, word.end), log.pages, cut.hyphenated))

    def check(self) -> BackCheck:
        """Read all frames as fingers would, back-translate, and compare with the source: together, and page by page.

        Holds the whole text and its cells at once; for the frames of a book use it on a part. What the frames of a
        text that is not long were encoded for before serves here too.
        """
        pages: list[FeltPage] = []
        scrolls = self.options.presentation is Presentation.SCROLL
        for _, group in groupby(self, key=lambda frame: frame.page):
            parts = list(group)
            dots = [np.abs(part.pattern.amplitude) > 0.5 for part in parts if part.travels == scrolls]
            emphases = emphases_within(self.source.emphases, *parts[0].span)
            cells, first = read_page(dots, self.encoding), parts[0]
            pages.append(FeltPage(cells, first.text, first.goes_on, emphases, first.number))
        return back_check(pages, self.source.text, self.encoding, self.source.emphases)
