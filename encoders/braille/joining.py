"""Pages joined again: their cells to one line, and the text and emphases they show."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import chain, pairwise, repeat
from operator import itemgetter
from typing import Any

from ..scene import GoesOn, PageNumber
from .dots import BLANK

__all__ = [
    "Emphases", "covered_emphases", "covered_text", "emphases_of", "emphases_within", "join_pages", "unmarked",
]  # fmt: skip

Emphases = tuple[tuple[int, int, int], ...]
"""(start, end, emphasis) of what is written with indicators, in order and apart; see `encoders.Emphasis`."""


def join_pages(
    pages: Iterable[str],
    encoding: Mapping[str, Any],
    goes_on: Iterable[Sequence[GoesOn]] | None = None,
    numbers: Iterable[PageNumber | None] = (),
) -> str:
    """The cells of all pages as one line of Braille with single blanks, cut words joined again.

    Parameters
    ----------
    pages : Unicode Braille with a newline after each line but the last, as `Frame.cells` and `read_cells` give it.
    encoding : of the scene; ``run``, ``hyphen`` and ``continuation`` are used.
    goes_on : of each page, as frames have it. What was added there is taken out again, where it is felt. Without
        it (manifests of old do not say) the dots decide: hyphens and signs of continuation at the end of a run.
    numbers : of each page, as frames have it: where it is felt, it is not of the text, and a page of nothing else is
        passed over.
    """
    size = int(encoding["run"])
    parts: list[str] = []
    added: GoesOn | None = None
    shown = zip(pages, repeat(None) if goes_on is None else goes_on, chain(numbers, repeat(None)), strict=False)
    for page, notes, number_shown in shown:
        cells = _without_number(page.replace("\n", ""), number_shown)
        if number_shown is not None and not cells.strip(BLANK):
            continue
        added = added if cells else None
        for number, at in enumerate(range(0, len(cells), size)):
            run = cells[at : at + size]
            # A first part may be moved to the end of its run; without notes such a word is taken for a new one.
            following = run if notes is None else run.lstrip(BLANK)
            if added is None or not following.startswith(added.restated or _DOTS):
                parts.append(BLANK)
            else:
                parts[-1] = parts[-1].removesuffix(added.ending + added.mark) + added.left_out
                run = following[len(added.restated) :]
            parts.append(run.rstrip(BLANK))
            added = _guessed(parts[-1], size, encoding) if notes is None else _noted(notes, number, parts[-1])
            if notes is not None and added is not None:
                parts[-1] = parts[-1].removesuffix(added.ending + added.mark)
                added = GoesOn(number, "", added.restated, "", added.left_out)
    return BLANK.join(part for part in "".join(parts).split(BLANK) if part)


def _without_number(cells: str, number: PageNumber | None) -> str:
    if number is None or not cells.startswith(number.cells, number.at):
        return cells
    return cells[: number.at] + BLANK * len(number.cells) + cells[number.at + len(number.cells) :]


_DOTS = tuple(chr(code) for code in range(0x2801, 0x2900))


def _noted(notes: Sequence[GoesOn], number: int, shown: str) -> GoesOn | None:
    return next((note for note in notes if note.run == number and shown.endswith(note.ending + note.mark)), None)


def _guessed(shown: str, size: int, encoding: Mapping[str, Any]) -> GoesOn | None:
    hyphen = str(encoding["hyphen"])
    for mark in (hyphen, str(encoding.get("continuation", ""))):
        if mark and shown.endswith(mark):
            return GoesOn(0, mark)
    return GoesOn(0) if not hyphen and len(shown) == size else None


def unmarked(
    page: str, encoding: Mapping[str, Any], goes_on: Sequence[GoesOn], number: PageNumber | None = None
) -> str:
    """What a page alone shows: its cells as one line, without its number and the marks where words go on.

    Indicators restated at the start of a run stay at the start of the page; within it they are taken out.
    """
    last = len(page.replace("\n", "")) // int(encoding["run"]) - 1
    notes = [replace(one, ending="") if one.run == last else one for one in goes_on]
    return join_pages([page], encoding, [notes], [number])


def covered_emphases(shown: Iterable[tuple[tuple[int, int], str]], emphases: Emphases) -> Emphases:
    """Emphases of a source as positions in what `covered_text` gives of the same frames."""
    found: list[tuple[int, int, int]] = []
    length, reached = 0, -1
    for (start, end), text in shown:
        if end <= reached or not text:
            continue
        length += reached >= 0 and start > reached
        first = max(start, reached)
        found += emphases_within(emphases, first, end, length)
        length += end - first
        reached = end
    return tuple(found)


def emphases_within(emphases: Emphases, start: int, end: int, at: int = 0) -> Emphases:
    """Those of the characters from `start` to `end`, as positions where `start` is `at`."""
    found = []
    for index in range(bisect_right(emphases, start, key=itemgetter(1)), len(emphases)):
        low, high, form = emphases[index]
        if low >= end:
            break
        found.append((max(low, start) - start + at, min(high, end) - start + at, form))
    return tuple(found)


def emphases_of(encoding: Mapping[str, Any]) -> Emphases:
    """Those of a scene; what a manifest has there that is none is passed over."""
    given = encoding.get("emphases", ())
    found = sorted(tuple(one) for one in given if _is_emphasis(one)) if isinstance(given, list | tuple) else []
    return tuple(one for before, one in pairwise([(0, 0, 0), *found]) if before[1] <= one[0])


def _is_emphasis(value: Any) -> bool:
    whole = isinstance(value, list | tuple) and len(value) == 3 and all(type(one) is int for one in value)
    return whole and 0 <= value[0] < value[1] and 0 < value[2] < 8


def covered_text(shown: Iterable[tuple[tuple[int, int], str]]) -> str:
    """The source text of frames, joined: overlapping spans count once, a gap is one blank.

    Parameters
    ----------
    shown : span and text of each frame, in order, as in `Frame`.
    """
    parts: list[str] = []
    reached = -1
    for (start, end), text in shown:
        if end <= reached or not text:
            continue
        if reached >= 0 and start > reached:
            parts.append(" ")
        parts.append(text[max(0, reached - start) :])
        reached = end
    return "".join(parts)
