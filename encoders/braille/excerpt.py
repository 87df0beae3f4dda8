"""A part of a text: from a page, a chapter or certain words on, and some of its pages."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from itertools import islice

from ..errors import LayoutError
from .readers.sources import TextSource

__all__ = ["excerpt"]

PageSpans = Callable[[TextSource], Iterator[tuple[int, int]]]
MOST_LISTED = 12
_PAGES = re.compile(r"(\d{1,9})?\s*(-)?\s*(\d{1,9})?")


def excerpt(
    source: TextSource, start_at: str | int | None, pages: str | int | None, page_spans: PageSpans
) -> TextSource:
    """The part of a source that begins at `start_at` and has the `pages` counted from there.

    Parameters
    ----------
    source : the whole.
    start_at : a page, counted from 1; or the words of a heading, or how they begin; or words of the text.
    pages : such as ``10-20``, ``10-``, ``-20`` or ``7``.
    page_spans : the (start, end) of every page of a source.

    Raises
    ------
    LayoutError
        When there is no such page, heading or word, or the pages cannot be read.
    """
    if start_at is not None:
        number = str(start_at).strip()
        if number.isdecimal():
            source = _paged(source, int(number), None, page_spans, "from")
        else:
            source = source.part(_position(source, number), len(source.text))
    if pages is None:
        return source
    found = _PAGES.fullmatch(str(pages).strip())
    if found is None or not (found[1] or found[3]):
        raise LayoutError(f"pages: expected pages such as 10-20, 10- or 7, got {pages!r}")
    first = int(found[1] or 1)
    last = int(found[3]) if found[3] else None if found[2] else first
    if first < 1 or (last is not None and last < first):
        raise LayoutError(f"pages: expected pages from 1 on in their order, got {pages!r}")
    return _paged(source, first, last, page_spans, "pages")


def _paged(source: TextSource, first: int, last: int | None, page_spans: PageSpans, name: str) -> TextSource:
    """Pages from `first` to `last`; a word that two pages share belongs to both."""
    if first < 1:
        raise LayoutError(f"{name}: pages are counted from 1, got {first}")
    found = list(islice(page_spans(source), last))
    if len(found) < first:
        raise LayoutError(f"{name}: {source.name} has {len(found)} pages, so there is no page {first}")
    start, end = found[first - 1][0], len(source.text) if last is None else found[-1][1]
    text = source.text
    while start > 0 and not text[start - 1].isspace():
        start -= 1
    while end < len(text) and not text[end].isspace():
        end += 1
    return source.part(start, end)


def _position(source: TextSource, words: str) -> int:
    """Where the heading stands that is, or begins with, these words; else where the text has them first."""
    headings = source.document.headings(source.text) if source.document else []
    wanted = " ".join(words.casefold().split())
    said = [(position, " ".join(heading.text.casefold().split())) for position, heading in headings]
    for matches in (str.__eq__, str.startswith):
        for position, text in said:
            if wanted and matches(text, wanted):
                return position
    pattern = r"\s+".join(map(re.escape, words.split()))
    found = re.search(pattern, source.text, re.IGNORECASE) if pattern else None
    if found is None:
        listed = ", ".join(repr(heading.text) for _, heading in headings[:MOST_LISTED])
        there = f"; its headings are {listed}" if listed else ""
        raise LayoutError(f"from: {source.name} has no page, heading or words {words!r}{there}")
    return found.start()
