"""The work of a set of icons, piece by piece; what the journal has is not done again."""

from __future__ import annotations

import errno
import hashlib
import os
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np

from drivers import Encoding, FileError, atomic_files, naming

from .journal import Journal
from .pool import TASK_S, Pool, Work
from .progress import icon_progress
from .report import IconsReport
from .set import Icon, Pattern, best_pattern, chosen_patterns, figure_of
from .sources import IconPlace, read_icons
from .work import Recipe, Task, encode_icons, plan_patterns, write_waves

__all__ = ["CANDIDATES", "IconOptions", "IconRun"]

Record = Mapping[str, Any]

CANDIDATES, MORE_CANDIDATES = 64, 256
BATCH, WAVE_BATCH = 16, 2
# What a file system says when one name cannot be used and others can.
NOT_A_NAME = {errno.EEXIST, errno.EILSEQ, errno.EINVAL, errno.EISDIR, errno.ENAMETOOLONG, errno.ENOTDIR}


@dataclass(frozen=True)
class IconOptions:
    """How a set is rendered.

    Attributes
    ----------
    device : profile name or file.
    distinct : choose patterns that are not alike.
    waveforms : write a .wav for each.
    workers : processes, None for one a core.
    scheduler : address of a dask scheduler to work there instead.
    closer_than : pairs of icons nearer than this are listed.
    dwell_s : length of a waveform's frame.
    tol : largest predicted error of an icon that is ok, full scale; None for any.
    budget_s : seconds for the work on the set; what is not begun then is left for the next run. None for any.
    yes : do not ask before very much.
    icon_seconds : processor time that one icon may take, on this machine.
    pack : a pack of all of them to write, too.
    """

    device: str = "paper-6x6"
    distinct: bool = False
    waveforms: bool = False
    workers: int | None = None
    scheduler: str | None = None
    closer_than: int = 2
    contrast_db: float | None = None
    dwell_s: float = 1.0
    encoding: Encoding = "float32"
    tol: float | None = None
    budget_s: float | None = None
    yes: bool = False
    icon_seconds: float = TASK_S
    pack: Path | None = None


@dataclass
class IconRun:
    """What is known so far of every icon; the records themselves are in the journal."""

    recipe: Recipe
    options: IconOptions
    out: Path
    places: Sequence[IconPlace]
    journal: Journal
    keys: dict[str, str] = field(default_factory=dict)
    digests: dict[str, str] = field(default_factory=dict)
    failed: dict[str, str] = field(default_factory=dict)
    lost: dict[str, str] = field(default_factory=dict)
    chosen: dict[str, Pattern] = field(default_factory=dict)
    waves: dict[str, str] = field(default_factory=dict)
    told: Mapping[str, dict[str, str]] = field(default_factory=dict)
    worked: int = 0
    clock: Callable[[], float] = time.monotonic
    began: float = field(init=False)
    stopped: bool = False

    def __post_init__(self) -> None:
        self.began = self.clock()

    def _late(self) -> bool:
        """Whether no time is left; work was then left undone."""
        if self.options.budget_s is not None and self.clock() - self.began > self.options.budget_s:
            self.stopped = True
        return self.stopped

    def work(self, pool: Pool) -> None:
        """Do what is not in the journal yet."""
        self._encode(pool, self.recipe, self.places, self.keys)
        if self.options.distinct:
            alone = {name: key for name, key in self.keys.items() if name not in self._same()}
            self.chosen = chosen_patterns(
                self._records(alone), self.recipe.shape, lambda names: self._more(pool, names)
            )
            self.chosen |= {name: self.chosen[other] for name, other in self._same().items() if other in self.chosen}
            self._plan(pool)
        if self.options.waveforms:
            self._write(pool)

    def _same(self) -> dict[str, str]:
        """Icons whose file is that of another, and the first of those: one file is one icon."""
        first: dict[str, str] = {}
        found = {}
        for name in sorted(self.keys):
            other = first.setdefault(self.digests[name], name)
            if other != name:
                found[name] = other
        return found

    def _records(self, keys: Mapping[str, str]) -> dict[str, Record]:
        """Records of the icons that were encoded."""
        found = {name: self.journal.find(key) for name, key in keys.items()}
        return {name: record for name, record in found.items() if record is not None and "bad" not in record}

    def _encode(self, pool: Pool, recipe: Recipe, places: Sequence[IconPlace], keys: dict[str, str]) -> None:
        def tasks() -> Iterator[Task]:
            for file in read_icons(places):
                if file.error:
                    self.failed[file.name] = file.error
                    continue
                self.digests[file.name] = "sha256:" + hashlib.sha256(file.data).hexdigest()
                keys[file.name] = recipe.key("icon", file.data)
                yield Task(keys[file.name], file.data)

        for records in self._do(pool, encode_icons, recipe, tasks(), "encoding", len(places), BATCH):
            self.journal.add(*records)
        for name, key in list(keys.items()):
            if key not in self.journal and key not in self.lost:
                del keys[name]
                continue
            record = self.journal.find(key) or {"bad": self.lost[key]}
            if "bad" in record:
                self.failed[name] = record["bad"]

    def _more(self, pool: Pool, names: Sequence[str]) -> dict[str, Record]:
        wanted, keys = set(names), dict[str, str]()
        recipe = replace(self.recipe, options=replace(self.recipe.options, candidates=MORE_CANDIDATES))
        self._encode(pool, recipe, [place for place in self.places if place.name in wanted], keys)
        return self._records(keys)

    def _plan(self, pool: Pool) -> None:
        tasks = [self._pattern_task("plan", name) for name in sorted(self.chosen) if not self._is_best(name)]
        for records in self._do(pool, plan_patterns, self.recipe, tasks, "planning", len(tasks), BATCH):
            self.journal.add(*records)

    def _write(self, pool: Pool) -> None:
        """One waveform at a time is put in place, then noted: a name is noted with what was made of it last."""
        tasks, names = [], {}
        for icon in self.icons():
            task = self._pattern_task("wave", icon.name)
            names[task.key] = icon.name
            if icon.outcome != "ok":
                continue
            noted = self.journal.find(f"wave:{icon.name}")
            if noted and noted["made"] == task.key and os.path.isfile(self._wave(icon.name)):
                self.waves[icon.name] = noted["file"]
            else:
                tasks.append(task)
        for records in self._do(pool, write_waves, self.recipe, tasks, "writing", len(tasks), WAVE_BATCH):
            for record in records:
                self._put_wave(names[record["key"]], record)
        for key, problem in self.lost.items():
            if key in names:
                self.failed[names[key]] = problem

    def _wave(self, name: str) -> Path:
        return self.out / "waveforms" / f"{name}.wav"

    def _put_wave(self, name: str, record: Record) -> None:
        if "bad" in record:
            self.failed[name] = record["bad"]
            return
        path, key = self._wave(name), f"wave:{name}"
        if key in self.journal:
            # Should this be the last that is done, the old files are not taken for what the journal said they are.
            self.journal.add({"key": key, "made": "", "file": ""})
        try:
            _put_pair(path, record["wav"], record["json"])
        except FileError as error:
            if error.errno not in NOT_A_NAME:
                raise
            self.failed[name] = str(error)
            return
        self.waves[name] = path.relative_to(self.out).as_posix()
        self.journal.add({"key": key, "made": record["key"], "file": self.waves[name]})

    def _do(
        self, pool: Pool, work: Work[Recipe], recipe: Recipe, tasks: Iterable[Task], label: str, total: int, batch: int
    ) -> Iterator[list[dict[str, Any]]]:
        """Records of the tasks that are not in the journal yet; of lost ones only the problem is kept."""
        with icon_progress(label, total) as step:
            seen: set[str] = set()

            def missing() -> Iterator[Task]:
                for task in tasks:
                    if self._late():
                        return
                    if task.key in seen or task.key in self.journal:
                        step(False)
                    else:
                        seen.add(task.key)
                        yield task

            for records in pool.run(work, recipe, missing(), batch):
                self.worked += len(records)
                for record in records:
                    step(True)
                    if "lost" in record:
                        self.lost[record["key"]] = record["bad"]
                yield [record for record in records if "lost" not in record]

    def _pattern_task(self, kind: str, name: str) -> Task:
        amplitude = self._pattern(name).amplitude
        rows = tuple(tuple(row) for row in amplitude.tolist())
        item = f"{name if kind == 'wave' else ''} {rows}".encode()
        return Task(self.recipe.key(kind, item), amplitude=rows, name=PurePosixPath(name).name)

    def _pattern(self, name: str) -> Pattern:
        return self.chosen[name] if name in self.chosen else self._best(name)

    def _best(self, name: str) -> Pattern:
        record = self.journal.find(self.keys[name])
        assert record is not None
        return best_pattern(record, self.recipe.shape)

    def _is_best(self, name: str) -> bool:
        return np.array_equal(self._pattern(name).amplitude, self._best(name).amplitude)

    def icons(self) -> Iterator[Icon]:
        """Every icon that was encoded, sorted by name."""
        same = self._same()
        for name in sorted(self.keys):
            record = self.journal.find(self.keys[name])
            if record is not None and "bad" not in record:
                told = self.told.get(name, {})
                yield replace(
                    self._icon(name, record), same_as=same.get(name, ""), label=told.get("label", ""),
                    code_point=told.get("code_point", ""), category=told.get("category", ""),
                )  # fmt: skip

    def _icon(self, name: str, record: Record) -> Icon:
        best = best_pattern(record, self.recipe.shape)
        pattern = self.chosen.get(name, best)
        same = np.array_equal(pattern.amplitude, best.amplitude)
        key = self._pattern_task("plan", name).key
        plan = record["plan"] if same else self.journal.find(key) or {"note": self.lost.get(key, "")}
        notes = list(record["notes"])
        if record["frames"] > 1:
            notes.append(f"the first of its {record['frames']} frames")
        outcome, note, error = plan.get("outcome", "not_planned"), plan.get("note", ""), plan.get("error")
        tol = self.options.tol
        if outcome == "ok" and tol is not None and error is not None and error > tol:
            outcome, note = "unreachable", f"off by {100 * error:.3g} % of full scale, {100 * tol:g} % are allowed."
        return Icon(
            name=name, digest=self.digests[name], kind=record["kind"], pattern=pattern,
            lost=round(best.similarity - pattern.similarity, 6), figure=figure_of(record, self.recipe.shape),
            outcome=outcome, error=error, note=note,
            notes=tuple(notes), doubt=record["doubt"], waveform=self.waves.get(name, ""),
        )  # fmt: skip

    def report(self, *, complete: bool, seconds: float) -> IconsReport:
        """What there is to say now."""
        icons = list(self.icons())
        known = {icon.name for icon in icons} | set(self.failed)
        return IconsReport.of(
            icons,
            device=self.recipe.device.name,
            distinct=self.options.distinct,
            closer_than=self.options.closer_than,
            failed=self.failed,
            unfinished=tuple(place.name for place in self.places if place.name not in known),
            complete=complete and not self.stopped,
            reached=self._reached(icons),
            worked=self.worked,
            seconds=seconds,
        )

    def _reached(self, icons: Sequence[Icon]) -> tuple[str, ...]:
        """Sentences on what was asked for."""
        lines, options = [], self.options
        if options.tol is not None:
            errors = [icon.error for icon in icons if icon.error is not None]
            good = sum(icon.outcome == "ok" for icon in icons)
            worst = f"predicted to at most {max(errors):.1e} of full scale, " if errors else ""
            lines.append(f"Tolerance {options.tol:g}: {worst}{good} of {len(icons)} within it.")
        if options.budget_s is not None:
            left = "; what is left is done by the same call again" if self.stopped else ""
            lines.append(f"Budget {options.budget_s:g} s: {'used up' if self.stopped else 'kept'}{left}.")
        return tuple(lines)


def _put_pair(path: Path, samples: bytes, manifest: bytes) -> None:
    """Put a waveform and its manifest in place, whole or not at all."""
    aim = path, path.with_suffix(".json")
    with atomic_files(*aim) as files:
        for target, file, data in zip(aim, files, (samples, manifest), strict=True):
            with naming(target):
                file.write(data)
