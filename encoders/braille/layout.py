"""Where cells stand on a grid, and how words are laid out on pages so that the dots alone say where words end.

Cells are read in order: a word goes on from the last cell of a line into the first of the next, and a blank
ends it. Lines of eight or more cells are filled one by one, narrower ones page by page: the stretch within
which a word is kept whole is a *run* (a line, or a page). The rules between two runs:

- a run that ends in the hyphen (blanks after it apart), followed by a run whose first cell has dots: the
  hyphen is not part of the word, which goes on;
- where there is no hyphen (the language has no hyphenation dictionary), a run whose last cell has dots,
  followed by a run whose first cell has dots: the word goes on;
- in any other case a word ends with the run.

So where a word ends in a hyphen of its own, or without hyphens in the last cell, the next run starts with a
blank.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from ..errors import LayoutError
from ..scene import GridShape
from .dots import BLANK

__all__ = ["Layout", "Page", "PlacedWord", "join_pages", "paginate"]

NARROW = 8
"""Lines of fewer cells have no room for hyphens; words flow over the lines of a page."""
SHORTEST_PIECE = 2
"""Cells of a word that stand alone before or after a hyphen, at least."""


@dataclass(frozen=True)
class Layout:
    """Cells of `height` (3 or 4) by 2 dots on a grid, with gaps between them in actuators.

    Raises
    ------
    LayoutError
        When a gap is below 0 or the grid has no room for one cell.
    """

    shape: GridShape
    height: int
    cell_gap: int = 0
    line_gap: int = 0
    hyphen: str = ""

    def __post_init__(self) -> None:
        for name, gap in (("cell-gap", self.cell_gap), ("line-gap", self.line_gap)):
            if gap < 0:
                raise LayoutError(f"{name}: expected a whole number >= 0, got {gap}")
        if self.lines < 1 or self.cells_per_line < 1:
            raise LayoutError(
                f"a grid of {self.shape.rows} x {self.shape.cols} actuators has no room for a cell of {self.height} x 2"
            )

    @property
    def lines(self) -> int:
        """Lines on a page."""
        return (self.shape.rows + self.line_gap) // (self.height + self.line_gap)

    @property
    def cells_per_line(self) -> int:
        """Cells in a line."""
        return (self.shape.cols + self.cell_gap) // (2 + self.cell_gap)

    @property
    def capacity(self) -> int:
        """Cells on a page."""
        return self.lines * self.cells_per_line

    @property
    def run(self) -> int:
        """Cells in a run: a line, or a page when lines are narrow."""
        return self.cells_per_line if self.cells_per_line >= NARROW else self.capacity


class PlacedWord(NamedTuple):
    """Cells without a blank among them, and where they come from; ``cells == ""`` ends a paragraph.

    `origin` holds source positions, that of cell k at ``origin[at + k] + base``; `glued` continues the word
    before it.
    """

    cells: str
    start: int
    end: int
    origin: Sequence[int]
    at: int
    base: int
    glued: bool


class Page(NamedTuple):
    """`cells` of a full page, lines run together and padded with blanks; `end_of_paragraph` after the last."""

    cells: str
    start: int
    end: int
    end_of_paragraph: bool


SplitNote = Callable[[PlacedWord, int, bool], None]
Breaks = Callable[[PlacedWord], Sequence[int]]


class _Filler:
    """The page being filled: `done` runs and the `run` at work, with the span of source they show."""

    def __init__(self, layout: Layout) -> None:
        self.layout = layout
        self.size = layout.run
        self.width = layout.cells_per_line
        self.runs_per_page = layout.capacity // layout.run
        self.done: list[str] = []
        self.run = ""
        self.owed = False
        self.start = -1
        self.end = 0

    def place(self, position: int, cells: str, start: int, end: int) -> None:
        self.run = self.run.ljust(position, BLANK) + cells
        if self.start < 0:
            self.start = start
        self.end = end

    def spot(self, length: int) -> int:
        """Where a word of `length` goes in this run, -1 when it does not fit."""
        position = len(self.run) + 1 if self.run else int(self.owed)
        rest = position % self.width
        if rest and rest + length > self.width:
            aligned = position + self.width - rest
            if aligned + length <= self.size:
                return aligned
            if self.run:
                return -1
        return position if position + length <= self.size else -1

    def end_run(self, word_ends: bool) -> Iterator[Page]:
        goes_on = self.ends_in_hyphen() if self.layout.hyphen else len(self.run) == self.size
        self.owed = word_ends and goes_on
        self.done.append(self.run.ljust(self.size, BLANK))
        self.run = ""
        if len(self.done) == self.runs_per_page:
            yield self._page(False)

    def ends_in_hyphen(self) -> bool:
        return bool(self.layout.hyphen) and self.run.endswith(self.layout.hyphen)

    def end_page(self) -> Iterator[Page]:
        """Ends the paragraph on this page; the last page of it carries the mark."""
        if not self.run and not self.done:
            return
        for page in self.end_run(True):
            yield page._replace(end_of_paragraph=True)
            return
        while len(self.done) < self.runs_per_page:
            self.owed = False
            self.done.append(BLANK * self.size)
        yield self._page(True)

    def _page(self, last: bool) -> Page:
        page = Page("".join(self.done), self.start if self.start >= 0 else self.end, self.end, last)
        self.done.clear()
        self.start = -1
        return page


def paginate(words: Iterable[PlacedWord], layout: Layout, breaks: Breaks, note: SplitNote) -> Iterator[Page]:
    """Pages of cells.

    Parameters
    ----------
    words : in reading order.
    breaks : cells of a word before which a hyphen may stand.
    note : told of every break inside a word.
    """
    filler = _Filler(layout)
    for word in words:
        if not word.cells:
            yield from filler.end_page()
            continue
        if word.glued:
            yield from _split(word, filler, (), note)
            continue
        position = filler.spot(len(word.cells))
        if position < 0 and filler.run:
            yield from filler.end_run(True)
            position = filler.spot(len(word.cells))
        if position < 0 and filler.owed and len(word.cells) == filler.size:
            yield from filler.end_run(True)
            position = 0
        if position < 0:
            yield from _split(word, filler, breaks(word), note)
        else:
            filler.place(position, word.cells, word.start, word.end)


def _split(word: PlacedWord, filler: _Filler, breaks: Sequence[int], note: SplitNote) -> Iterator[Page]:
    """Place a word over several runs: at a syllable where one fits, else at the last cell."""
    cells, carried, taken, start = word.cells, 0, 0, word.start
    if word.glued and filler.layout.hyphen and len(filler.run) == filler.size:
        # The word went on unforeseen: its last cell makes room for the hyphen that says so.
        cells, carried = filler.run[-1] + cells, 1
        filler.run = filler.run[:-1] + filler.layout.hyphen
        yield from filler.end_run(False)
    position = len(filler.run) if word.glued else int(filler.owed)
    filler.owed = False
    while len(cells) - taken > filler.size - position:
        cut, hyphen = _cut(cells, taken, filler.size - position, breaks, filler.layout.hyphen)
        if cut > taken or hyphen:
            end = max(word.base + word.origin[word.at + max(0, cut - carried)], start + 1)
            filler.place(position, cells[taken:cut] + hyphen, start, end)
            start = min(end, word.end - 1)
        note(word, cut, bool(hyphen))
        yield from filler.end_run(False)
        taken, position = cut, 0
    if taken < len(cells):
        filler.place(position, cells[taken:], start, word.end)


def _cut(cells: str, taken: int, room: int, breaks: Sequence[int], hyphen: str) -> tuple[int, str]:
    """Where the piece from `taken` ends, and the hyphen written after it."""
    last = taken + room - len(hyphen)
    highest = min(last, len(cells) - SHORTEST_PIECE) if hyphen else -1
    fitting = [at for at in breaks if taken + SHORTEST_PIECE <= at <= highest]
    return (fitting[-1] if fitting else last), hyphen


def join_pages(pages: Iterable[str], encoding: Mapping[str, Any]) -> str:
    """The cells of all pages as one line of Braille with single blanks, split words joined again.

    Parameters
    ----------
    pages : Unicode Braille with a newline after each line but the last, as `Frame.cells` and `read_cells` give it.
    encoding : of the scene; ``run`` and ``hyphen`` are used.
    """
    size, hyphen = int(encoding["run"]), str(encoding["hyphen"])
    parts: list[str] = []
    open_word = False
    for page in pages:
        cells = page.replace("\n", "")
        open_word = open_word and bool(cells)
        for at in range(0, len(cells), size):
            run = cells[at : at + size]
            if not (open_word and run[0] != BLANK):
                parts.append(BLANK)
            elif hyphen:
                parts[-1] = parts[-1][: -len(hyphen)]
            shown = run.rstrip(BLANK)
            parts.append(shown)
            open_word = shown.endswith(hyphen) if hyphen else len(shown) == size
    return BLANK.join(part for part in "".join(parts).split(BLANK) if part)
