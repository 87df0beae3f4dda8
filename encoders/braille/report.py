"""What happened while a text was encoded, bounded in size however long the text is."""

from __future__ import annotations

from dataclasses import dataclass, field

__all__ = ["EncodingReport", "ReportLog", "Split", "UndefinedUse"]

KEPT = 100


@dataclass(frozen=True)
class UndefinedUse:
    """A character, or sequence of characters, that the table cannot write.

    Attributes
    ----------
    characters : as they stand in the source.
    action : ``named``, ``respelled`` (a compatible form is written), ``dropped`` or ``six dots`` (dots 7
        and 8 are left out).
    written : what is written in its place.
    first : position of the first one in the source.
    count : how many there are.
    """

    characters: str
    action: str
    written: str
    first: int
    count: int


@dataclass(frozen=True)
class Split:
    """A word that did not fit: where it is broken.

    Attributes
    ----------
    word : its beginning, at most 80 characters.
    span : (start, end) in the source.
    page : the page its first part is on.
    hyphenated : broken at a syllable, with a hyphen; else at the last cell.
    """

    word: str
    span: tuple[int, int]
    page: int
    hyphenated: bool


@dataclass(frozen=True)
class EncodingReport:
    """Totals, and the first 100 entries of each list.

    Attributes
    ----------
    undefined : different characters the table cannot write, in order of their first use.
    undefined_total : how many such characters were met, all kinds together.
    splits : breaks inside words.
    split_total : how many.
    invisible : format characters without a sign of their own (soft hyphen, U+200B, direction marks) left out.
    pages, frames, cells : what was made; cells without blanks.
    """

    undefined: tuple[UndefinedUse, ...]
    undefined_total: int
    splits: tuple[Split, ...]
    split_total: int
    invisible: int
    pages: int
    frames: int
    cells: int


@dataclass
class ReportLog:
    """Collects a report while frames are made; `report` is what is known so far."""

    undefined_total: int = 0
    split_total: int = 0
    invisible: int = 0
    pages: int = 0
    frames: int = 0
    cells: int = 0
    _undefined: dict[tuple[str, str], UndefinedUse] = field(default_factory=dict)
    _splits: list[Split] = field(default_factory=list)

    def undefined(self, characters: str, action: str, written: str, position: int, times: int = 1) -> None:
        """Note uses of characters the table cannot write, `times` of them side by side."""
        self.undefined_total += times
        old = self._undefined.get((characters, action))
        if old is not None:
            use = UndefinedUse(characters, action, old.written, old.first, old.count + times)
        elif len(self._undefined) < KEPT:
            use = UndefinedUse(characters, action, written, position, times)
        else:
            return
        self._undefined[characters, action] = use

    def split(self, split: Split) -> None:
        """Note a break inside a word."""
        self.split_total += 1
        if len(self._splits) < KEPT:
            self._splits.append(split)

    @property
    def report(self) -> EncodingReport:
        """The report so far; complete when the frames were consumed to the end."""
        return EncodingReport(
            undefined=tuple(self._undefined.values()),
            undefined_total=self.undefined_total,
            splits=tuple(self._splits),
            split_total=self.split_total,
            invisible=self.invisible,
            pages=self.pages,
            frames=self.frames,
            cells=self.cells,
        )
