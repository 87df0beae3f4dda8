"""What came of a set of icons: its manifest, and the report of the command line."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from encoders import distinctness

from ..plain import one_line
from .set import Icon, felt_set
from .words import in_braille

__all__ = ["SCHEMA", "IconsReport", "icon_row"]

SCHEMA = "dotwave/icons/1"
LISTED = 20
MARKS = {0.0: ".", 0.5: "-", 1.0: "o"}


@dataclass(frozen=True)
class IconsReport:
    """A set of icons.

    Attributes
    ----------
    icons : sorted by name.
    device : name of the profile.
    distinct : whether patterns were chosen to differ.
    closer_than, close : pairs (name, name, distance) nearer than that, the nearest first. One file is one icon, under
        however many names.
    pairs : how many pairs have each distance, from 0.
    failed : name -> what is wrong with it.
    unfinished : names that were not reached; `complete` is then False.
    worked : pieces of work done in this run, none of them done before.
    seconds : taken.
    files : what was written.
    reached : sentences on a tolerance or a budget.
    """

    icons: tuple[Icon, ...]
    device: str
    distinct: bool
    closer_than: int
    close: tuple[tuple[str, str, int], ...]
    pairs: tuple[int, ...]
    failed: Mapping[str, str]
    unfinished: tuple[str, ...]
    complete: bool
    worked: int
    seconds: float
    files: tuple[str, ...] = ()
    reached: tuple[str, ...] = ()

    @classmethod
    def of(cls, icons: Sequence[Icon], *, closer_than: int, failed: Mapping[str, str], **known: Any) -> IconsReport:
        """The report with the distances of every pair worked out."""
        if not icons:
            return cls((), closer_than=closer_than, close=(), pairs=(), failed=dict(sorted(failed.items())), **known)
        own = [icon for icon in icons if not icon.same_as]
        apart = distinctness(felt_set(own), closer_than)
        near = {
            icon.name: {"nearest": own[index].name, "distance": distance}
            for icon, index, distance in zip(own, apart.nearest.tolist(), apart.distance.tolist(), strict=True)
            if index >= 0
        }
        told = tuple(replace(icon, **near.get(icon.same_as or icon.name, {})) for icon in icons)
        close = tuple((own[one].name, own[other].name, distance) for one, other, distance in apart.close)
        pairs = tuple(np.trim_zeros(apart.pairs, "b").tolist())
        return cls(
            told, closer_than=closer_than, close=close, pairs=pairs, failed=dict(sorted(failed.items())), **known
        )

    @property
    def ok(self) -> bool:
        """Everything was read, encoded and can be made as asked."""
        return self.complete and not self.failed and all(icon.outcome == "ok" for icon in self.icons)

    @property
    def similarity(self) -> float:
        """Mean over the icons; 0 of none."""
        return sum(icon.pattern.similarity for icon in self.icons) / max(1, len(self.icons))

    @property
    def neighbours(self) -> int:
        """Icons with another one nearer than `closer_than`."""
        near = (icon.distance for icon in self.icons if not icon.same_as)
        return sum(distance is not None and distance < self.closer_than for distance in near)

    @property
    def doubted(self) -> int:
        """Icons whose pattern may not be known."""
        return sum(bool(icon.doubt) for icon in self.icons)

    def manifest(self) -> dict[str, Any]:
        """What is written as JSON: the same for the same pictures and options, whoever did the work."""
        return {
            "schema": SCHEMA,
            "device": self.device,
            "complete": self.complete,
            "distinct": self.distinct,
            "similarity": round(self.similarity, 6),
            "closer_than": self.closer_than,
            "with_neighbour": self.neighbours,
            "doubted": self.doubted,
            "pairs_by_distance": list(self.pairs),
            "icons": [icon_row(icon) for icon in self.icons],
            "close": [list(pair) for pair in self.close],
            "failed": [{"name": name, "error": error} for name, error in self.failed.items()],
            "unfinished": list(self.unfinished),
        }

    def as_dict(self) -> dict[str, Any]:
        """The manifest and how the run went, in plain JSON types."""
        run = {"worked": self.worked, "seconds": self.seconds, "files": self.files, "reached": self.reached}
        return {"ok": self.ok} | self.manifest() | run

    def as_text(self) -> str:
        """The report as lines of plain text."""
        return "\n".join(map(one_line, self._lines()))

    def _lines(self) -> Iterator[str]:
        outcomes = Counter(icon.outcome for icon in self.icons)
        yield f"Icons: {len(self.icons)} for {self.device}, " + ", ".join(f"{n} {k}" for k, n in outcomes.items()) + "."
        yield f"Mean similarity: {self.similarity:.3f}."
        yield f"In doubt: {self.doubted}; the manifest says why."
        if self.distinct:
            lost = sum(icon.lost for icon in self.icons) / max(1, len(self.icons))
            yield f"Given up so that icons differ: {lost:.3f} on average."
        yield f"Equal pairs: {self.pairs[0] if self.pairs else 0}."
        yield f"Icons with another one nearer than {self.closer_than} dots: {self.neighbours}."
        for one, other, distance in self.close[:LISTED]:
            yield f"- {one} and {other}: {distance}"
        if len(self.close) > LISTED:
            yield f"- and {len(self.close) - LISTED} more pairs; the manifest lists them"
        if self.failed:
            yield f"Could not be used: {len(self.failed)}."
            yield from (f"- {name}: {error}" for name, error in list(self.failed.items())[:LISTED])
        if len(self.failed) > LISTED:
            yield f"- and {len(self.failed) - LISTED} more; the manifest lists them"
        if self.unfinished:
            yield f"Not reached: {len(self.unfinished)}."
        yield from self.reached
        yield from (f"Written: {name}" for name in self.files)
        rate = self.worked / max(self.seconds, 1e-9)
        yield f"Time taken: {self.seconds:.2f} s, {self.worked} pieces of work, {rate:.0f} a second."


def icon_row(icon: Icon) -> dict[str, Any]:
    """One icon of the manifest: plain JSON types."""
    pattern = ["".join(MARKS[value] for value in row) for row in icon.pattern.amplitude.tolist()]
    return {
        "name": icon.name,
        "digest": icon.digest,
        "kind": icon.kind,
        "pattern": pattern,
        "braille": in_braille(icon.pattern.amplitude),
        "similarity": icon.pattern.similarity,
        "doubt": icon.doubt,
        "lost": icon.lost,
        "outcome": icon.outcome,
        "error": icon.error,
        "nearest": icon.nearest,
        "distance": icon.distance,
        "same_as": icon.same_as,
        "label": icon.label,
        "code_point": icon.code_point,
        "category": icon.category,
        "waveform": icon.waveform,
        "note": "; ".join(part for part in (icon.note, *icon.notes) if part),
    }
