"""Where cells stand on a grid, and the words and pages that are laid out so that the dots alone say where words end.

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

A page of several runs (lines) holds block after block, as many as there is room for, with the indents and empty lines
of their `LineStyle`; there "the first cell" of a run is the first after its indent. A page of one run holds words of
one block only. How pages are filled is in `encoders.braille.filling`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

from ..errors import LayoutError
from ..scene import GoesOn, GridShape, PageNumber

__all__ = ["FLUSH", "Cut", "Cutting", "Layout", "LineStyle", "Page", "PlacedWord", "cut_anywhere"]

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

    @cached_property
    def lines(self) -> int:
        """Lines on a page."""
        return (self.shape.rows + self.line_gap) // (self.height + self.line_gap)

    @cached_property
    def cells_per_line(self) -> int:
        """Cells in a line."""
        return (self.shape.cols + self.cell_gap) // (2 + self.cell_gap)

    @cached_property
    def capacity(self) -> int:
        """Cells on a page."""
        return self.lines * self.cells_per_line

    @cached_property
    def run(self) -> int:
        """Cells in a run: a line, or a page when lines are narrow."""
        return self.cells_per_line if self.cells_per_line >= NARROW else self.capacity

    @cached_property
    def lined(self) -> bool:
        """Whether a page is several runs, each a line."""
        return self.run < self.capacity


class LineStyle(NamedTuple):
    """How a block is laid out; it ends the block before it.

    `first` blank cells stand before the first line, `over` before the others, `before` empty lines above it. A block
    that is `centred` is so with three blank cells on both sides. One that `leads` to what follows never ends a page.
    `page`: it begins a page. `line`: it is the next line of the same paragraph.
    """

    first: int = 0
    over: int = 0
    before: int = 0
    centred: bool = False
    leads: bool = False
    page: bool = False
    line: bool = False


FLUSH = LineStyle()


class PlacedWord(NamedTuple):
    """Cells of a word, and where they come from. A line of Braille that is kept as it is counts as one.

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
    """`cells` of a full page, lines run together and padded with blanks.

    `end_of_block` where what is last on it ends there: a paragraph (`end_of_paragraph`), or a kept line of one.
    `number` is the page's number where it stands among the cells, which are not of the text there. `cuts` are the words
    that are cut on it.
    """

    cells: str
    start: int
    end: int
    end_of_block: bool
    end_of_paragraph: bool
    goes_on: tuple[GoesOn, ...] = ()
    number: PageNumber | None = None
    cuts: tuple[tuple[PlacedWord, Cut], ...] = ()


Cutting = Callable[[PlacedWord, int], Cut]


def cut_anywhere(word: PlacedWord, room: int) -> Cut:
    """The cut at the last cell of `room`, for words without a text of their own."""
    return Cut(room, room, word.cells[:room])
