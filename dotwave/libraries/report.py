"""What came of a library."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ..plain import one_line

__all__ = ["SCHEMA", "LibraryReport"]

SCHEMA = "dotwave/library/1"
COLUMNS = ("name", "ok", "frames", "pages", "duration_s", "note", "waveform")


@dataclass(frozen=True)
class LibraryReport:
    """A library of texts.

    Attributes
    ----------
    device : name of the profile.
    texts : a record of each file that could be read, by name; as `work.render_files` gives them.
    failed : name -> what is wrong with it.
    unfinished : names that were not reached.
    worked : files rendered in this run; the others were ready.
    seconds : taken.
    files : what was written beside the waveforms.
    """

    device: str
    texts: Sequence[Mapping[str, Any]]
    failed: Mapping[str, str]
    unfinished: tuple[str, ...]
    worked: int
    seconds: float
    files: tuple[str, ...] = ()

    @property
    def ok(self) -> bool:
        """Every file was read and can be made as asked."""
        return not self.failed and not self.unfinished and all(one["ok"] for one in self.texts)

    def manifest(self) -> dict[str, Any]:
        """What is written as JSON: the same for the same files and options, whoever did the work."""
        return {
            "schema": SCHEMA,
            "device": self.device,
            "complete": not self.unfinished,
            "texts": [{column: one[column] for column in COLUMNS} for one in self.texts],
            "failed": [{"name": name, "error": error} for name, error in self.failed.items()],
            "unfinished": list(self.unfinished),
        }

    def as_dict(self) -> dict[str, Any]:
        """The manifest and how the run went, in plain JSON types."""
        return {"ok": self.ok} | self.manifest() | {
            "worked": self.worked, "seconds": self.seconds, "files": list(self.files),
        }  # fmt: skip

    def as_text(self) -> str:
        """The report as lines of plain text, one for each file."""
        return "\n".join(map(one_line, self._lines()))

    def _lines(self) -> Iterator[str]:
        for one in self.texts:
            what = f"{one['frames']} frames on {one['pages']} pages, {one['duration_s']:.2f} s"
            made = what if one["ok"] else "cannot be made as asked"
            yield f"{one['name']}: " + "; ".join(filter(None, (made, one["note"], one["waveform"])))
        yield from (f"{name}: could not be used: {error}" for name, error in self.failed.items())
        yield from (f"{name}: not reached" for name in self.unfinished)
        good = sum(bool(one["ok"]) for one in self.texts)
        total = len(self.texts) + len(self.failed) + len(self.unfinished)
        yield f"Rendered {good} of {total} files for {self.device}, {self.worked} of them now."
        yield from (f"Written: {name}" for name in self.files)
        yield f"Time taken: {self.seconds:.2f} s."
