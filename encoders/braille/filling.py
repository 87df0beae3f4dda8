"""Words laid out on pages, one run after another; see `encoders.braille.layout` for what is promised."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

from ..scene import GoesOn, PageNumber
from .dots import BLANK
from .layout import FLUSH, Cut, Cutting, Layout, LineStyle, Page, PlacedWord

__all__ = ["paginate"]

MARGIN = 3
"""Blank cells on both sides of a block that is centred."""


@dataclass(slots=True)
class _Run:
    """A run of a page: its cells, the span of source they show, and what is cut at its end."""

    cells: str = ""
    start: int = -1
    end: int = 0
    leads: bool = False
    ends_block: bool = False
    ends_paragraph: bool = False
    cut: tuple[PlacedWord, Cut] | None = None


class _Filler:
    """The page being filled: the runs that are `done`, and the `run` at work, of which `size` cells may be taken.

    What a word or a style fills is in `made`, for whoever asks to take out.

    Parameters
    ----------
    layout : of the pages.
    cut : where to cut a word that has more cells than the room given.
    numbered : the cells at the end of page n that show its number, blanks before them included; None for none.
    blanks : whether a blank page follows every paragraph, and is counted.
    """

    def __init__(self, layout: Layout, cut: Cutting, numbered: Callable[[int], str] | None, blanks: bool) -> None:
        self.layout = layout
        self.runs_per_page = layout.capacity // layout.run
        self.width = layout.cells_per_line
        self.signs = tuple(sign for sign in (layout.hyphen, layout.continuation) if sign)
        self.made: list[Page] = []
        self.done: list[_Run] = []
        self.style = FLUSH
        self.first = True
        self.owed = False
        self.last = ""
        self._cut, self._numbered, self._blanks = cut, numbered, blanks
        self._page_number, self._end = 1, 0
        self._tail = numbered(1) if numbered else ""
        self._new_run()

    def _new_run(self) -> None:
        self.run = _Run(end=self._end, leads=self.style.leads)
        self.size = self.layout.run - MARGIN * self.style.centred
        if len(self.done) == self.runs_per_page - 1:
            self.size -= len(self._tail)

    def put(self, word: PlacedWord) -> None:
        """Put a word where it goes, in parts where it does not fit."""
        word, position = self.fitted(word)
        self.place(position, word.cells, word, word.end)

    def fitted(self, word: PlacedWord) -> tuple[PlacedWord, int]:
        """The word, or what is left of it when its first parts are placed, and where it goes in the run."""
        position = self.spot(word)
        if position < 0 and self.run.cells:
            self.end_run(True)
            position = self.spot(word)
        whole = word
        while position < 0:
            room = self.size - self.indent(word)
            if self.cramped(word):
                self.break_page()
            elif room < 1:
                # A single cell has no other place for the blank between two words.
                self.end_run(True)
            else:
                found = self._cut(word, room)
                self.run.cut = whole, found
                word = self._part(word, found)
            position = self.spot(word)
        return word, position

    def _part(self, word: PlacedWord, found: Cut) -> PlacedWord:
        """Place the first part of a word, and give the rest."""
        marked = bool(self.signs) and found.first.endswith(self.signs)
        position = self.indent(word) if marked else self.size - len(found.first)
        end = start = word.end
        if 0 < found.text < len(word.text):
            start = word.source(found.text)
            # A character whose name is cut is shown on both pages.
            shared = start == word.source(found.text - 1)
            end = start + 1 if shared else max(start, word.start + 1)
            start = start if shared else end
        self.place(position, found.first, word, end)
        self.end_run(False)
        return word._replace(
            cells=found.restated + word.cells[found.cells :],
            text=word.text[found.text :],
            at=word.at + found.text,
            start=min(start, word.end - 1),
            lettered=found.lettered,
            kept=len(found.restated),
        )

    def place(self, position: int, cells: str, word: PlacedWord, end: int) -> None:
        """Put cells of a word in the run at work."""
        run = self.run
        run.cells = run.cells.ljust(position, BLANK) + cells
        self.last = word.text
        if run.start < 0:
            run.start = word.start
        run.end = self._end = end

    def spot(self, word: PlacedWord) -> int:
        """Where a word goes in this run, -1 when it does not fit."""
        length = len(word.cells)
        position = len(self.run.cells) + 1 if self.run.cells else self.indent(word)
        rest = position % self.width
        if rest and rest + length > self.width:
            aligned = position + self.width - rest
            if aligned + length <= self.size:
                return aligned
            if self.run.cells:
                return -1
        return position if position + length <= self.size else -1

    def indent(self, word: PlacedWord) -> int:
        """Blank cells before a word that begins a run: one more where the run before would be read on into it."""
        base = MARGIN if self.style.centred else self.style.first if self.first else self.style.over
        if self.owed or not self.last:
            return base + self.owed
        # Signs of letters only: a number that fills its run and a number after it could be one.
        return base + (_has_digit(self.last) and _has_digit(word.text))

    def cramped(self, word: PlacedWord) -> bool:
        """Whether a word would fit an empty run, if it were not for the page's number in it."""
        beside = self.layout.lined and not self.run.cells and bool(self.done) and self.size < self.layout.run
        margin = MARGIN * self.style.centred
        return beside and self.indent(word) + len(word.cells) <= self.layout.run - margin

    def begin(self, style: LineStyle) -> None:
        """End the block at work, and begin one of this style."""
        if self.run.cells:
            self.run.ends_block, self.run.ends_paragraph = True, not style.line
            self.end_run(True)
        if self.layout.lined:
            if style.page:
                self.end_page()
            self._skip_lines(style)
            if style.first != self.style.over or (self.done and not self.done[-1].cells):
                # Where it begins, or an empty line, says that no word goes on in it.
                self.owed, self.last = False, ""
        self.style, self.first = style, True
        self._new_run()

    def _skip_lines(self, style: LineStyle) -> None:
        """The empty lines above a block; where they and its first line do not fit, the page ends."""
        if self.done and len(self.done) + style.before + 1 + style.leads > self.runs_per_page:
            self.break_page()
        if (self.done or style.page) and len(self.done) + style.before < self.runs_per_page:
            leads = bool(self.done) and self.done[-1].leads
            self.done += [_Run(end=self._end, leads=leads) for _ in range(style.before)]

    def end_run(self, word_ends: bool) -> None:
        """End the run at work; `word_ends` where its last word does not go on in the next."""
        layout, run = self.layout, self.run
        full = len(run.cells) == self.size
        self.owed = word_ends and (run.cells.endswith(self.signs) if self.signs else False)
        self.owed = self.owed or (word_ends and full and not layout.hyphen)
        if not (word_ends and full and layout.hyphen and not layout.continuation):
            self.last = ""
        if self.style.centred and word_ends:
            run.cells = BLANK * ((self.size - len(run.cells)) // 2) + run.cells
        run.cells = run.cells.ljust(layout.run, BLANK)
        self.done.append(run)
        self.first = False
        if len(self.done) == self.runs_per_page:
            self.break_page()
        self._new_run()

    def break_page(self) -> None:
        """End the page; what leads to the next lines goes to them, unless the page has nothing else."""
        kept = len(self.done)
        while kept and self.done[kept - 1].leads:
            kept -= 1
        kept = kept or len(self.done)
        rest = self.done[kept:]
        del self.done[kept:]
        self.end_page()
        self.done += rest

    def end_page(self) -> None:
        """The page as it is, if there is anything on it."""
        runs, layout = self.done, self.layout
        self.done = []
        cells, start, last = "", -1, None
        goes_on: list[GoesOn] = []
        cuts: list[tuple[PlacedWord, Cut]] = []
        for number, run in enumerate(runs):
            cells += run.cells or BLANK * layout.run
            if run.start >= 0:
                start, last = run.start if start < 0 else start, run
            if run.cut is not None:
                _, cut = run.cut
                goes_on.append(GoesOn(number, cut.mark, cut.restated, cut.ending, cut.left_out))
                cuts.append(run.cut)
        if last is None and (layout.lined or not runs):
            return
        last = last or runs[-1]
        start, cells = start if start >= 0 else last.end, cells.ljust(layout.capacity, BLANK)
        page = Page(cells, start, last.end, last.ends_block, last.ends_paragraph, tuple(goes_on), None, tuple(cuts))
        self.made.append(self._with_number(page))
        self._page_number += 1 + (self._blanks and last.ends_paragraph)
        if self._numbered is not None:
            self._tail = self._numbered(self._page_number)

    def _with_number(self, page: Page) -> Page:
        if not self._tail:
            return page
        at = len(page.cells) - len(self._tail)
        sign = self._tail.lstrip(BLANK)
        return page._replace(cells=page.cells[:at] + self._tail, number=PageNumber(len(page.cells) - len(sign), sign))


def _has_digit(text: str) -> bool:
    return any(char.isdigit() for char in text)


def paginate(
    words: Iterable[PlacedWord | LineStyle],
    layout: Layout,
    cut: Cutting,
    numbered: Callable[[int], str] | None = None,
    blanks: bool = False,
) -> Iterator[Page]:
    """Pages of cells.

    Parameters
    ----------
    words : in reading order, a style before each block; without one they are one block, flush.
    layout : of the pages.
    cut : where to cut a word that has more cells than the room given.
    numbered : the cells at the end of page n, from 1, that show its number, blanks before them included; None where
        none do.
    blanks : whether a blank page follows every paragraph, and is counted.
    """
    filler = _Filler(layout, cut, numbered, blanks)
    made = filler.made
    held: PlacedWord | None = None
    for word in words:
        if not isinstance(word, PlacedWord):
            if held is not None:
                filler.put(held)
                held = None
            filler.begin(word)
        elif held is not None and word.glued:
            held = _glued(filler.fitted(held)[0], word)
        else:
            if held is not None:
                filler.put(held)
            held = word
        if made:
            yield from made
            made.clear()
    if held is not None:
        filler.put(held)
    filler.begin(FLUSH)
    filler.end_page()
    yield from made


def _glued(before: PlacedWord, word: PlacedWord) -> PlacedWord:
    places = [part.source(index) for part in (before, word) for index in range(len(part.text))]
    return PlacedWord(
        before.cells + word.cells, before.text + word.text, before.start, word.end, places, 0, 0, False, before.lettered
    )
