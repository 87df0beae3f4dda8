"""Which line ends of a text are kept, and how its blocks stand on pages of several lines.

A line end that is kept becomes U+2028 in the text, Unicode's own sign for that: so the words of each such line are
written for themselves, and whoever reads the text of a page later sees the same lines. Where nothing is asked for,
these are kept on pages of several lines:

- of a document, line ends in headings, list items, table rows and verse;
- in paragraphs (of a plain text, say) that begin with the mark of a list (``-``, ``*``, a bullet; a number of up to
  three digits or a letter with ``.`` or ``)``), those before such a mark;
- those of a paragraph that is verse: no line has more than 80 characters, and at least half of the line ends were
  chosen, as the first word of the next line would have fit in the paragraph's longest line. Text that a program has
  wrapped has no such line end.

How blocks stand is the practice of many codes (Braille Formats of BANA, say): a paragraph begins two cells in; a title
is centred, other headings begin four or six cells in, with an empty line above; what runs over in lists, table rows and
verse is further in than where they begin; and an empty line stands before what begins where the block before went on,
such as a list after a paragraph.

Lines of Braille are kept, blank cells and pages too, where the longest fits in a line of the grid.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from itertools import groupby, pairwise

from ..choices import LineEnds
from ..documents.model import BlockKind
from .dots import BLANK
from .layout import FLUSH, NARROW, Layout, LineStyle
from .readers.sources import SourceKind, TextSource
from .transcribe import LINE_END, paragraphs

__all__ = ["BlockPlace", "keeps_cells", "styled_blocks", "styled_lines", "with_lines"]

BlockPlace = tuple[int, int, LineStyle]
"""(start, end) in the source of a block, or a line of one, and how it is laid out."""
LONGEST_VERSE = 80
INDENT = 2
_ITEM = re.compile(r"[^\S\n]*(?:[-*\u2022\u2023\u25e6\u2043\u00b7]|\d{1,3}[.)]|[A-Za-z][.)])[^\S\n]+(?=\S)")
_BEFORE_ITEM = re.compile(rf"\n(?={_ITEM.pattern})")
_BLANKS = BLANK + " \t"
_HEADING_INDENTS = {1: 0, 2: 4}
_DEEP_HEADING = 6
ROOM_TO_CENTRE = 24
"""Cells of a line in which a heading can be centred."""


def with_lines(source: TextSource, choice: LineEnds | None, layout: Layout) -> TextSource:
    """The source, U+2028 for the line ends that are kept and a newline for the others."""
    text = source.text.replace(LINE_END, "\n") if choice is LineEnds.JOIN or not layout.lined else source.text
    if source.kind is SourceKind.BRAILLE:
        if choice is LineEnds.KEEP or keeps_cells(source, choice, layout):
            text = source.text.replace("\n", LINE_END)
    elif choice is LineEnds.KEEP or (choice is None and layout.lined):
        text = _marked(source, choice)
    return source if text == source.text else replace(source, text=text)


def keeps_cells(source: TextSource, choice: LineEnds | None, layout: Layout) -> bool:
    """Whether the source is Braille whose lines and blank cells are shown as they are."""
    if source.kind is not SourceKind.BRAILLE or choice is LineEnds.JOIN or layout.cells_per_line < NARROW:
        return False
    return all(len(line.rstrip(_BLANKS)) <= layout.cells_per_line for line in _LINES.split(source.text))


_LINES = re.compile(f"[\n\f{LINE_END}]")


def _marked(source: TextSource, choice: LineEnds | None) -> str:
    parts: list[str] = []
    done = 0
    for start, end in paragraphs(source.text):
        paragraph = source.text[start:end].strip()
        if "\n" not in paragraph:
            continue
        start = source.text.index(paragraph, start)
        block = source.document.block_at(start) if source.document else None
        if choice is LineEnds.KEEP or (block and block.kind is not BlockKind.PARAGRAPH) or _is_verse(paragraph):
            marked = paragraph.replace("\n", LINE_END)
        elif _ITEM.match(paragraph):
            marked = _BEFORE_ITEM.sub(LINE_END, paragraph)
        else:
            continue
        parts += source.text[done:start], marked
        done = start + len(paragraph)
    return "".join([*parts, source.text[done:]])


def _is_verse(paragraph: str) -> bool:
    if _ITEM.match(paragraph):
        return False
    lines = [line.strip() for line in paragraph.split("\n")]
    longest = max(map(len, lines))
    chosen = sum(len(line) + 1 + len(after.split(None, 1)[0]) <= longest for line, after in pairwise(lines))
    return longest <= LONGEST_VERSE and 2 * chosen >= len(lines) - 1


def styled_blocks(source: TextSource, layout: Layout, apart: bool) -> Iterator[BlockPlace]:
    """The paragraphs of a source and their kept lines, each with its style; on pages of one run all are flush.

    Parameters
    ----------
    source : as `with_lines` gives it.
    layout : of the pages.
    apart : whether every paragraph begins a page.
    """
    deepest = _deepest_items(source) if layout.lined else {}
    before: LineStyle | None = None
    for lines in _paragraphs(source.text):
        first = FLUSH
        if layout.lined:
            first = _style(source, lines, layout.cells_per_line, deepest)._replace(page=apart)
            if before is None:
                goes_on = source.follows and (len(lines) == 1 or "\n" not in source.follows)
                first = first._replace(first=first.over) if goes_on else first
            elif first.first == before.over and not before.leads:
                first = first._replace(before=1)
            before = first
        for index, (start, end) in enumerate(lines):
            yield start, end, first if index == 0 else first._replace(before=0, page=False, line=True)


def _paragraphs(text: str) -> Iterator[list[tuple[int, int]]]:
    """(start, end) of the kept lines of each paragraph."""
    lines: list[tuple[int, int]] = []
    for start, end in paragraphs(text):
        if lines and _APART.search(text, lines[-1][1], start):
            yield lines
            lines = []
        lines.append((start, end))
    if lines:
        yield lines


_APART = re.compile(f"[\n\f\u2029]|{LINE_END}[^\\S{LINE_END}]*{LINE_END}")


def _deepest_items(source: TextSource) -> dict[int, int]:
    """For each item of a list in a document, by where it begins, the level of the deepest in that list."""
    found: dict[int, int] = {}
    blocks = source.document.blocks if source.document else ()
    for kind, group in groupby(blocks, key=lambda block: block.kind):
        if kind is BlockKind.LIST_ITEM:
            items = list(group)
            found |= dict.fromkeys((item.start for item in items), max(item.level for item in items))
    return found


def _style(source: TextSource, lines: list[tuple[int, int]], width: int, deepest_items: dict[int, int]) -> LineStyle:
    start = lines[0][0]
    block = source.document.block_at(start) if source.document else None
    kind, level = (block.kind, block.level) if block else (BlockKind.PARAGRAPH, 0)
    if kind is BlockKind.PARAGRAPH:
        if _ITEM.match(source.text, start):
            kind, level = BlockKind.LIST_ITEM, 1
        elif len(lines) > 1:
            kind = BlockKind.VERSE
    widest = width // 4
    if kind is BlockKind.HEADING:
        indent = min(_HEADING_INDENTS.get(level, _DEEP_HEADING), widest)
        return LineStyle(indent, indent, 1, centred=level == 1 and width >= ROOM_TO_CENTRE, leads=True)
    if kind is BlockKind.LIST_ITEM:
        most = max(widest - INDENT, 0)
        deepest = deepest_items.get(block.start, level) if block else level
        # Lines that run over are further in than any item of the list begins.
        return LineStyle(min(INDENT * (level - 1), most), min(INDENT * (deepest - 1), most) + INDENT)
    if kind is BlockKind.TABLE_ROW:
        return LineStyle(0, INDENT)
    if kind is BlockKind.VERSE:
        return LineStyle(0, INDENT, 1)
    return LineStyle(INDENT, 0)


def styled_lines(source: TextSource) -> Iterator[BlockPlace]:
    """The lines of Braille that is kept as it is, from their first dot to their last, with the blanks around them."""
    at = 0
    for page in source.text.split("\f"):
        empty, begun = 0, False
        for line in _LINES.split(page):
            shown = line.strip(_BLANKS)
            if shown:
                indent = line.index(shown)
                start = at + indent
                # Nothing goes on from line to line, so that no blank is ever owed.
                yield start, start + len(shown), LineStyle(indent, -1, empty, page=not begun, line=begun and not empty)
                begun = True
            empty = 0 if shown else empty + 1
            at += len(line) + 1
