"""Which translation tables there are, and which one a person means."""

from __future__ import annotations

import os
import re
from difflib import get_close_matches
from functools import cache
from pathlib import Path

from ..errors import TableMissing
from . import louis_binding

__all__ = ["foreign_tables", "hyphenation_tables", "resolve_tables", "table_dots"]


def resolve_tables(spec: str) -> tuple[str, ...]:
    """The table list a person means by `spec`.

    Parameters
    ----------
    spec : a file name (``en-ueb-g2.ctb``), a list (``a.ctb,b.dic``), or a query (``language:de grade:contracted``),
        see `table_queries.answer`.

    Raises
    ------
    TableMissing
        When nothing fits or the tables do not compile; the message names the nearest.
    LouisMissing
        When liblouis is not installed.
    """
    wish = _checked(spec)
    if _is_query(wish):
        return (_answer(wish),)
    tables = tuple(part.strip() for part in wish.split(",") if part.strip())
    for name in tables:
        # liblouis would wait for a pipe, and read a device without an end.
        if os.path.exists(name) and not (os.path.isfile(name) or os.path.isdir(name)):
            raise TableMissing(f"table {name!r}: a device or a pipe; give a file, or see 'dotwave tables'")
    if tables and louis_binding.compiles(tables):
        return tables
    raise TableMissing(_complaint(wish, tables))


def _checked(spec: str) -> str:
    wish = spec.strip()
    if not wish:
        raise TableMissing("table: the name is empty; 'dotwave tables' lists all")
    if len(wish) > MOST_NAMED:
        raise TableMissing(f"table: {len(wish)} characters; a name or list of names has at most {MOST_NAMED}")
    if _NO_NAME.search(wish):
        raise TableMissing(f"table {wish[:60]!r}: a character that no table's name has; 'dotwave tables' lists all")
    return wish


def _answer(wish: str) -> str:
    # Imported here, as below: who names a table that is there asks nothing.
    from .table_queries import answer

    return answer(wish)


def _is_query(wish: str) -> bool:
    return ":" in wish and not any(sign in wish for sign in "/\\")


# liblouis keeps names in buffers of its own.
MOST_NAMED = 1000
# Control characters, and halves of surrogate pairs.
_NO_NAME = re.compile("[\x00-\x1f\x7f\ud800-\udfff]")
_PLACE = re.compile(r"[^\n]*?:\d+(?=: )")


def _complaint(wish: str, tables: tuple[str, ...]) -> str:
    from .table_queries import list_tables

    known = {info.file: info for info in list_tables()}
    files = {path.name for folder in _folders() for path in folder.iterdir()}
    missing = [name for name in tables if name not in files and not Path(name).is_file()]
    if not missing:
        # Only where it stands: what stands there may be of a file that is none of the reader's business.
        place = _PLACE.match(louis_binding.complaint())
        where = f": {place[0]}: expected a rule of liblouis (lou_checktable says more)" if place else ""
        return f"table {wish!r} does not compile{where}; choose another ('dotwave tables')"
    name = missing[0]
    lowered = {file.casefold(): file for file in known}
    close = [lowered[match] for match in get_close_matches(name.casefold(), list(lowered), n=3, cutoff=0.6)]
    named = [file for file, info in known.items() if name.casefold() in info.name.casefold()]
    nearest = list(dict.fromkeys(close + named))[:4]
    return f"table {name!r}: no such table; " + (
        f"nearest: {', '.join(nearest)}" if nearest else "'dotwave tables' lists all"
    )


@cache
def _folders() -> tuple[Path, ...]:
    folders = {os.path.dirname(path) for path in louis_binding.listed_tables()}
    return tuple(sorted(Path(folder) for folder in folders if os.path.isdir(folder)))


def foreign_tables(spec: str) -> tuple[str, ...]:
    """Those of the tables a person means by `spec` that liblouis did not bring along.

    Files of the current folder that bear a name of liblouis's own are among them: they would be taken for it.

    Raises
    ------
    TableMissing
        When nothing answers a query, or the names cannot be any.
    LouisMissing
        When liblouis is not installed.
    """
    wish = _checked(spec)
    names = [_answer(wish)] if _is_query(wish) else [part.strip() for part in wish.split(",") if part.strip()]
    own = {path.name for folder in _folders() for path in folder.iterdir()}
    return tuple(name for name in names if name not in own or os.path.lexists(name))


def table_dots(tables: tuple[str, ...]) -> int:
    """6 or 8 as the first table that states it says, 0 when none does."""
    stated = (louis_binding.table_info(name, "dots") for name in tables)
    return next((int(dots) for dots in stated if dots in ("6", "8")), 0)


@cache
def hyphenation_tables(tables: tuple[str, ...]) -> tuple[str, ...]:
    """`tables` with the hyphenation dictionary of their language, or () when there is none."""
    if any(Path(name).name.startswith("hyph_") for name in tables):
        return tables
    spoken = next(filter(None, (louis_binding.table_info(name, "language") for name in tables)), "")
    for folder in _folders() if spoken else ():
        language = spoken.split("-")[0].casefold()
        for path in sorted((*folder.glob(f"hyph_{language}.dic"), *folder.glob(f"hyph_{language}_*.dic"))):
            together = (*tables, str(path))
            if louis_binding.compiles(together):
                return together
    return ()
