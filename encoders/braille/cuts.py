"""Where a word that has more cells than a run is cut, so that each part read alone says what it says in the word.

Places are looked for in the text of the word: after its own separators, then (in words of letters) at the syllables
of the dictionary, then between other letters; inside capitals and digits only where nothing else fits. Both parts are
written by the table as if each stood alone: so the second has its own indicators (a number sign, a sign of capitals),
the first keeps none that governs the second, and no contraction is cut, in any table, without a rule of any code
here. Of the places of one kind those come first where nothing but indicators changes; then those where a contraction
over the place is dissolved, as UEB 10.13 and the German code (2.5.1.1) ask at the end of a line.

What ends the first part:

- nothing after a hyphen of the word's own;
- in a word of letters the table's hyphen: UEB 10.13 (uebot.niu.edu has the rules) divides words by it and keeps the
  line continuation indicator for other matter (so also NBA's answer at nationalbraille.org/forums/reply/38183), as does
  the German code (2.5.1.1, rw-blindenschrift.de/124/menu-rw-kap-2/menu-rw-kap-2-5.html);
- in any other word, where a hyphen would be taken for the word's own, the code's sign of continuation: dot 5 in UEB
  (its line continuation indicator), dot 4 in German (braille.ch/urls-usw.htm). For other codes no rule was found:
  there nothing is added, and the indicators alone are restated.

The number sign is restated in every code, since a page may be read alone (German asks for it after a division anyway:
fakoo.de/braille-zahlen.html).
"""

from __future__ import annotations

import os
import re
from bisect import bisect_right
from collections.abc import Callable, Iterator, Sequence
from functools import lru_cache
from itertools import accumulate, islice

from . import louis_binding
from .dots import BLANK
from .layout import Cut
from .undefined import ZERO_WIDTH_JOINER, extends

__all__ = ["Cutter", "continuation_sign"]

LONGEST = 120
"""Characters of a word looked at together, at most (or four times those of a run)."""
MARGIN = 4
"""Cells after a room that tell that a window of a long word is written as in the word."""
SHORTEST_PIECE = 2
"""Letters that stand alone before or after a hyphen, at least."""
MOST_CHANGED = 4
"""Cells that a cut changes on each of its sides, at most; where more would change, the word is read as a whole."""
MOST_TRIED = 8
REMEMBERED = 1 << 14

_HYPHENS = "-\u2010\u2011"
_SEPARATORS = _HYPHENS + "/\\.,:;@_+=&#~|?!%)]}\u2012\u2013\u2014\u2026\u00b7\u3001\u3002\uff0c\uff1a\uff1b\uff01\uff1f"
_SEPARATOR = re.compile(rf"[{re.escape(_SEPARATORS)}\s]")
_IN_WORDS = _HYPHENS + "'\u2019\u02bc\u00b7\u0640\u200c\u200d"


def continuation_sign(tables: tuple[str, ...]) -> str:
    """The sign the code has for words that go on in the next line and are not of letters; empty when it has none."""
    for name in tables:
        if louis_binding.table_info(name, "system") == "ueb":
            return "\u2810"
        if louis_binding.table_info(name, "language").split("-")[0] == "de" or os.path.basename(name).startswith("de-"):
            return "\u2808"
    return ""


class Cutter:
    """Cuts words of one table; remembers the last few thousand.

    Parameters
    ----------
    write : text to cells, a word alone.
    read : cells to text.
    points : where a word has syllables.
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

    def cut(self, text: str, cells: str, room: int, kept: int, lettered: bool | None) -> Cut:
        """Where to cut a word of `cells`, of which `room` fit; the first `kept` of them stay as they are."""
        lettered = _lettered(text[:LONGEST]) if lettered is None else lettered
        # An address is written as one by its first and last characters.
        window = 4 * room + 12 if lettered else max(4 * room, LONGEST)
        if len(text) <= window:
            return self._sound(text, cells, room, kept, lettered) or self._anywhere(text, cells, room, lettered)
        # Of a long word the next part is found in its first characters.
        head = text[: _cluster_start(text, window)]
        start = self.write(head)
        seen = start[: room + MARGIN]
        alike = len(start) > len(seen) and cells.startswith(seen)
        found = self._sound(head, start, room, kept, lettered) if alike else None
        return found or self._anywhere(head, cells, room, lettered)

    def _asked(self, text: str, cells: str, room: int, kept: int, lettered: bool) -> Cut | None:
        for cut_at in (self._apart, self._read_alike, self._in_context):
            for options, at_syllable in self._options(text, lettered):
                last = self._fitting(text, options, room)
                tried = (cut_at(text, cells, at, kept) for at in islice(reversed(options[:last]), MOST_TRIED))
                signed = (self._signed(cut, text, at_syllable, lettered) for cut in tried if cut is not None)
                best: Cut | None = None
                for cut in (cut for cut in signed if len(cut.first) <= room):
                    if not cut.left_out:
                        return cut
                    best = best or cut
                if best is not None:
                    return best
        return None

    def _fitting(self, text: str, options: Sequence[int], room: int) -> int:
        """How many of the options leave a first part that can fit: it only grows with the place."""
        near = bisect_right(options, 2 * room)
        last = bisect_right(options, room, 0, near, key=lambda at: len(self.write(text[:at])))
        if last < near:
            return last
        return bisect_right(options, room, near, key=lambda at: len(self.write(text[:at])))

    def _apart(self, text: str, cells: str, at: int, kept: int) -> Cut | None:
        """Both parts written alone; None where that changes too much."""
        first, rest = self.write(text[:at]), self.write(text[at:])
        end = _common_end(rest, cells)
        start = min(_common_start(first, cells), len(cells) - end)
        added, restated, left_out = first[start:], rest[: len(rest) - end], cells[start : len(cells) - end]
        if (
            not rest
            or BLANK in first
            or start < max(kept, 1)
            or max(len(added), len(restated), len(left_out)) > MOST_CHANGED
        ):
            return None
        return Cut(at, len(cells) - end, first, "", restated, added, left_out)

    def _read_alike(self, text: str, cells: str, at: int, kept: int) -> Cut | None:
        """As `_in_context`, where both parts read as the word."""
        cut = self._in_context(text, cells, at, kept)
        alike = cut and self.read(cut.first) + self.read(self.write(text[at:])) == self.read(cells)
        return cut if alike else None

    def _in_context(self, text: str, cells: str, at: int, kept: int) -> Cut | None:
        """The first part with the cells it has in the word, as an address is written as one; the rest written alone."""
        rest = self.write(text[at:])
        end = _common_end(rest, cells)
        first, restated = cells[: len(cells) - end], rest[: len(rest) - end]
        if not end or len(first) <= kept or len(restated) > MOST_CHANGED or (restated and first[-1] in restated):
            return None
        return Cut(at, len(first), first, "", restated)

    def _signed(self, cut: Cut, text: str, at_syllable: bool, lettered: bool) -> Cut:
        sign = self.hyphen if lettered else self.continuation
        if text[cut.text - 1] in _HYPHENS and (not self.hyphen or cut.first.endswith(self.hyphen)):
            sign = ""
        return Cut(
            cut.text, cut.cells, cut.first + sign, sign, cut.restated, cut.ending, cut.left_out, at_syllable, lettered
        )

    def _options(self, text: str, lettered: bool) -> Iterator[tuple[list[int], bool]]:
        """Places in the text, the best kind first; whether they are syllables."""
        yield _separated(text), False
        starts = [at for at in range(1, len(text)) if text.isascii() or _cluster_start(text, at) == at]
        before = list(accumulate(map(str.isalnum, text), initial=0))

        def fair(least: int) -> list[int]:
            return [at for at in starts if before[at] >= least <= before[-1] - before[at]]

        if lettered:
            # A piece of one letter would be read as a word of its own.
            whole = fair(SHORTEST_PIECE)
            yield [at for at in self.points(text) if at in whole], True
            yield whole, False
        else:
            yield [at for at in fair(1) if _changes(text[at - 1], text[at])], False
            yield [at for at in fair(1) if _small(text[at - 1]) and _small(text[at])], False
        yield fair(1), False
        yield fair(0), False

    def _anywhere(self, text: str, cells: str, room: int, lettered: bool) -> Cut:
        """The last place whose first part at least is written so alone; else the last cell."""
        sign = self.hyphen if lettered else self.continuation
        sign = sign if len(sign) < room else ""
        most = room - len(sign)
        starts = [(at, self.write(text[:at])) for at in range(1, min(len(text), 4 * room))]
        starts = [(at, start) for at, start in starts if 0 < len(start) <= most]
        at, first = next((one for one in reversed(starts) if cells.startswith(one[1])), (0, ""))
        if not first:
            at, first = starts[-1][0] if starts else 0, cells[:most]
        return Cut(at, len(first), first + sign, sign, lettered=lettered)


def _lettered(text: str) -> bool:
    """Whether a word has letters only, apart from signs around it."""
    if text.isalpha():
        return True
    first = next((at for at, char in enumerate(text) if char.isalnum()), 0)
    last = next((at for at in range(len(text) - 1, -1, -1) if text[at].isalnum() or extends(text[at])), -1)
    core = text[first : last + 1]
    return bool(core) and all(char.isalpha() or extends(char) or char in _IN_WORDS for char in core)


def _separated(text: str) -> list[int]:
    """Where separators of the word's own end, with something to read on both sides."""
    ends = [match.end() for match in _SEPARATOR.finditer(text, 0, len(text) - 1)]
    first = next((at for at, char in enumerate(text) if char.isalnum()), len(text)) if ends else 0
    return [at for at in ends if first < at and (text[at].isalnum() or text[at] in "([{\u00ab\u201c")]


def _changes(before: str, after: str) -> bool:
    return before.isalnum() and after.isalnum() and before.isdigit() != after.isdigit()


def _small(char: str) -> bool:
    return char.isalpha() and not char.isupper()


def _common_end(one: str, other: str) -> int:
    return _common_start(one[::-1], other[::-1])


def _common_start(one: str, other: str) -> int:
    same = 0
    for a, b in zip(one, other, strict=False):
        if a != b:
            break
        same += 1
    return same


def _cluster_start(text: str, at: int) -> int:
    """The last place at or before `at` that is not inside a letter with its marks."""
    while 0 < at < len(text) and (extends(text[at]) or text[at - 1] == ZERO_WIDTH_JOINER):
        at -= 1
    return at
