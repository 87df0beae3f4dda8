"""Which tables liblouis has, and which of them answers someone who names a language."""

from __future__ import annotations

from dataclasses import dataclass
from difflib import get_close_matches
from functools import cache
from pathlib import Path

from ..choices import Grade
from ..errors import TableMissing
from . import louis_binding

__all__ = ["TableInfo", "answer", "list_tables", "recommended_tables"]

# Languages whose tables stand under another tag: macrolanguages and their usual members (ISO 639-3), old tags, and the
# Chinese of regions that write another Braille than the rest.
LISTED_AS = {
    "zh-tw": "cmn-tw", "zh-hant": "cmn-tw", "zh-hk": "yue", "zh-mo": "yue", "zh": "cmn", "nb": "no", "nn": "no",
    "pes": "fa", "prs": "fa", "arb": "ar", "zsm": "ms", "swh": "sw", "ekk": "et", "lvs": "lv", "khk": "mn",
    "npi": "ne", "ory": "or", "uzn": "uz", "ku": "kmr", "iw": "he",
}  # fmt: skip
# Parts of file names by which the code in force is known among several of one language: Unified English Braille,
# Russian as in books, Chinese common braille (GF 0019-2018), and Taiwan's own, which stands with the others.
IN_FORCE = {"en": "ueb", "ru": "litbrl", "cmn": "cbs", "cmn-tw": "zh-tw"}
# Parts of the names of tables that older rules or special readers are served by.
APART = ("_1993", "-1989", "-2006", "-detailed")
MOST_NAMED = 4


@dataclass(frozen=True)
class TableInfo:
    """One table, from liblouis's own metadata; a field it does not state is empty (`dots`: 0).

    Attributes
    ----------
    file : name of the table file.
    language : BCP 47 tag.
    grade : contraction grade.
    name : what to show to a person.
    contraction : ``full``, ``partial`` or ``no``.
    dots : 6 or 8.
    direction : ``forward`` when the table is not made for back-translation.
    kind : ``literary`` or ``computer``.
    """

    file: str
    language: str
    grade: str
    name: str
    contraction: str
    dots: int
    direction: str
    kind: str

    @property
    def degree(self) -> float:
        """How far it contracts: 0 not at all, 9 where it does and no grade is stated."""
        if self.contraction == "no" or not (self.contraction or self.grade > "1"):
            return 0.0
        return float(self.grade or 9)


@cache
def list_tables() -> tuple[TableInfo, ...]:
    """All tables that carry metadata, sorted by language, grade and file.

    Raises
    ------
    LouisMissing
        When liblouis is not installed.
    """
    return tuple(sorted(_by_path().values(), key=lambda info: (info.language, info.grade, info.file)))


@cache
def _by_path() -> dict[str, TableInfo]:
    return {path: _info(path) for path in louis_binding.listed_tables()}


def _info(path: str) -> TableInfo:
    def value(key: str) -> str:
        return louis_binding.table_info(path, key)

    return TableInfo(
        file=Path(path).name,
        language=value("language"),
        grade=value("grade"),
        name=value("display-name") or value("index-name") or value("name"),
        contraction=value("contraction"),
        dots={"6": 6, "8": 8}.get(value("dots"), 0),
        direction=value("direction"),
        kind=value("type"),
    )


def answer(query: str) -> str:
    """The file of the one table that fits every part of `query`.

    Parameters
    ----------
    query : keys of liblouis's metadata and their values, ``language:de grade:2``. A language is a BCP 47 tag, also
        of a macrolanguage (``zh``). A grade may be ``uncontracted`` or ``contracted`` too; 0 and 1 are the former for
        a language whose tables do not state them.

    Of several that fit, 6-dot literary tables come first, then the least contracted (the most, where contraction is
    asked for), then the code in force.

    Raises
    ------
    TableMissing
        When none fits; the message names the nearest.
    LouisMissing
        When liblouis is not installed.
    """
    wishes = {key.casefold(): value.casefold() for key, _, value in (part.partition(":") for part in query.split())}
    language, grade = _listed_as(wishes.pop("language", "")), wishes.pop("grade", "")
    spoken = [path for path, info in _by_path().items() if _speaks(info, language)]
    fitting = [
        path
        for path in _of_grade(spoken, grade)
        if all(louis_binding.table_info(path, key).casefold() == value for key, value in wishes.items())
    ]
    if not fitting:
        raise TableMissing(f"table: none answers the query {query!r}; {_nearest(language, spoken)}")
    code = IN_FORCE.get(language) or IN_FORCE.get(language.split("-")[0], "")

    def rank(path: str) -> tuple[object, ...]:
        info = _by_path()[path]
        degree = -info.degree if grade == Grade.CONTRACTED else info.degree
        apart = any(part in info.file for part in APART)
        return info.dots == 8, info.kind != "literary", apart, code not in info.file, degree, path

    return _by_path()[min(fitting, key=rank)].file


@cache
def recommended_tables() -> dict[str, Grade]:
    """File -> grade of every table that a language and that grade are answered with."""
    found = {}
    for language in dict.fromkeys([*(info.language for info in list_tables()), *LISTED_AS.values()]):
        for grade in Grade:
            try:
                found[answer(f"language:{language} grade:{grade}")] = grade
            except TableMissing:
                continue
    return found


def _listed_as(tag: str) -> str:
    """The tag under which the tables of a language stand; regions that make no difference are left out."""
    base = tag.split("-")[0]
    return LISTED_AS.get(tag) or LISTED_AS.get("-".join(tag.split("-")[:2])) or LISTED_AS.get(base, tag)


def _speaks(info: TableInfo, language: str) -> bool:
    found, base = info.language.casefold(), language.split("-")[0]
    return not language or found == base or found.startswith((f"{language}-", f"{base}-"))


def _of_grade(paths: list[str], grade: str) -> list[str]:
    if grade in list(Grade):
        return [path for path in paths if _by_path()[path].kind == "literary"
                and (_by_path()[path].degree > 0) == (grade == Grade.CONTRACTED)]  # fmt: skip
    stated = [path for path in paths if not grade or _by_path()[path].grade == grade]
    return stated or (_of_grade(paths, Grade.UNCONTRACTED) if grade in ("0", "1") else [])


def _nearest(language: str, spoken: list[str]) -> str:
    if language and spoken:
        shown = sorted((_by_path()[path] for path in spoken), key=lambda info: (info.kind != "literary", info.file))
        return f"for language {language} there are: " + ", ".join(f"{i.file} ({i.name})" for i in shown[:MOST_NAMED])
    named = {info.name.split()[0].casefold(): info for info in reversed(list_tables()) if info.name}
    close = get_close_matches(language, list(named), n=3, cutoff=0.75)
    if close:
        return "did you mean " + ", ".join(f"{named[name].language} ({name.capitalize()})" for name in close) + "?"
    return (
        f"this liblouis has no table for language {language!r}; 'dotwave tables' lists those it has, a newer "
        "liblouis may have more, and a table of your own can be given by its path"
    )
