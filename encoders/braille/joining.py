"""Pages of cells joined to one line again."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import repeat
from typing import Any

from ..scene import GoesOn
from .dots import BLANK

__all__ = ["join_pages", "unmarked"]


def join_pages(
    pages: Iterable[str], encoding: Mapping[str, Any], goes_on: Iterable[Sequence[GoesOn]] | None = None
) -> str:
    """The cells of all pages as one line of Braille with single blanks, cut words joined again.

    Parameters
    ----------
    pages : Unicode Braille with a newline after each line but the last, as `Frame.cells` and `read_cells` give it.
    encoding : of the scene; ``run``, ``hyphen`` and ``continuation`` are used.
    goes_on : of each page, as frames have it. What was added there is taken out again, where it is felt. Without
        it (manifests of old do not say) the dots decide: hyphens and signs of continuation at the end of a run.
    """
    size = int(encoding["run"])
    parts: list[str] = []
    added: GoesOn | None = None
    for page, notes in zip(pages, repeat(None) if goes_on is None else goes_on, strict=False):
        cells = page.replace("\n", "")
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


_DOTS = tuple(chr(code) for code in range(0x2801, 0x2900))


def _noted(notes: Sequence[GoesOn], number: int, shown: str) -> GoesOn | None:
    return next((note for note in notes if note.run == number and shown.endswith(note.ending + note.mark)), None)


def _guessed(shown: str, size: int, encoding: Mapping[str, Any]) -> GoesOn | None:
    hyphen = str(encoding["hyphen"])
    for mark in (hyphen, str(encoding.get("continuation", ""))):
        if mark and shown.endswith(mark):
            return GoesOn(0, mark)
    return GoesOn(0) if not hyphen and len(shown) == size else None


def unmarked(page: str, encoding: Mapping[str, Any], goes_on: Sequence[GoesOn]) -> str:
    """What a page alone shows: its cells as one line, without the marks where words go on.

    Indicators restated at the start of a run stay at the start of the page; within it they are taken out.
    """
    last = len(page.replace("\n", "")) // int(encoding["run"]) - 1
    return join_pages([page], encoding, [[replace(one, ending="") if one.run == last else one for one in goes_on]])
