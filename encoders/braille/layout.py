"""Where cells stand on a grid, and how words are laid out on pages so that the dots alone say where words end.

Cells are read in order: a word goes on from the last cell of a line into the first of the next, and a blank
ends it. Lines of eight or more cells are filled one by one, narrower ones page by page: the stretch within
which a word is kept whole is a *run* (a line, or a page). A word goes on in the next run

- where the run ends in the hyphen (in words of letters; one that the word has itself belongs to it) or in the
  sign of continuation (in words with other characters), where the language has them; blanks after it apart;
- where there is no such sign: where the run's last cell has dots and the first cell of the next has dots.

In any other case a word ends with the run. So where a word by chance ends like one that goes on, the next run
starts with a blank; and a first part that ends without a sign is moved to the end of its run. The part in the next
run begins with its indicators again (a number sign, a sign of capitals), so that each run can be read alone.
What exactly was added is in the page's `goes_on`, and from that pages are joined (see `encoders.braille.joining`).
Runs of fewer than four cells have no room for such signs.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from ..errors import LayoutError
from ..scene import GoesOn, GridShape
from .dots import BLANK

__all__ = ["Cut", "Layout", "Page", "PlacedWord", "cut_anywhere", "paginate"]

NARROW = 8
"""Lines of fewer cells have no room for hyphens; words flow over the lines of a page."""


@dataclass(frozen=True)
class Layout:
    """Cells of `height` (3 or 4) by 2 dots on a grid, with gaps between them in actuators.

    `hyphen` and `continuation` are the cells that end a run where a word goes on, empty where there are none.

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
    continuation: str = ""

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

    `text` is what the table was given for the word; its character k comes from the source position
    ``base + places[at + k]``, or ``base + at + k`` without `places`. `glued` continues the word before it; `lettered`
    says whether it is a word of letters (None: not asked yet), `kept` how many of its first cells are restated,
    `emphasis` how all of it stands out.
    """

    cells: str
    text: str
    start: int
    end: int
    places: Sequence[int] | None
    at: int
    base: int
    glued: bool
    lettered: bool | None = None
    kept: int = 0
    emphasis: int = 0

    def source(self, index: int) -> int:
        """Position in the source of character `index` of `text`."""
        place = self.at + index
        return self.base + (place if self.places is None else self.places[place])


class Cut(NamedTuple):
    """Where a word is cut, and how its parts are written.

    `text` and `cells` say how much of the word is behind us then. `first` is what is written of it, with the `mark`
    at its end and the `ending` before that, which are not of the word; `restated` is written before the rest, and
    `left_out` are the word's cells that stand in neither part. `hyphenated` is said of a cut at a syllable,
    `lettered` of a word of letters.
    """

    text: int
    cells: int
    first: str
    mark: str = ""
    restated: str = ""
    ending: str = ""
    left_out: str = ""
    hyphenated: bool = False
    lettered: bool = False


class Page(NamedTuple):
    """`cells` of a full page, lines run together and padded with blanks; `end_of_paragraph` after the last."""

    cells: str
    start: int
    end: int
    end_of_paragraph: bool
    goes_on: tuple[GoesOn, ...] = ()


SplitNote = Callable[[PlacedWord, Cut], None]
Cutting = Callable[[PlacedWord, int], Cut]


def cut_anywhere(word: PlacedWord, room: int) -> Cut:
    """The cut at the last cell of `room`, for words without a text of their own."""
    return Cut(room, room, word.cells[:room])


@dataclass
class _Filler:
    """The page being filled: `done` runs and the `run` at work, with the span of source they show."""

    layout: Layout
    done: list[str] = field(default_factory=list)
    goes_on: list[GoesOn] = field(default_factory=list)
    run: str = ""
    owed: bool = False
    last: str = ""
    start: int = -1
    end: int = 0

    def __post_init__(self) -> None:
        self.size = self.layout.run
        self.width = self.layout.cells_per_line
        self.runs_per_page = self.layout.capacity // self.layout.run

    def place(self, position: int, cells: str, word: PlacedWord, end: int) -> None:
        self.run = self.run.ljust(position, BLANK) + cells
        self.last = word.text
        if self.start < 0:
            self.start = word.start
        self.end = end

    def spot(self, word: PlacedWord) -> int:
        """Where a word goes in this run, -1 when it does not fit."""
        length = len(word.cells)
        position = len(self.run) + 1 if self.run else self.indent(word)
        rest = position % self.width
        if rest and rest + length > self.width:
            aligned = position + self.width - rest
            if aligned + length <= self.size:
                return aligned
            if self.run:
                return -1
        return position if position + length <= self.size else -1

    def indent(self, word: PlacedWord) -> int:
        """1 where the run before would be read on into this word, else 0."""
        if self.owed or not self.last:
            return int(self.owed)
        # Signs of letters only: a number that fills its run and a number after it could be one.
        return int(_has_digit(self.last) and _has_digit(word.text))

    def end_run(self, word_ends: bool) -> Iterator[Page]:
        layout, full = self.layout, len(self.run) == self.size
        signs = tuple(sign for sign in (layout.hyphen, layout.continuation) if sign)
        like_one = bool(signs) and self.run.endswith(signs)
        self.owed = word_ends and (like_one or (full and not layout.hyphen))
        if not (word_ends and full and layout.hyphen and not layout.continuation):
            self.last = ""
        self.done.append(self.run.ljust(self.size, BLANK))
        self.run = ""
        if len(self.done) == self.runs_per_page:
            yield self._page(False)

    def end_page(self) -> Iterator[Page]:
        """Ends the paragraph on this page; the last page of it carries the mark."""
        if not self.run and not self.done:
            return
        for page in self.end_run(True):
            yield page._replace(end_of_paragraph=True)
            return
        while len(self.done) < self.runs_per_page:
            self.owed, self.last = False, ""
            self.done.append(BLANK * self.size)
        yield self._page(True)

    def _page(self, last: bool) -> Page:
        start = self.start if self.start >= 0 else self.end
        page = Page("".join(self.done), start, self.end, last, tuple(self.goes_on))
        self.done.clear()
        self.goes_on.clear()
        self.start = -1
        return page


def _has_digit(text: str) -> bool:
    return any(char.isdigit() for char in text)


def paginate(words: Iterable[PlacedWord], layout: Layout, cut: Cutting, note: SplitNote) -> Iterator[Page]:
    """Pages of cells.

    Parameters
    ----------
    words : in reading order, the last one of each paragraph followed by one without cells.
    cut : where to cut a word that has more cells than the room given.
    note : told of every cut.
    """
    filler = _Filler(layout)
    held: PlacedWord | None = None
    for word in words:
        if held is not None and word.glued:
            held = _glued((yield from _fitted(held, filler, cut, note)), word)
            continue
        if held is not None:
            held = yield from _fitted(held, filler, cut, note)
            filler.place(filler.spot(held), held.cells, held, held.end)
        held = word if word.cells else None
        if held is None:
            yield from filler.end_page()


def _glued(before: PlacedWord, word: PlacedWord) -> PlacedWord:
    places = [part.source(index) for part in (before, word) for index in range(len(part.text))]
    return PlacedWord(
        before.cells + word.cells, before.text + word.text, before.start, word.end, places, 0, 0, False, before.lettered
    )


def _fitted(word: PlacedWord, filler: _Filler, cut: Cutting, note: SplitNote) -> Generator[Page, None, PlacedWord]:
    """The word, or what is left of it when its first parts are placed, with a run that has room for it."""
    if filler.spot(word) >= 0:
        return word
    if filler.run:
        yield from filler.end_run(True)
    whole = word
    while filler.spot(word) < 0:
        room = filler.size - filler.indent(word)
        if not room:
            # A single cell has no other place for the blank between two words.
            yield from filler.end_run(True)
            continue
        found = cut(word, room)
        note(whole, found)
        word = yield from _part(word, found, filler)
    return word


def _part(word: PlacedWord, found: Cut, filler: _Filler) -> Generator[Page, None, PlacedWord]:
    """Place the first part of a word, and give the rest."""
    signs = tuple(sign for sign in (filler.layout.hyphen, filler.layout.continuation) if sign)
    marked = bool(signs) and found.first.endswith(signs)
    position = filler.indent(word) if marked else filler.size - len(found.first)
    end = start = word.end
    if 0 < found.text < len(word.text):
        start = word.source(found.text)
        # A character whose name is cut is shown on both pages.
        shared = start == word.source(found.text - 1)
        end = start + 1 if shared else max(start, word.start + 1)
        start = start if shared else end
    filler.place(position, found.first, word, end)
    filler.goes_on.append(GoesOn(len(filler.done), found.mark, found.restated, found.ending, found.left_out))
    yield from filler.end_run(False)
    return word._replace(
        cells=found.restated + word.cells[found.cells :],
        text=word.text[found.text :],
        at=word.at + found.text,
        start=min(start, word.end - 1),
        lettered=found.lettered,
        kept=len(found.restated),
    )
