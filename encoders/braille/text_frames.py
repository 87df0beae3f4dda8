"""The frames of a text, made while they are consumed."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterator
from dataclasses import replace
from itertools import groupby
from operator import itemgetter
from typing import Any

import numpy as np

from ..choices import PageNumbering, Presentation
from ..scene import Frame, PageNumber, TargetPattern
from .back_check import BackCheck, FeltPage, back_check
from .dots import BLANK
from .filling import paginate
from .joining import emphases_within
from .layout import Cut, Layout, LineStyle, Page, PlacedWord, SplitNote, cut_anywhere
from .lines import keeps_cells, styled_blocks, styled_lines
from .presentation import MIN_PART_S, presenter, read_cells
from .readers.sources import SourceKind, TextSource
from .report import EncodingReport, ReportLog, Split
from .text_options import WIDE, TextOptions
from .transcribe import PARAGRAPH_END, Transcriber

__all__ = ["TextFrames"]

DEFAULT_RATE = 6.0
SHORT_PAGE_S = 1.0
"""A page with few cells lasts as long as it would with more, up to this."""
MOST_KEPT = 1 << 18
"""Actuators of all frames of a text together, up to which its frames are kept: 7281 frames of 6 x 6, some 10 MB."""


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
        text, between = self.source.text, False
        own_frame = self.options.page_numbers is PageNumbering.FRAME
        total = sum(1 for _ in self.page_spans()) if own_frame else 0
        for number, page in enumerate(self._pages(log, self._note)):
            if between:
                yield self._blank_frame(log, page.start)
            if own_frame:
                yield from self._number_frames(log, number + 1, total, page.start)
            # A break between paragraphs belongs to the page before it, so that the spans tell where it was.
            gap = PARAGRAPH_END.match(text, page.end) if page.end_of_block else None
            span = (page.start, gap.end() if gap else page.end)
            first, last = (bisect_left(self._headings, place, key=itemgetter(0)) for place in span)
            headings = tuple(heading for _, heading in self._headings[first:last])
            for frame in self._shown(page, log.pages):
                yield replace(frame, text=text[slice(*span)], span=span, goes_on=page.goes_on, headings=headings)
                headings = ()
                log.frames += 1
            log.cells += len(page.cells) - page.cells.count(BLANK)
            log.pages += 1
            between = self.options.blank_between and page.end_of_paragraph

    def _shown(self, page: Page, number: int) -> Iterator[Frame]:
        """The frames of a page: its cells in one part or several, and how long."""
        shown = self._show(page.cells)
        said = page.cells if page.number is None else page.cells[: page.number.at]
        cells = len(said.rstrip(BLANK)) + (len(page.number.cells) if page.number else 0)
        dwell_s = max(self._shortest_s, cells * self._s_per_cell)
        share_s = dwell_s if len(shown.parts) == 1 else max(dwell_s / len(shown.parts), MIN_PART_S)
        for pattern in shown.parts:
            yield Frame(pattern, share_s, number, cells=shown.cells, number=page.number)

    def _number_frames(self, log: ReportLog, number: int, total: int, position: int) -> Iterator[Frame]:
        """The number of the page to come and of all, on a page or where that is too small on two."""
        write, room = self._transcriber.number, self.layout.capacity
        whole = write(f"{number}/{total}")
        for cells in [whole] if len(whole) <= room else [write(f"{number}"), write(f"/{total}")]:
            sign = cells[-room:]
            page = Page(sign.ljust(room, BLANK), position, position, False, False, number=PageNumber(0, sign))
            for frame in self._shown(page, log.pages):
                yield replace(frame, span=(position, position))
                log.frames += 1
            log.pages += 1

    def _corner(self, number: int) -> str:
        """The cells at the end of a page with its number: on narrow lines the last digit alone."""
        cells = self._transcriber.number(str(number))
        return 2 * BLANK + cells if self.layout.cells_per_line >= WIDE else cells[-1:]

    def _pages(self, log: ReportLog, note: SplitNote) -> Iterator[Page]:
        numbered = self._corner if self.options.page_numbers is PageNumbering.CORNER else None
        blanks = self.options.blank_between
        return paginate(self._words(log), self.layout, self._cut, note, numbered, blanks)

    def page_spans(self) -> Iterator[tuple[int, int]]:
        """(start, end) in the source of every page, blank ones too, but not of numbers; nothing is drawn."""
        between = False
        for page in self._pages(ReportLog(), lambda word, cut: None):
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
        source, transcriber = self.source, self._transcriber
        if keeps_cells(source, self.options.lines, self.layout):
            for start, end, style in styled_lines(source):
                yield style
                yield from transcriber.kept_line(source, start, end, log)
            return
        for start, end, style in styled_blocks(source, self.layout, self.options.blank_between):
            yield style
            yield from transcriber.words(source, start, end, log)

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
            cells, first = read_cells(dots, self.encoding), parts[0]
            pages.append(FeltPage(cells, first.text, first.goes_on, emphases, first.number))
        return back_check(pages, self.source.text, self.encoding, self.source.emphases)
