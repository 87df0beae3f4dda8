"""Where a word that has more cells than a run is cut, so that each part read alone says what it says in the word.

Places are looked for in the text of the word: after its own separators, then (in words of letters) at the syllables
of the dictionary, then between other letters; inside capitals and digits only where nothing else fits. Whether a
place is sound is asked of the table, not known of the code: the rest of the word is written alone. What it has in
front of the cells it has in the word are the indicators, which are restated; when the first part written alone has
the cells it has in the word (or, where contractions depend on the whole word, both parts read as the word), the cut
is sound. So no contraction is cut, and no indicator parted from what it governs, in any table.

What ends the first part:

- nothing after a hyphen of the word's own;
- in a word of letters the table's hyphen: UEB 10.13.1 divides words by it and keeps the line continuation indicator
  for other matter (so also NBA's answer at nationalbraille.org/forums/reply/38183), as does the German code (2.5.1.1,
  rw-blindenschrift.de);
- in any other word, where a hyphen would be taken for the word's own, the code's sign of continuation: dot 5 in UEB
  (its line continuation indicator), dot 4 in German (braille.ch/urls-usw.htm). For other codes no rule was found:
  there nothing is added, and the indicators alone are restated.

UEB and the Marburg mathematics do not restate the number sign after these signs; here it is, since a page may be read
alone (German: after a division the number sign is written again, fakoo.de/braille-zahlen.html).
"""

from __future__ import annotations

import os
from bisect import bisect_right
from collections.abc import Callable, Iterator, Sequence
from functools import lru_cache
from typing import NamedTuple

from . import louis_binding
from .layout import Cut
from .undefined import ZERO_WIDTH_JOINER, extends

__all__ = ["Cutter", "continuation_sign"]

WINDOW = 64
"""Characters of a word looked at together; of a longer one the next part is found in its first ones."""
MARGIN = 12
"""Cells at the end of a window that the characters after it may change."""
SHORTEST_PIECE = 2
"""Letters that stand alone before or after a hyphen, at least."""
MOST_RESTATED = 4
REMEMBERED = 1 << 14

_HYPHENS = "-\u2010\u2011"
_SEPARATORS = _HYPHENS + "/\\.,:;@_+=&#~|?!%)]}\u2012\u2013\u2014\u2026\u00b7\u3001\u3002\uff0c\uff1a\uff1b\uff01\uff1f"
_IN_WORDS = _HYPHENS + "'\u2019\u02bc\u00b7\u0640\u200c\u200d"


def continuation_sign(tables: tuple[str, ...]) -> str:
    """The sign the code has for words that go on in the next line and are not of letters; empty when it has none."""
    for name in tables:
        if louis_binding.table_info(name, "system") == "ueb":
            return "\u2810"
        if louis_binding.table_info(name, "language").split("-")[0] == "de" or os.path.basename(name).startswith("de-"):
            return "\u2808"
    return ""


class _Place(NamedTuple):
    """A sound place: the cells before it, and what is restated after it."""

    cells: int
    restated: str


class Cutter:
    """Cuts words of one table; remembers the last few thousand.

    Parameters
    ----------
    write : text to cells, a word alone. read : cells to text. points : where a word has syllables.
    hyphen, continuation : cells, see `Layout`.
    """

    def __init__(
        self,
        write: Callable[[str], str],
        read: Callable[[str], str],
        points: Callable[[str], Sequence[int]],
        hyphen: str,
        continuation: str,
    ) -> None:
        self.write, self.read, self.points = write, read, points
        self.hyphen, self.continuation = hyphen, continuation
        self._sound = lru_cache(maxsize=REMEMBERED)(self._asked)

    def cut(self, text: str, cells: str, room: int, lettered: bool | None) -> Cut:
        """Where to cut a word of `cells`, of which `room` fit."""
        lettered = _lettered(text[:WINDOW]) if lettered is None else lettered
        if len(text) <= 2 * WINDOW:
            return self._sound(text, cells, room, lettered) or self._anywhere(text, cells, room, lettered)
        head = text[: _cluster_start(text, WINDOW)]
        start = self.write(head)
        if cells.startswith(start[: room + MARGIN]) and len(start) > room + MARGIN:
            found = self._sound(head, start, room, lettered)
            if found is not None:
                return found
        return self._anywhere(head, cells, room, lettered)

    def _asked(self, text: str, cells: str, room: int, lettered: bool) -> Cut | None:
        places: dict[int, _Place | None] = {}
        for options, at_syllable in self._options(text, lettered):
            # How many cells stand before a place only grows with it: begin with the last that can fit.
            last = bisect_right(options, room, key=lambda at: self._cells_before(text, cells, at))
            for at in reversed(options[:last]):
                if at not in places:
                    places[at] = self._place(text, cells, at)
                place = places[at]
                if place is None:
                    continue
                mark = self._mark(text, at, cells[: place.cells], lettered)
                if 0 < place.cells <= room - len(mark):
                    return Cut(at, place.cells, mark, place.restated, at_syllable, lettered)
        return None

    def _options(self, text: str, lettered: bool) -> Iterator[tuple[list[int], bool]]:
        """Places in the text, the best kind first; whether they are syllables."""
        yield [at for at in range(1, len(text)) if _separated(text, at)], False
        inner = [at for at in range(1, len(text)) if _cluster_start(text, at) == at]
        inner = [at for at in inner if _letters(text[:at]) and _letters(text[at:])]
        if lettered:
            # A piece of one letter would be read as a word of its own.
            fair = [at for at in inner if _letters(text[:at]) >= SHORTEST_PIECE <= _letters(text[at:])]
            yield [at for at in self.points(text) if at in fair], True
            yield fair, False
        else:
            yield [at for at in inner if _changes(text[at - 1], text[at])], False
            yield [at for at in inner if _small(text[at - 1]) and _small(text[at])], False
        yield inner, False

    def _cells_before(self, text: str, cells: str, at: int) -> int:
        return len(cells) - _common_end(self.write(text[at:]), cells)

    def _place(self, text: str, cells: str, at: int) -> _Place | None:
        """What a cut before character `at` makes of the cells, None when it is not sound."""
        rest = self.write(text[at:])
        common = _common_end(rest, cells)
        before, restated = cells[: len(cells) - common], rest[: len(rest) - common]
        if not common or not before or len(restated) > MOST_RESTATED:
            return None
        sound = self._sound_start(text, at, before) or self._reads(text, at, before, rest, cells)
        return _Place(len(before), restated) if sound else None

    def _sound_start(self, text: str, at: int, before: str) -> bool:
        """Whether the first part is written so alone, a separator at its end apart: alone it may be a full stop."""
        if self.write(text[:at]) == before:
            return True
        written = self.write(text[: at - 1]) if _separated(text, at) else before
        return before.startswith(written) and 0 < len(before) - len(written) <= MOST_RESTATED

    def _reads(self, text: str, at: int, before: str, rest: str, cells: str) -> bool:
        """Whether both parts read as the word, and no indicator of the rest is left with the first."""
        if before.startswith(self.write(text[:at])):
            return False
        return self.read(before) + self.read(rest) == self.read(cells)

    def _mark(self, text: str, at: int, before: str, lettered: bool) -> str:
        if text[at - 1] in _HYPHENS and (not self.hyphen or before.endswith(self.hyphen)):
            return ""
        return self.hyphen if lettered else self.continuation

    def _anywhere(self, text: str, cells: str, room: int, lettered: bool) -> Cut:
        """No place is sound: one whose first part at least is written so alone, else the last cell."""
        mark = self.hyphen if lettered else self.continuation
        mark = mark if len(mark) < room else ""
        most = room - len(mark)
        for at in range(len(text) - 1, 0, -1):
            before = self.write(text[:at])
            if before and len(before) <= most and cells.startswith(before) and at == _cluster_start(text, at):
                return Cut(at, len(before), mark, "", False, lettered)
        at = max((at for at in range(len(text)) if len(self.write(text[:at])) <= most), default=0)
        return Cut(at, most, mark, "", False, lettered)


def _lettered(text: str) -> bool:
    """Whether a word has letters only, apart from signs around it."""
    first = next((at for at, char in enumerate(text) if char.isalnum()), 0)
    last = next((at for at in range(len(text) - 1, -1, -1) if text[at].isalnum() or extends(text[at])), -1)
    core = text[first : last + 1]
    return bool(core) and all(char.isalpha() or extends(char) or char in _IN_WORDS for char in core)


def _letters(text: str) -> int:
    return sum(char.isalnum() for char in text)


def _separated(text: str, at: int) -> bool:
    """Whether a separator of the word's own ends before `at`, with something to read on both sides."""
    before, after = text[at - 1], text[at]
    return (
        before in _SEPARATORS
        and (after.isalnum() or after in "([{\u00ab\u201c")
        and any(char.isalnum() for char in text[:at])
    )


def _changes(before: str, after: str) -> bool:
    return before.isalnum() and after.isalnum() and before.isdigit() != after.isdigit()


def _small(char: str) -> bool:
    return char.isalpha() and not char.isupper()


def _common_end(one: str, other: str) -> int:
    shorter = min(len(one), len(other))
    return next((at for at in range(shorter) if one[-1 - at] != other[-1 - at]), shorter)


def _cluster_start(text: str, at: int) -> int:
    """The last place at or before `at` that is not inside a letter with its marks."""
    while 0 < at < len(text) and (extends(text[at]) or text[at - 1] == ZERO_WIDTH_JOINER):
        at -= 1
    return at
