"""Text a table can write, with the source position of every character: nothing is lost in silence.

Characters are taken cluster by cluster (a letter with its marks, an emoji with its modifiers): brought to
the composed form (NFC), else to a compatible form the table can write, else treated as the policy says.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache

from ..errors import UndefinedCharacter
from .alphabet import Alphabet
from .choices import Undefined
from .report import ReportLog

__all__ = ["Writable", "extends", "name_of", "writable"]


@dataclass(frozen=True)
class Writable:
    """Text for the table.

    Attributes
    ----------
    text : what the table gets.
    origins : position in the source chunk of each character; None when they are the same.
    """

    text: str
    origins: list[int] | None


_SPACES = {code: " " for code in range(0x3001) if chr(code).isspace()}
# Characters that steer display and have no sign in Braille: ZWSP, soft hyphen, direction marks, variation
# selectors, tags, byte order mark. A joiner (U+200C, U+200D) is one only where the table does not write it.
_INVISIBLE = re.compile("[\u00ad\u200b\u200e\u200f\u202a-\u202e\u2060-\u2069\ufe00-\ufe0f\ufeff\U000e0000-\U000e01ef]")
ZERO_WIDTH_JOINER = "\u200d"
_JOINERS = "\u200c\u200d"
_TONE_NAMES = dict(
    zip(
        "\U0001f3fb\U0001f3fc\U0001f3fd\U0001f3fe\U0001f3ff",
        ("light", "medium-light", "medium", "medium-dark", "dark"),
        strict=True,
    )
)


def writable(chunk: str, base: int, alphabet: Alphabet, policy: Undefined, log: ReportLog) -> Writable:
    """`chunk` as the table can write it.

    Parameters
    ----------
    chunk : source characters.
    base : position of the first in the source, for messages and the log.

    Raises
    ------
    UndefinedCharacter
        When the policy is `error` and a character cannot be written.
    """
    text = chunk.translate(_SPACES)
    if not alphabet.lacks(text) and not _INVISIBLE.search(text) and unicodedata.is_normalized("NFC", text):
        return Writable(text, None)
    parts: list[str] = []
    origins: list[int] = []
    for start, end in _clusters(text):
        written = _cluster(text[start:end], base + start, alphabet, policy, log)
        parts.append(written)
        origins.extend([start] * len(written))
    return Writable("".join(parts), origins)


def _clusters(text: str) -> Iterator[tuple[int, int]]:
    """(start, end) of each letter with its marks, each emoji sequence, each flag."""
    start = 0
    while start < len(text):
        end = start + 1
        if _is_flag(text[start : start + 2]):
            end += 1
        while end < len(text) and (extends(text[end]) or text[end - 1] == ZERO_WIDTH_JOINER):
            end += 1
        yield start, end
        start = end


def extends(char: str) -> bool:
    """Whether `char` belongs to the character before it: marks, Hangul vowels, tones, tags, joiners."""
    return (
        (char > "\u02ff" and unicodedata.category(char)[0] == "M")
        or "\u1160" <= char <= "\u11ff"
        or char in _TONE_NAMES
        or "\U000e0020" <= char <= "\U000e007f"
        or char in _JOINERS
    )


def _is_flag(pair: str) -> bool:
    return len(pair) == 2 and all("\U0001f1e6" <= char <= "\U0001f1ff" for char in pair)


def _cluster(cluster: str, position: int, alphabet: Alphabet, policy: Undefined, log: ReportLog) -> str:
    visible = _INVISIBLE.sub("", cluster)
    for joiner in _JOINERS:
        if joiner in visible and not alphabet.writes(joiner):
            visible = visible.replace(joiner, "")
    if not visible:
        log.invisible += 1
        return ""
    composed = unicodedata.normalize("NFC", visible)
    for same in (composed, unicodedata.normalize("NFD", visible), _with_presentation_forms(composed)):
        if not alphabet.lacks(same):
            return same
    for compatible in (unicodedata.normalize("NFKC", visible), unicodedata.normalize("NFKD", visible)):
        if compatible.strip() and not alphabet.lacks(compatible):
            log.undefined(cluster, "respelled", compatible, position)
            return compatible
    if alphabet.writes(composed[0]) and len(composed) > 1:
        # The base can be written, a mark on it cannot: only the mark is undefined.
        return composed[0] + "".join(
            char if alphabet.writes(char) else _replaced(char, char, position, alphabet, policy, log)
            for char in composed[1:]
        )
    return _replaced(composed, cluster, position, alphabet, policy, log)


def _with_presentation_forms(composed: str) -> str:
    """`composed` with base and mark as one character also where NFC parts them: tables know the Hebrew shin
    with its dot by that character alone."""
    base, marks = composed[:1], []
    for mark in composed[1:]:
        joined = _excluded_compositions().get(base + mark)
        if joined is None:
            marks.append(mark)
        else:
            base = joined
    return base + "".join(marks)


@cache
def _excluded_compositions() -> dict[str, str]:
    chars = (chr(code) for code in (*range(0x0958, 0x0E00), *range(0xFB1D, 0xFB50)))
    pairs = ((unicodedata.normalize("NFD", char), char) for char in chars)
    return {pair: char for pair, char in pairs if len(pair) == 2 and unicodedata.normalize("NFC", pair) != char}


def _replaced(visible: str, source: str, position: int, alphabet: Alphabet, policy: Undefined, log: ReportLog) -> str:
    if policy is Undefined.ERROR:
        raise UndefinedCharacter(
            f"character {position}: the table {','.join(alphabet.tables)} cannot write {name_of(visible)} "
            f"({_codes(visible)}); choose another table, or --undefined name or drop"
        )
    name = _writable_name(visible, alphabet) if policy is Undefined.NAME else ""
    if not name:
        log.undefined(source, "dropped", "", position)
        return ""
    opening, closing = alphabet.brackets()
    written = f"{opening}{name}{closing}"
    log.undefined(source, "named", written, position)
    return written


def _writable_name(visible: str, alphabet: Alphabet) -> str:
    """The first that the table can write: the name, the code points, their digits."""
    codes = _codes(visible).lower()
    numbers = " ".join(str(ord(char)) for char in visible)
    return next((name for name in (name_of(visible), codes, numbers) if not alphabet.lacks(name)), "")


def _codes(characters: str) -> str:
    return " ".join(f"U+{ord(char):04X}" for char in characters)


def name_of(characters: str) -> str:
    """Unicode names in lower case, joined by commas: ``woman, medium skin tone, personal computer``."""
    if _is_flag(characters):
        return "flag " + "".join(chr(ord(char) - 0x1F1E6 + ord("a")) for char in characters)
    names = []
    for char in characters:
        if char in _TONE_NAMES:
            names.append(f"{_TONE_NAMES[char]} skin tone")
        elif char not in _JOINERS:
            names.append(unicodedata.name(char, "").lower() or f"u+{ord(char):04x}")
    return ", ".join(names)
