"""Does the Braille that is felt say the text again? Back-translation, and what it can be held to.

Not every table can be undone: some are declared for one direction (contracted German), Chinese tables
write sounds. So three things are looked at, and named apart in the answer. All of them are of the pages together;
beside that each page is read alone, with nothing known of the page before it.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import islice
from typing import Any, NamedTuple

from ..choices import Undefined
from ..errors import TableMissing
from ..scene import GoesOn, PageNumber
from . import louis_binding
from .alphabet import alphabet
from .dots import BLANK, LOWER_SIX
from .joining import Emphases, join_pages, unmarked
from .readers.sources import SourceKind, TextSource
from .report import KEPT, ReportLog
from .transcribe import PARAGRAPH_END, Transcriber, paragraphs
from .translation import translate
from .undefined import writable

__all__ = ["BackCheck", "Difference", "FeltPage", "back_check", "back_translate"]

PIECE = 2000
"""Cells back-translated at once; more only up to the next blank, as a sign may have several cells."""
LONGEST_WORD = 100_000
LONGEST_REST = 200
MOST_FOLLOWING = 64
"""Characters, and pages, looked at of what follows a page."""
REACH = 12
"""Words looked ahead to find where two texts agree again."""


@dataclass(frozen=True)
class Difference:
    """Words of the source and what the back-translation has for them; one of them may be empty.

    `page` is the number of the page, from 0, that reads so alone; None of a difference in the text as a whole.
    """

    source: str
    back: str
    page: int | None = None

    @property
    def sentence(self) -> str:
        """For a person, pages counted from 1."""
        if self.page is None:
            return f"{self.source!r} comes back as {self.back!r}"
        return f"page {self.page + 1}: {self.source!r} read alone is {self.back!r}"


class FeltPage(NamedTuple):
    """Cells of a page as `read_cells` gives them, the text they show, where words go on, its emphases, its number."""

    cells: str
    text: str = ""
    goes_on: tuple[GoesOn, ...] = ()
    emphases: Emphases = ()
    number: PageNumber | None = None


@dataclass(frozen=True)
class BackCheck:
    """What the felt cells say.

    Attributes
    ----------
    text_equal : the back-translation is the text, apart from case, white space and curled or straight quotes.
    again_equal : the back-translation, written in Braille, gives the same cells: it may differ in what the
        table does not write (Chinese characters of one sound).
    cells_equal : the joined cells are exactly what the table writes for the text.
    back : the back-translated text.
    differences : the first 100 between source and back-translation; `difference_total` counts all.
    alone : the first 100 pages that read alone are not what they show; `alone_total` counts all.
    """

    text_equal: bool
    again_equal: bool
    cells_equal: bool
    back: str
    differences: tuple[Difference, ...]
    difference_total: int
    alone: tuple[Difference, ...] = ()
    alone_total: int = 0

    @property
    def ok(self) -> bool:
        """The text comes back, or, where the table cannot bring it back, the cells are exactly its cells."""
        return self.text_equal or self.cells_equal

    @property
    def sentence(self) -> str:
        """A sentence for a report, and a second one where pages read alone say something else."""
        if not self.alone:
            return self._together
        return f"{self._together} Pages that read alone say something else: {self.alone_total}."

    @property
    def _together(self) -> str:
        if not self.ok:
            return f"The cells are not those of the text ({self.difference_total} differences)."
        if self.text_equal:
            return "Back-translated, the cells give the text again."
        same = "the same cells" if self.again_equal else "other cells, as this table cannot be undone"
        return (
            f"The cells are those of the text; the back-translation differs from it in {self.difference_total} places "
            f"and written again gives {same}."
        )


def back_translate(tables: tuple[str, ...], cells: str) -> str:
    """Text of Unicode Braille as the tables read it; line breaks are read as blanks.

    Raises
    ------
    TableMissing
        When the tables cannot be used.
    """
    flat = cells.replace("\n", BLANK)
    parts = []
    at = 0
    try:
        while at < len(flat):
            cut = flat.find(BLANK, at + PIECE, at + LONGEST_WORD)
            if cut < 0:
                cut = at + LONGEST_WORD
            parts.append(louis_binding.back_translate(tables, flat[at:cut]))
            at = cut
    except RuntimeError:
        why = louis_binding.complaint() or "unknown reason"
        raise TableMissing(f"table {','.join(tables)}: cannot translate back: {why}") from None
    return "".join(parts)


def back_check(
    pages: Iterable[FeltPage | str],
    text: str,
    encoding: Mapping[str, Any],
    emphases: Emphases = (),
) -> BackCheck:
    """Compare what pages of felt cells say with `text`, together and each alone.

    Parameters
    ----------
    pages : each page, or its cells only, as `read_cells` gives them; such are not read alone.
    text : the source the pages show; for Braille sources the cells themselves.
    encoding : of the scene.
    emphases : (start, end, emphasis) of what is written with indicators in `text`.
    """
    given = list(pages)
    noted = "continuation" in encoding and not any(isinstance(page, str) for page in given)
    felt = [FeltPage(page) if isinstance(page, str) else page for page in given]
    goes_on = [page.goes_on for page in felt] if noted else None
    joined = join_pages((page.cells for page in felt), encoding, goes_on, (page.number for page in felt))
    reading = _Reading(encoding)
    source = TextSource(text, SourceKind(encoding["kind"]), "text", emphases=tuple(emphases))
    expected = reading.written(source)
    if source.kind is SourceKind.BRAILLE:
        same = joined == expected
        found = () if same else tuple(_differences(expected.split(BLANK), joined.split(BLANK)))
        return BackCheck(same, same, same, joined, found[:KEPT], len(found))
    tables = reading.tables
    ready = writable(text, 0, alphabet(tables), reading.transcriber.undefined, ReportLog()).text
    # Indicators of emphasis are read back by no table: where all cells are right, it is asked for those of the words.
    said = reading.written(replace(source, emphases=())) if emphases and joined == expected else joined
    back = back_translate(tables, said)
    found = tuple(_differences(_folded(ready).split(), _folded(back).split()))
    text_equal = not found or "".join(_folded(ready).split()) == "".join(_folded(back).split())
    alone = tuple(reading.alone(felt, encoding))
    return BackCheck(
        text_equal=text_equal,
        again_equal=text_equal or _squeezed(tables, back, reading.transcriber.dots) == said.replace(BLANK, ""),
        cells_equal=joined == expected,
        back=back,
        differences=() if text_equal else found[:KEPT],
        difference_total=0 if text_equal else len(found),
        alone=alone[:KEPT],
        alone_total=len(alone),
    )


class _Reading:
    """Writes and reads with the table of a scene; equal pages once."""

    def __init__(self, encoding: Mapping[str, Any]) -> None:
        self.tables = tuple(encoding["tables"])
        policy, passages = Undefined(encoding["undefined"]), bool(encoding.get("passages", True))
        self.transcriber = Transcriber(self.tables, policy, int(encoding["dots"]), passages)
        self._reads_as = lru_cache(maxsize=1 << 12)(self._asked)

    def written(self, source: TextSource, log: ReportLog | None = None) -> str:
        """Cells of a source, words parted by one blank."""
        log = log or ReportLog()
        spans = paragraphs(source.text)
        return _joined_cells(word for a, b in spans for word in self.transcriber.words(source, a, b, log))

    def alone(self, pages: Iterable[FeltPage], encoding: Mapping[str, Any]) -> Iterator[Difference]:
        """Pages that do not say what they show when nothing else is read.

        Of words that are whole on their page only digits and capitals are looked at, what indicators of a page before
        could change: the letters of such words are those of the text already if all pages together are.
        """
        given, begun = list(pages), False
        for number, page in enumerate(given):
            text = page.text.rstrip()
            if page.number is not None and not text:
                continue
            last = len(page.cells.replace("\n", "")) // int(encoding["run"]) - 1
            goes_on = any(one.run == last for one in page.goes_on)
            cells = unmarked(page.cells, encoding, page.goes_on, page.number)
            found = self._reads_as(cells, text, begun, goes_on, page.emphases) if text else None
            begun = goes_on
            if found and not self._begins(cells, page, goes_on, given[number + 1 :]):
                yield Difference(*found, number)

    def _begins(self, cells: str, page: FeltPage, goes_on: bool, following: list[FeltPage]) -> bool:
        """Whether the table writes just these cells for the text of a page where that of the next ones follows.

        An indicator of an address governs it as a whole, and what ends a text may be written otherwise than the same
        in its middle. Nothing is taken from the pages before: what governs the cells stands on their page.
        """
        text = page.text.rstrip()
        after = "".join(one.text for one in islice(following, MOST_FOLLOWING))[:LONGEST_REST]
        rest = (after.split() or [""])[0]
        if not rest or PARAGRAPH_END.search(page.text, len(text)):
            return False
        for between in ("",) if goes_on else ("", " "):
            whole = self.written(TextSource(text + between + rest, SourceKind.TEXT, "page", emphases=page.emphases))
            if whole.startswith(cells) and (goes_on or whole[len(cells) :].startswith(BLANK)):
                start = text[list(paragraphs(text))[-1][0] :].lstrip()
                found = translate(self.tables, start + between + rest)
                left = len(found.cells) - found.cell_of_text[len(start)]
                if whole[len(cells) :].startswith(BLANK) or left == len(whole) - len(cells):
                    return True
        return False

    def _asked(self, cells: str, text: str, begun: bool, goes_on: bool, emphases: Emphases) -> tuple[str, str] | None:
        """What of `text` the cells do not say, and what they say; `begun` and `goes_on` say which words are parts."""
        log = ReportLog()
        source = TextSource(text, SourceKind.TEXT, "page", emphases=emphases)
        words = [word for a, b in paragraphs(text) for word in self.transcriber.words(source, a, b, log)]
        own = _joined_cells(words)
        # The name of a character may be spread over pages that all show the one character.
        if cells == own or log.undefined_total:
            return None
        felt, written = cells.split(BLANK), own.split(BLANK)
        first = _alike(felt, written)
        last = min(_alike(felt[::-1], written[::-1]), len(felt) - first, len(written) - first)
        if len(words) != len(written):  # words of several pieces
            first = last = 0
        differing = words[first : len(words) - last]
        said = text[differing[0].start : differing[-1].end].strip() if differing else ""
        cut = (begun and not first and not own.startswith(felt[0])) or (
            goes_on and not last and not own.endswith(felt[-1])
        )
        if not cut and not _indicated(said):
            return None
        back, likely = (
            back_translate(self.tables, BLANK.join(part[first : len(part) - last])) for part in (felt, written)
        )
        look: Callable[[str], str] = _letters if cut else _indicated
        return None if look(back) in (look(said), look(likely)) else (said, back)


def _alike(one: list[str], other: list[str]) -> int:
    """How many of the first words are the same."""
    shorter = min(len(one), len(other))
    return next((at for at in range(shorter) if one[at] != other[at]), shorter)


def _letters(text: str) -> str:
    return "".join(_folded(text).split())


def _indicated(text: str) -> str:
    return "".join(char for char in _UNREAD.sub("", text) if char.isdigit() or char.isupper())


# Cells the table does not read, as the library shows them: their dots.
_UNREAD = re.compile(r"\\[\d/-]+/")


def _joined_cells(words: Iterable[Any]) -> str:
    parts: list[str] = []
    for word in words:
        if not word.glued:
            parts.append(BLANK)
        parts.append(word.cells)
    return "".join(parts[1:])


_TYPOGRAPHY = str.maketrans({"‘": "'", "’": "'", "“": '"', "”": '"'})


def _folded(text: str) -> str:
    # Braille has one apostrophe and one pair of quotes; which of print's the table gives back is its choice.
    return unicodedata.normalize("NFC", text).translate(_TYPOGRAPHY).casefold()


def _squeezed(tables: tuple[str, ...], text: str, dots: int) -> str:
    cells = "".join(translate(tables, text[at : at + PIECE]).cells for at in range(0, len(text), PIECE))
    return (cells.translate(LOWER_SIX) if dots == 6 else cells).replace(BLANK, "")


def _differences(source: list[str], back: list[str]) -> Iterator[Difference]:
    """Where two lists of words part, in time linear in their length."""
    i = j = 0
    while i < len(source) or j < len(back):
        if i < len(source) and j < len(back) and source[i] == back[j]:
            i, j = i + 1, j + 1
            continue
        skip_i, skip_j = _resume(source[i : i + REACH + 2], back[j : j + REACH + 2])
        yield Difference(" ".join(source[i : i + skip_i]), " ".join(back[j : j + skip_j]))
        i, j = i + skip_i, j + skip_j


def _resume(source: list[str], back: list[str]) -> tuple[int, int]:
    """How many words of each to skip until they agree again (in two words, or at the end)."""
    for total in range(1, 2 * REACH):
        for a in range(max(0, total - len(back)), min(total, len(source)) + 1):
            left, right = source[a : a + 2], back[total - a : total - a + 2]
            if left and left == right:
                return a, total - a
    return max(1, min(len(source), REACH)) if source else 0, max(1, min(len(back), REACH)) if back else 0
