"""Text a table can write, with the source position of every character: nothing is lost in silence.

Characters are taken cluster by cluster (a letter with its marks, an emoji with its modifiers). A table knows the order
in which people type, so a cluster is asked for as it is typed; but with what doubles a consonant or tells two letters
apart (shadda, dagesh, shin dot) before the vowels, since normalised text has it behind them, and with a letter and
its accent as one character where the table has that. Then come the composed, the decomposed and a compatible form;
what the table cannot write in any of them is treated as the policy says.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from itertools import groupby

from ..choices import Undefined
from ..errors import UndefinedCharacter
from .alphabet import Alphabet
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
# Colours and the like for a terminal (ECMA-48: control sequences, operating system commands, single escapes).
_TERMINAL = re.compile("\x1b(?:\\[[0-?]*[ -/]*[@-~]|\\][^\x07\x1b]*(?:\x07|\x1b\\\\)|[@-Z\\\\-_])")
# Vowel signs of Arabic and Hebrew, and what is typed before them.
_VOWELS, _BEFORE_VOWELS = "\u064b-\u0650\u0652\u0670\u05b0-\u05bb\u05c7", "\u0651\u05bc\u05bf\u05c1\u05c2"
_TURNED = re.compile(f"[{_VOWELS}][{_BEFORE_VOWELS}]")
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
    plain = not any(special.search(text) for special in (_INVISIBLE, _TURNED, _TERMINAL)) and unicodedata.is_normalized(
        "NFC", text
    )
    if plain and not alphabet.lacks(text):
        return Writable(text, None)
    parts: list[str] = []
    origins: list[int] = []
    for start, cluster, times in _repeated(text):
        for at in range(start, start + times * len(cluster), len(cluster)):
            form = _form(cluster, base + at, alphabet, log)
            if form is None:
                form = _unwritable(cluster, times, base + start, alphabet, policy, log)
                parts.append(form)
                origins.extend([start] * len(form))
                break
            parts.append(form)
            origins.extend([at] * len(form))
    return Writable("".join(parts), origins)


def _repeated(text: str) -> Iterator[tuple[int, str, int]]:
    """(start, cluster, how often it stands there) for each row of equal clusters."""
    for cluster, group in groupby(_clusters(text), key=lambda span: text[slice(*span)]):
        first, *more = group
        yield first[0], cluster, 1 + len(more)


def _clusters(text: str) -> Iterator[tuple[int, int]]:
    """(start, end) of each letter with its marks, each emoji sequence, each flag, each sequence for a terminal."""
    start = 0
    while start < len(text):
        steering = _TERMINAL.match(text, start)
        end = steering.end() if steering else start + 1
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


def _form(cluster: str, position: int, alphabet: Alphabet, log: ReportLog) -> str | None:
    """The cluster as the table can write it, empty for what has no sign in Braille, None when it cannot."""
    visible = "" if _TERMINAL.match(cluster) else _INVISIBLE.sub("", cluster)
    for joiner in _JOINERS:
        if joiner in visible and not alphabet.writes(joiner):
            visible = visible.replace(joiner, "")
    if not visible:
        log.invisible += 1
        return ""
    for same in _same(visible, alphabet):
        if not alphabet.lacks(same) or (len(same) > 1 and alphabet.spells(same)):
            return same
    # Every dash is at least a hyphen, such as the Hebrew maqaf.
    hyphen = "-" if unicodedata.category(visible[0]) == "Pd" and len(visible) == 1 else ""
    for compatible in (unicodedata.normalize("NFKC", visible), unicodedata.normalize("NFKD", visible), hyphen):
        if compatible.strip() and not alphabet.lacks(compatible):
            log.undefined(cluster, "respelled", compatible, position)
            return compatible
    return None


def _unwritable(cluster: str, times: int, position: int, alphabet: Alphabet, policy: Undefined, log: ReportLog) -> str:
    composed = unicodedata.normalize("NFC", _INVISIBLE.sub("", cluster))
    if not alphabet.writes(composed[0]) or len(composed) == 1:
        return _replaced(composed, cluster, times, position, alphabet, policy, log)
    # The base can be written, a mark on it cannot: only the mark is undefined.
    once = composed[0] + "".join(
        char if alphabet.writes(char) else _replaced(char, char, 1, position, alphabet, policy, log)
        for char in composed[1:]
    )
    return once * times


def _same(typed: str, alphabet: Alphabet) -> Iterator[str]:
    """What is canonically the same as the cluster `typed`, most likely as the table knows it first."""
    if len(typed) == 1:
        yield typed
    ordered = _vowels_last(typed)
    yield _joined(ordered, lambda char: char if len(char) == 1 and alphabet.writes(char) else None)
    yield ordered
    for form in ("NFC", "NFD"):
        yield _vowels_last(unicodedata.normalize(form, typed))
    yield _joined(unicodedata.normalize("NFC", ordered), _excluded)
    yield _joined(ordered, _excluded)
    yield "".join(_SINGLETONS.get(char, char) for char in unicodedata.normalize("NFC", typed))


def _vowels_last(cluster: str) -> str:
    if not _TURNED.search(cluster):
        return cluster
    return cluster[0] + "".join(sorted(cluster[1:], key=lambda mark: mark not in _BEFORE_VOWELS))


def _joined(cluster: str, one: Callable[[str], str | None]) -> str:
    """The cluster with its base and the marks next to it as one character, as far as there is `one`."""
    base, marks = cluster[:1], list(cluster[1:])
    while marks:
        joined = one(unicodedata.normalize("NFC", base + marks[0]))
        if joined is None:
            break
        base, marks = joined, marks[1:]
    return base + "".join(marks)


def _excluded(parts: str) -> str | None:
    """The character for a base and a mark that NFC parts: some tables know the Hebrew shin with its dot by it alone."""
    return _excluded_compositions().get(unicodedata.normalize("NFC", parts))


@cache
def _excluded_compositions() -> dict[str, str]:
    chars = (chr(code) for code in (*range(0x0958, 0x0E00), *range(0xFB1D, 0xFB50)))
    forms = ((unicodedata.normalize("NFC", char), char) for char in chars if unicodedata.decomposition(char))
    return {form: char for form, char in forms if len(form) > 1 and "<" not in unicodedata.decomposition(char)}


# Where one character is canonically another, and a table knows the other: Greek question mark and raised dot.
_SINGLETONS = {";": "\u037e", "\u00b7": "\u0387", "\u3008": "\u2329", "\u3009": "\u232a"}


def _replaced(
    visible: str, source: str, times: int, position: int, alphabet: Alphabet, policy: Undefined, log: ReportLog
) -> str:
    if policy is Undefined.ERROR:
        raise UndefinedCharacter(
            f"character {position}: the table {','.join(alphabet.tables)} cannot write {name_of(visible)} "
            f"({_codes(visible)}); choose another table, or --undefined name or drop"
        )
    name = _writable_name(visible, times, alphabet) if policy is Undefined.NAME else ""
    if not name:
        log.undefined(source, "dropped", "", position, times)
        return ""
    opening, closing = alphabet.brackets()
    written = f"{opening}{name}{closing}"
    log.undefined(source, "named", written, position, times)
    return written


def _writable_name(visible: str, times: int, alphabet: Alphabet) -> str:
    """The first that the table can write: the name in its language, in English, the code points, their digits."""
    from .names import local_name

    local = [local_name(char, alphabet.language) for char in visible if char not in _JOINERS]
    names = [", ".join(local)] if all(local) else []
    names += [name_of(visible), _codes(visible).lower(), " ".join(str(ord(char)) for char in visible)]
    if times > 1:
        words = ", {} times" if alphabet.language == "en" else " × {}"
        names = [name + count.format(times) for name in names for count in (words, " {}")]
    return next(filter(None, (_spelled(name, alphabet) for name in names)), "")


def _spelled(name: str, alphabet: Alphabet) -> str:
    """A name as the table can write it, empty when it cannot."""
    log = ReportLog()
    forms = [_form(name[start:end], 0, alphabet, log) for start, end in _clusters(name)]
    return "" if None in forms else "".join(form for form in forms if form)


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
