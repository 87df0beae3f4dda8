"""Which characters a table can write, asked once for each character."""

from __future__ import annotations

import unicodedata
from collections import Counter
from functools import cache, cached_property
from pathlib import Path

from . import louis_binding
from .dots import BLANK, HIGHEST_6_DOT

__all__ = ["Alphabet", "alphabet", "own_letters_eight"]

_BRACKETS = (("(", ")"), ("[", "]"), ("{", "}"), ("<", ">"), ("\u201c", "\u201d"), ('"', '"'))


class Alphabet:
    """The characters one list of tables can write; grows as it is asked. Use `alphabet` to get one.

    A character is written when its cells have a dot, or when the table knows it and writes nothing for it
    (an Arabic tatweel). It is not when the library falls back to ``'\\x..'`` cells, or to a blank.
    """

    def __init__(self, tables: tuple[str, ...]) -> None:
        self.tables = tables
        self._written: dict[str, bool] = {}
        self._good = {" "}

    @cached_property
    def language(self) -> str:
        """The language the first table is for, as CLDR calls it: as it states, else as its file is named."""
        from .names import cldr_language

        stated = (louis_binding.table_info(name, "language") for name in self.tables)
        return cldr_language(next(filter(None, stated), Path(self.tables[0]).stem))

    def lacks(self, characters: str) -> bool:
        """Whether one of `characters` cannot be written."""
        return not self._good.issuperset(characters) and any(not self.writes(char) for char in set(characters))

    def writes(self, char: str) -> bool:
        """Whether this one character can be written."""
        known = self._written.get(char)
        if known is None:
            known = self._written[char] = self._ask(char)
            if known:
                self._good.add(char)
        return known

    def _ask(self, char: str) -> bool:
        if char.isspace() or "\u2800" <= char <= "\u28ff":
            return True
        sure = louis_binding.translate_string(self.tables, char, undefined=False)
        if sure.strip(BLANK):
            return True
        return not sure and not louis_binding.translate_string(self.tables, char, undefined=True)

    def spells(self, cluster: str) -> bool:
        """Whether these characters together can be written, though one of them alone cannot: a letter and its mark."""
        known = self._written.get(cluster)
        if known is None:
            sure = louis_binding.translate_string(self.tables, cluster, undefined=False)
            written = louis_binding.translate_string(self.tables, cluster, undefined=True)
            known = self._written[cluster] = bool(sure.strip(BLANK)) and sure == written
        return known

    def dots(self, char: str) -> int:
        """8 when the sign of this character uses dot 7 or 8, else 6."""
        cells = louis_binding.translate_string(self.tables, char, undefined=False)
        return 8 if max(cells, default="") > HIGHEST_6_DOT else 6

    def brackets(self) -> tuple[str, str]:
        """A pair of signs to put around a name, the first the table can write in six dots; else blanks."""
        for opening, closing in _BRACKETS:
            if not self.lacks(opening + closing) and self.dots(opening) == self.dots(closing) == 6:
                return opening, closing
        return " ", " "


@cache
def alphabet(tables: tuple[str, ...]) -> Alphabet:
    """The alphabet of `tables`, one for the whole process."""
    return Alphabet(tables)


def own_letters_eight(text: str, tables: tuple[str, ...]) -> bool:
    """Whether letters of the text's own script have 8-dot signs; words of another are written with six."""
    letters = Counter({char: count for char, count in Counter(text).items() if char.isalnum()})
    scripts = Counter[str]()
    for char, count in letters.items():
        scripts[_script(char)] += count
    own = max(scripts, key=scripts.__getitem__, default="")
    return any(alphabet(tables).dots(char) == 8 for char in sorted(letters) if _script(char) == own)


def _script(char: str) -> str:
    return unicodedata.name(char, "").partition(" ")[0]
