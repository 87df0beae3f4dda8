"""From source text to Braille words with their source positions, paragraph by paragraph, piece by piece."""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Callable, Iterator, Sequence
from functools import cache, lru_cache
from itertools import islice
from typing import NamedTuple

from ..choices import Undefined
from ..errors import EmptyText
from . import louis_binding
from .alphabet import alphabet
from .cuts import Cutter, continuation_sign
from .dots import BLANK, HIGHEST_6_DOT, LOWER_SIX
from .layout import Cut, PlacedWord, cut_anywhere
from .readers.sources import SourceKind, TextSource
from .report import ReportLog
from .tables import hyphenation_tables
from .translation import translated
from .undefined import ZERO_WIDTH_JOINER, Writable, extends, writable

__all__ = ["LINE_END", "PARAGRAPH_END", "Transcriber", "paragraphs", "refuse_unwritable"]

PIECE = 2000
"""Characters handed to liblouis at once, at most; its answers cost about a hundred bytes a character."""
LINE_END = "\u2028"
"""A line end that is kept, see `encoders.braille.lines`; what is before and after it is written apart."""
# Blanks are looked at from where they begin, or a long run of them would be gone through from each.
PARAGRAPH_END = re.compile(r"\n[^\S\n]*\n\s*|(?<!\s)\s*[\f\u2028\u2029]\s*|[\f\u2028\u2029]\s*")
_SPACE = re.compile(r"\s")
_WORD = re.compile(r"\S+")
_ARROWS = "\u2190"


class _Piece(NamedTuple):
    """Some of a text: its cells, the place of each in the text that was written, that text, its emphases."""

    cells: str
    origin: list[int]
    ready: Writable
    forms: list[int] | None


def _forms(
    emphases: Sequence[tuple[int, int, int]], start: int, stop: int, origins: Sequence[int] | None
) -> list[int] | None:
    """The emphasis of each character that is written of ``start:stop``, None where nothing stands out."""
    first = bisect_right(emphases, start, key=lambda one: one[1])
    forms: list[int] | None = None
    for begin, end, form in islice(emphases, first, None):
        if begin >= stop:
            break
        forms = forms or [0] * (stop - start)
        low, high = max(begin, start) - start, min(end, stop) - start
        forms[low:high] = [form] * (high - low)
    return forms if forms is None or origins is None else [forms[place] for place in origins]


def _emphasis_of(forms: Sequence[int], start: int, stop: int) -> int:
    """The emphasis of a word, 0 where its characters differ."""
    found = set(forms[start:stop])
    return found.pop() if len(found) == 1 else 0


def paragraphs(text: str) -> Iterator[tuple[int, int]]:
    """(start, end) of each paragraph: parted by an empty line, a form feed or a line end that is kept."""
    start = 0
    for match in PARAGRAPH_END.finditer(text):
        if text[start : match.start()].strip():
            yield start, match.start()
        start = match.end()
    if text[start:].strip():
        yield start, len(text)


class Transcriber:
    """Writes sources in Braille with one list of tables.

    Parameters
    ----------
    tables : as `resolve_tables` gives them.
    undefined : policy.
    dots : 6 leaves dots 7 and 8 out, 8 keeps them.
    passages : whether capitals of several words may be marked once for all; without, each page can be read alone.
    """

    def __init__(self, tables: tuple[str, ...], undefined: Undefined, dots: int, passages: bool = True) -> None:
        self.tables = tables
        self.undefined = undefined
        self.dots = dots
        self.passages = passages

    def words(self, source: TextSource, start: int, end: int, log: ReportLog) -> Iterator[PlacedWord]:
        """Words of one paragraph; together their spans hold every character that is not white space."""
        text = source.text
        held: PlacedWord | None = None
        for base, stop, glued in _pieces(text, start, end):
            cells, origin, ready, forms = self._piece(source, base, stop, log)
            at = done = 0
            for word in cells.split(BLANK):
                if word:
                    here, done = _said(ready.text, origin, at, at + len(word), done)
                    first = base + (here if ready.origins is None else ready.origins[here])
                    if held is not None:
                        # The name of one character may be several words, which all show it.
                        shown = max(first, held.source(max(len(held.text) - 1, 0)) + 1)
                        yield held._replace(end=_end(text, held.start, shown))
                    said = ready.text[here : max(done, here + 1)].rstrip()
                    joined = glued and at == 0 and held is not None
                    emphasis = _emphasis_of(forms, here, max(done, here + 1)) if forms else 0
                    held = PlacedWord(word, said, first, first, ready.origins, here, base, joined, emphasis=emphasis)
                at += len(word) + 1
        if held is not None:
            yield held._replace(end=_end(text, held.start, end))

    def kept_line(self, source: TextSource, start: int, end: int, log: ReportLog) -> Iterator[PlacedWord]:
        """A line of Braille with the blank cells in it, as one word; none without a dot."""
        cells = self._piece(source, start, end, log).cells.strip(BLANK)
        if cells:
            yield PlacedWord(cells, source.text[start:end], start, end, None, 0, start, False)

    def _piece(self, source: TextSource, start: int, stop: int, log: ReportLog) -> _Piece:
        chunk = source.text[start:stop]
        forms: list[int] | None = None
        if source.kind is SourceKind.BRAILLE:
            ready = Writable(chunk, None)
            cells, origin = _SPACE.sub(BLANK, chunk), list(range(len(chunk)))
        else:
            ready = writable(chunk, start, alphabet(self.tables), self.undefined, log)
            forms = _forms(source.emphases, start, stop, ready.origins)
            cells, origin = self._written(ready.text, forms)
        if self.dots == 6 and max(cells, default="") > HIGHEST_6_DOT:
            for at, cell in enumerate(cells):
                if cell > HIGHEST_6_DOT:
                    place = origin[at] if ready.origins is None else ready.origins[origin[at]]
                    log.undefined(chunk[place], "six dots", _six_dots(cell), start + place)
            origin = [
                position for position, cell in zip(origin, cells, strict=True) if cell == BLANK or _six_dots(cell)
            ]
            cells = _six_dots(cells)
        return _Piece(cells, origin, ready, forms)

    def _written(self, text: str, forms: list[int] | None) -> tuple[str, list[int]]:
        cells, origin = "", list[int]()
        for start, stop in [(0, len(text))] if self.passages else _apart(self.tables, text, forms):
            some, back, _ = translated(self.tables, text[start:stop], forms and forms[start:stop])
            cells += some
            origin += [start + position for position in back] if start else back
        return cells, origin

    def number(self, words: str) -> str:
        """Cells of digits and what stands between them."""
        cells = translated(self.tables, words)[0].strip(BLANK)
        return _six_dots(cells) if self.dots == 6 else cells

    def hyphen(self) -> str:
        """The table's hyphen, empty when there is no hyphenation dictionary for its language."""
        if not hyphenation_tables(self.tables) or not alphabet(self.tables).writes("-"):
            return ""
        return louis_binding.translate_string(self.tables, "-", undefined=True).translate(LOWER_SIX)

    def continuation(self) -> str:
        """The sign the code has for words that go on and are not of letters, empty when it has none."""
        return continuation_sign(self.tables)

    def cut(self, word: PlacedWord, room: int, hyphen: str, continuation: str) -> Cut:
        """Where a word of text is cut that has more cells than `room`; see `encoders.braille.cuts`."""
        if not word.text:
            return cut_anywhere(word, room)
        return _cutter(self.tables, self.dots, hyphen, continuation, word.emphasis).cut(
            word.text, word.cells, room, word.kept, word.lettered
        )


def _six_dots(cells: str) -> str:
    """Cells without dots 7 and 8; one that had no other dots is left out, as a blank there would end the word."""
    if max(cells, default="") <= HIGHEST_6_DOT:
        return cells
    return cells.translate(_ONLY_LOWER).translate(LOWER_SIX)


_ONLY_LOWER = dict.fromkeys((0x2840, 0x2880, 0x28C0))


@lru_cache(maxsize=16)
def _cutter(tables: tuple[str, ...], dots: int, hyphen: str, continuation: str, emphasis: int) -> Cutter:
    together = hyphenation_tables(tables) if hyphen else ()

    @lru_cache(maxsize=1 << 14)
    def write(text: str) -> str:
        cells, _, _ = translated(tables, text, [emphasis] * len(text) if emphasis else None)
        cells = cells.strip(BLANK)
        return _six_dots(cells) if dots == 6 else cells

    @lru_cache(maxsize=1 << 12)
    def read(cells: str) -> str:
        try:
            return louis_binding.back_translate(tables, cells)
        except RuntimeError:
            return "\0"  # two parts then never read as the whole

    return Cutter(write, read, lambda word: _points(together, word) if together else [], hyphen, continuation)


@lru_cache(maxsize=4096)
def _points(tables: tuple[str, ...], word: str) -> list[int]:
    return louis_binding.hyphenate(tables, word)


def _said(text: str, origin: list[int], at: int, stop: int, done: int) -> tuple[int, int]:
    """(start, end) in `text` of the word whose cells are ``at:stop``, after one that ended at `done`."""
    # The first cell of a letter with its accent may come from the second of its characters; a blank need not come
    # from a space.
    after_space = done and text[done : done + 1].isspace()
    start = origin[at] - len(text[done : origin[at]].lstrip()) if after_space or not done else origin[at]
    if stop < len(origin) and not text[origin[stop]].isspace():
        stop += 1
    return start, origin[stop] if stop < len(origin) else len(text)


def _apart(tables: tuple[str, ...], text: str, forms: Sequence[int] | None) -> Iterator[tuple[int, int]]:
    """(start, end) of parts, so that no two words that one indicator would stand for are in one."""
    start, before = 0, frozenset[str | int]()
    kinds = _passages(tables)
    if forms or any(_MARKED[kind](text) for kind in kinds):
        for match in _WORD.finditer(text):
            marked: frozenset[str | int] = frozenset(kind for kind in kinds if _MARKED[kind](match[0]))
            marked |= frozenset(form for form in forms[slice(*match.span())] if form) if forms else frozenset()
            if marked & before:
                yield start, match.start()
                start = match.start()
            # A word without letters, such as a number, does not end a passage.
            before = marked | before if not any(char.isalpha() for char in match[0]) else marked
    yield start, len(text)


_MARKED: dict[str, Callable[[str], object]] = {
    "AB": lambda text: not text.islower() and any(word.isupper() for word in text.split()),
    "ab": re.compile("[A-Za-z]").search,
}
"""For each sort of words an example, and what tells that there are such in a text."""


@cache
def _passages(tables: tuple[str, ...]) -> tuple[str, ...]:
    """Sorts of words that the tables mark once where several of them follow."""

    def written(text: str) -> str:
        return translated(tables, text)[0]

    return tuple(kind for kind in _MARKED if written(" ".join([kind] * 4)) != BLANK.join([written(kind)] * 4))


def _end(text: str, start: int, following: int) -> int:
    while following > start + 1 and (text[following - 1].isspace() or text[following - 1] == BLANK):
        following -= 1
    return max(following, start + 1)


def _pieces(text: str, start: int, end: int) -> Iterator[tuple[int, int, bool]]:
    """(start, end, whether it continues a word) of pieces of at most `PIECE` characters.

    They are cut after a sentence, else at white space, else anywhere but inside a letter with its marks.
    """
    glued = False
    while end - start > PIECE:
        window = start + PIECE
        cut = (
            max(text.rfind(sign, start + PIECE // 2, window) for sign in (". ", ".\n", "! ", "? ", "\u3002", "\u0964"))
            + 1
        )
        if not cut:
            cut = max(text.rfind(" ", start + 1, window), text.rfind("\n", start + 1, window))
        if cut <= start:
            spaces = [match.start() for match in _SPACE.finditer(text, start + 1, window)]
            cut = spaces[-1] if spaces else _hard_cut(text, start, min(window, (start + end) // 2 + 1))
        yield start, cut, glued
        glued = cut < end and not (text[cut].isspace() or text[cut - 1].isspace())
        start = cut
    if start < end:
        yield start, end, glued


def _hard_cut(text: str, start: int, cut: int) -> int:
    """The last place at or before `cut` that is not inside a cluster."""
    back = cut
    while back > start + 1 and (extends(text[back]) or text[back - 1] == ZERO_WIDTH_JOINER):
        back -= 1
    flags = 0
    while back - flags > start and "\U0001f1e6" <= text[back - flags - 1] <= "\U0001f1ff":
        flags += 1
    back -= flags % 2
    back = back if back > start else cut
    while back < len(text) and text[back] == text[back - 1] and text[back] > _ARROWS and not text[back].isalnum():
        back += 1  # equal signs are counted together, see `undefined`
    return back


def refuse_unwritable(source: TextSource, transcriber: Transcriber) -> None:
    """Look at the characters once before the first frame, so that a text that cannot be shown fails at once.

    Raises
    ------
    EmptyText, UndefinedCharacter
        When the table can write none of them, or the policy is `error` and it cannot write one.
    """
    letters = alphabet(transcriber.tables)
    if source.kind is SourceKind.BRAILLE or not letters.lacks(source.text):
        return
    if transcriber.undefined is Undefined.ERROR:
        for start, end in paragraphs(source.text):
            for _ in transcriber.words(source, start, end, ReportLog()):
                pass
    different = "".join(sorted(set(source.text)))
    if not writable(different, 0, letters, transcriber.undefined, ReportLog()).text.strip():
        raise EmptyText(
            f"{source.name}: the table {','.join(transcriber.tables)} can write none of its characters; "
            "choose another table, or --undefined name"
        )
