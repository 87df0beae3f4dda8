"""The file of the plan cache: rows of bytes in SQLite, given back as they were kept or not at all."""

from __future__ import annotations

import logging
import os
import sqlite3
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import closing, suppress
from hashlib import sha256
from itertools import count
from pathlib import Path
from tempfile import mkstemp
from typing import TypeVar

__all__ = ["CacheFile", "digest_of"]

log = logging.getLogger(__name__)

LAYOUT = "CREATE TABLE plans (key BLOB PRIMARY KEY, value BLOB)"
DIGEST_BYTES = 16
# SQLite takes at least 999 values in one question.
ASKED_AT_ONCE = 500
# Codes of SQLite that speak of the file's content; others (locked, disk full, no permission) pass.
BROKEN = {
    sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_NOTADB, sqlite3.SQLITE_FORMAT, sqlite3.SQLITE_ERROR, sqlite3.SQLITE_SCHEMA,
    sqlite3.SQLITE_MISMATCH,
}  # fmt: skip
Answer = TypeVar("Answer")
Rows = list[tuple[bytes, bytes]]


class _Broken(Exception):
    """The file is a database, but its table is not the one that is kept here, or rows of it are damaged."""


class _Foreign(Exception):
    """The file is a database with tables of others."""


# SQLite quotes the file in its messages: where a damaged word is not UTF-8, making the message fails.
ERRORS = (OSError, sqlite3.Error, UnicodeDecodeError, _Broken, _Foreign)


def digest_of(key: bytes, value: bytes) -> bytes:
    """What a kept value ends with, so that a flipped bit, or the value of another key, is seen."""
    return sha256(key + value).digest()[:DIGEST_BYTES]


class CacheFile:
    """Values by key, in the file at `path` for as long as it can be used.

    A damaged row is not found. Where one is met the file is made anew with the rows that are whole; a file that is not
    such a cache at all is moved aside first (``plans.sqlite.damaged``). A file that cannot be read or written for
    another reason, or that is another program's database, is left as it is: nothing is then found. The log says so.
    """

    def __init__(self, path: Path, patience_s: float) -> None:
        """`patience_s` : how long another process may write before the file is not waited for."""
        self._path, self._patience_s = path, patience_s
        self._connection: sqlite3.Connection | None = None
        self._identity: tuple[int, int] | None = None
        self._ours = self._remade = False
        self._open()

    def find(self, keys: Sequence[bytes]) -> dict[bytes, bytes]:
        """What is kept for each key; what is not, or is damaged, is left out."""
        nothing: list[tuple[object, object]] = []
        rows = self._done(lambda connection: _asked(connection, keys), nothing)
        found = dict(_whole(rows))
        if len(found) < len(rows):
            self._mend(_Broken("damaged rows"))
        return found

    def keep(self, rows: Iterable[tuple[bytes, bytes]]) -> None:
        """Keep values, in place of those that their keys have."""
        signed = [(key, value + digest_of(key, value)) for key, value in rows]
        self._done(lambda connection: _write(connection, signed), None)

    def _done(self, work: Callable[[sqlite3.Connection], Answer], otherwise: Answer) -> Answer:
        """What `work` gives; it is done again when the file had to be made anew."""
        while self._connection is not None:
            try:
                return work(self._connection)
            except ERRORS as error:
                self._mend(error)
        return otherwise

    def _open(self) -> None:
        try:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            self._identity = _identity(self._path)
            self._connection = _connected(self._path, self._patience_s)
            _lay_out(self._connection)
            self._identity, self._ours = _identity(self._path), True
        except ERRORS as error:
            self._mend(error)

    def _mend(self, error: Exception) -> None:
        """Go on with a new file where the old one is broken, else without one."""
        old, self._connection = self._connection, None
        try:
            if not self._remade and self._broken(error):
                self._remade = True
                # Another process may have been quicker.
                if self._identity in (None, _identity(self._path)):
                    self._make_anew(old)
                self._open()
                return
        except (OSError, sqlite3.Error) as refusal:
            error = refusal
        finally:
            if old is not None:
                old.close()
        log.warning("plan cache %s is not used: %s; let DOTWAVE_CACHE name another folder", self._path, error)

    def _broken(self, error: Exception) -> bool:
        if isinstance(error, sqlite3.Error):
            code = getattr(error, "sqlite_errorcode", 0) & 0xFF
            # A damaged header makes a file read-only that its folder and its permissions do not.
            bound = code == sqlite3.SQLITE_READONLY and os.access(self._path, os.W_OK)
            return bound or code in BROKEN
        return isinstance(error, UnicodeDecodeError | _Broken)

    def _make_anew(self, old: sqlite3.Connection | None) -> None:
        """Replace the file by one with its whole rows; one that never was a cache is kept under another name."""
        made, name = mkstemp(prefix=f".{self._path.name}.", suffix=".part", dir=self._path.parent)
        os.close(made)
        aside = Path(name)
        try:
            with closing(_connected(aside, self._patience_s)) as new:
                _lay_out(new)
                saved = _salvaged(old, new) if old is not None and self._ours else 0
            if self._ours:
                log.warning("plan cache %s: damaged; made anew with %d whole plans", self._path, saved)
            else:
                names = (f"{self._path.name}.damaged" + (f"-{number}" if number > 1 else "") for number in count(1))
                free = next(path for path in map(self._path.with_name, names) if not os.path.lexists(path))
                self._path.rename(free)
                log.warning("plan cache %s: damaged; moved to %s and made anew", self._path, free.name)
            aside.replace(self._path)
        finally:
            aside.unlink(missing_ok=True)


def _identity(path: Path) -> tuple[int, int] | None:
    """What tells a file from another of the same name; None where there is none."""
    try:
        found = path.stat()
    except FileNotFoundError:
        return None
    return found.st_dev, found.st_ino


def _connected(path: Path, patience_s: float) -> sqlite3.Connection:
    connection = sqlite3.connect(path, timeout=patience_s, isolation_level=None, check_same_thread=False)
    # A damaged text need not be UTF-8.
    connection.text_factory = bytes
    return connection


def _lay_out(connection: sqlite3.Connection) -> None:
    """Make the table, or make sure that it is the one and nobody else's is there."""
    question = "SELECT name, sql FROM sqlite_master WHERE type = 'table' AND name NOT LIKE 'sqlite_%'"
    with closing(connection.cursor()) as cursor:
        cursor.execute("PRAGMA synchronous = OFF")
        tables = dict(cursor.execute(question).fetchall())
        if not tables:
            cursor.execute(LAYOUT.replace("TABLE", "TABLE IF NOT EXISTS"))
        elif b"plans" not in tables and LAYOUT.encode() not in tables.values():
            raise _Foreign("it is another program's database")
        elif tables != {b"plans": LAYOUT.encode()}:
            raise _Broken("it has other columns")


def _asked(connection: sqlite3.Connection, keys: Sequence[bytes]) -> list[tuple[object, object]]:
    found = []
    for start in range(0, len(keys), ASKED_AT_ONCE):
        part = keys[start : start + ASKED_AT_ONCE]
        marks = ", ".join("?" * len(part))
        with closing(connection.cursor()) as cursor:
            found += cursor.execute(f"SELECT key, value FROM plans WHERE key IN ({marks})", part).fetchall()
    return found


def _write(connection: sqlite3.Connection, rows: Rows) -> None:
    connection.execute("BEGIN")
    connection.executemany("INSERT OR REPLACE INTO plans VALUES (?, ?)", rows)
    connection.execute("COMMIT")


def _whole(rows: Iterable[tuple[object, object]]) -> Iterator[tuple[bytes, bytes]]:
    """Keys and values of those rows that are as they were kept."""
    for key, raw in rows:
        if isinstance(key, bytes) and isinstance(raw, bytes):
            value = raw[:-DIGEST_BYTES]
            if raw[-DIGEST_BYTES:] == digest_of(key, value):
                yield key, value


def _salvaged(old: sqlite3.Connection, new: sqlite3.Connection) -> int:
    """Copy what is whole for as far as the old file can be read; how many rows."""
    number = 0
    with suppress(*ERRORS), closing(old.cursor()) as cursor:
        cursor.execute("SELECT key, value FROM plans")
        while rows := cursor.fetchmany(ASKED_AT_ONCE):
            whole = [(key, value + digest_of(key, value)) for key, value in _whole(rows)]
            _write(new, whole)
            number += len(whole)
    return number
