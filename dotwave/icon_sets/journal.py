"""What was finished, one line each, so that a run that was killed goes on where it stopped."""

from __future__ import annotations

import json
import os
import stat
from pathlib import Path
from types import TracebackType
from typing import Any

from drivers import FileError, naming

__all__ = ["Journal"]

START = b'{"key":'
# Longer than any record is; what is longer is not one.
LONGEST = 1 << 24


class Journal:
    """Records by key in a file that is only ever added to.

    A record is one line, written at once: a line that was cut short is not a record and is passed over.
    The last record of a key counts. Only the places of records are kept in memory.

    Raises
    ------
    drivers.FileError
        When `path` is no such journal, which is then left as it is, or the disk refuses.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._places: dict[str, tuple[int, int]] = {}
        with naming(path):
            self._file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_APPEND | getattr(os, "O_NOFOLLOW", 0), 0o666)
            if not stat.S_ISREG(os.fstat(self._file).st_mode):
                os.close(self._file)
                raise FileError(f"{path}: not a plain file, so nothing can be kept there; move it away")
            end, raw = 0, b"\n"
            with path.open("rb") as lines:
                for raw in iter(lambda: lines.readline(LONGEST), b""):
                    if not end and not _starts(raw):
                        os.close(self._file)
                        raise FileError(f"{path}: not a journal of dotwave; give another folder, or move it away")
                    self._note(raw, end)
                    end += len(raw)
        if not raw.endswith(b"\n"):
            self._write(b"\n")

    def _note(self, raw: bytes, start: int) -> None:
        try:
            record = json.loads(raw)
        except ValueError:
            return
        if isinstance(record, dict) and isinstance(record.get("key"), str):
            self._places[record["key"]] = start, len(raw)

    def _write(self, raw: bytes) -> int:
        """Where it was written; another run into the same file may have made it longer in between."""
        with naming(self._path):
            left = memoryview(raw)
            while left:
                # A disk that becomes full takes a part and refuses the next.
                left = left[os.write(self._file, left) :]
            return os.lseek(self._file, 0, os.SEEK_CUR) - len(raw)

    def __contains__(self, key: str) -> bool:
        return key in self._places

    def find(self, key: str) -> dict[str, Any] | None:
        """The record of a key, or None."""
        if key not in self._places:
            return None
        start, length = self._places[key]
        with naming(self._path):
            record: dict[str, Any] = json.loads(os.pread(self._file, length, start))
        return record

    def add(self, *records: dict[str, Any]) -> None:
        """Keep records under their ``"key"``; they are safe from a kill once this returns.

        Raises
        ------
        drivers.FileError
            When the disk refuses.
        """
        lines = [json.dumps(record, separators=(",", ":")).encode() + b"\n" for record in records]
        start = self._write(b"".join(lines))
        for record, line in zip(records, lines, strict=True):
            self._places[record["key"]] = start, len(line)
            start += len(line)

    def __enter__(self) -> Journal:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        os.close(self._file)


def _starts(line: bytes) -> bool:
    """Whether a journal may begin with this line, which may have been cut short."""
    return line.startswith(START) or START.startswith(line.rstrip())
