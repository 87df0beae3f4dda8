"""A folder of texts rendered as one job; what was finished is never done again."""

from __future__ import annotations

import hashlib
import json
import os
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from chainsim import Device
from drivers import FileError, atomic_file, naming
from encoders import TextOptions, text_suffixes

from ..errors import AppError
from ..icon_sets.journal import Journal
from ..icon_sets.pool import ClusterPool, LocalPool, Pool
from ..icon_sets.progress import icon_progress
from ..icon_sets.work import Record, Task
from ..plain import printable
from ..request import Request
from .report import LibraryReport
from .work import LibraryRecipe, render_files

__all__ = ["WorkPlaces", "render_library"]

JOURNAL, MANIFEST = "journal.jsonl", "library.json"
# Processor time that one file may take: a thick book on a device whose chains are long.
FILE_S = 24 * 3600.0


@dataclass(frozen=True)
class WorkPlaces:
    """Where the work on a library is done: `workers` processes here, None for one a core, or a dask `scheduler`."""

    workers: int | None = None
    scheduler: str | None = None

    def pool(self) -> Pool:
        """Begin to work there."""
        if self.scheduler:
            return ClusterPool(self.scheduler)
        return LocalPool(self.workers, FILE_S, cure="give it in parts")


def render_library(
    folder: Path,
    out: Path | None,
    device: Device,
    options: TextOptions,
    request: Request,
    *,
    waveforms: bool,
    places: WorkPlaces,
) -> LibraryReport:
    """Encode and plan every text below `folder` and, with `waveforms`, write each into folder `out`.

    A file that cannot be used is reported and the others go on. A run into the same folder takes over what an earlier
    one finished, however that one ended; on Ctrl-C the manifest says what there is.

    Raises
    ------
    AppError
        When there are no texts or no `out`, the request asks for what one text alone has, `out` has files that dotwave
        did not make, no process can be started, or no scheduler answers.
    DriverError
        When the disk refuses.
    """
    began = time.monotonic()
    if out is None:
        raise AppError(f"{folder}: is a folder; name a text file, or give -o FOLDER to render all texts in it")
    if request != Request(tol=request.tol, contrast_db=request.contrast_db, yield_=request.yield_,
                          encoding=request.encoding, yes=request.yes):  # fmt: skip
        raise AppError(f"{folder}: is a folder; --budget, --explain, --pareto and --actuator belong to one text")
    names = list(_texts(folder, out))
    if not names:
        raise AppError(f"{folder}: no texts or documents in it ({', '.join(text_suffixes())}); name another folder")
    _make_own(out)
    # Nobody is asked in a worker.
    recipe = LibraryRecipe(folder.absolute(), out.absolute(), device, options, replace(request, yes=True), waveforms)
    with Journal(out / JOURNAL) as journal:
        run = _LibraryRun(recipe, names, journal)
        try:
            with places.pool() as pool:
                run.work(pool)
        except (KeyboardInterrupt, SystemExit):
            _write_manifest(run.report(time.monotonic() - began), out / MANIFEST)
            raise
        report = run.report(time.monotonic() - began)
    _write_manifest(report, out / MANIFEST)
    return replace(report, files=(str(out / MANIFEST),))


def _make_own(out: Path) -> None:
    """Make the folder; one that is there without a journal, and not empty, is not one of ours."""
    with naming(out):
        if os.path.lexists(out) and not os.path.lexists(out / JOURNAL) and (not out.is_dir() or any(out.iterdir())):
            raise AppError(f"{out}: is not empty and has no {JOURNAL} of dotwave; give another folder")
        out.mkdir(parents=True, exist_ok=True)


def _texts(folder: Path, out: Path) -> Iterator[str]:
    """Names below the folder of what can be read, sorted; what lies in `out` is not for it."""
    suffixes, own = tuple(text_suffixes()), out.resolve()
    for place, folders, files in os.walk(folder):
        folders[:] = sorted(one for one in folders if (Path(place) / one).resolve() != own)
        for name in sorted(files):
            if name.lower().endswith(suffixes):
                yield (Path(place) / name).relative_to(folder).as_posix()


@dataclass
class _LibraryRun:
    """What is known so far of every file."""

    recipe: LibraryRecipe
    names: Sequence[str]
    journal: Journal
    made: dict[str, str] = field(default_factory=dict)
    failed: dict[str, str] = field(default_factory=dict)
    worked: int = 0

    def work(self, pool: Pool) -> None:
        """Render what is not in the journal yet, one file a batch."""
        with icon_progress("rendering", len(self.names)) as step:

            def missing() -> Iterator[Task]:
                for name in self.names:
                    task = self._task(name)
                    if task is None or self._ready(task):
                        step(False)
                        continue
                    if task.key in self.journal:
                        # Should this be the last that is done, the old files are not taken for what is made now.
                        self.journal.add({"key": task.key, "made": ""})
                    yield task

            for records in pool.run(render_files, self.recipe, missing(), 1):
                for record in records:
                    step(True)
                    self._take(record)

    def _task(self, name: str) -> Task | None:
        path = self.recipe.folder / name
        try:
            with naming(path), path.open("rb") as file:
                digest = hashlib.file_digest(file, "sha256").hexdigest()
        except FileError as error:
            self.failed[name] = str(error)
            return None
        self.made[name] = f"{self.recipe.scope} {digest}"
        return Task(f"text:{name}", name=name)

    def _ready(self, task: Task) -> bool:
        record = self._record(task.name)
        return record is not None and (not record.get("waveform") or self.recipe.wave(task.name).is_file())

    def _record(self, name: str) -> Record | None:
        """What the journal has of a file as it is now."""
        record = self.journal.find(f"text:{name}")
        return record if record is not None and record["made"] == self.made.get(name) else None

    def _take(self, record: Record) -> None:
        name = record["key"].removeprefix("text:")
        if "bad" in record:
            # It is tried again by the next run: what was wrong may be mended.
            self.failed[name] = record["bad"]
            return
        self.worked += 1
        self.journal.add(record | {"made": self.made[name]})

    def report(self, seconds: float) -> LibraryReport:
        """What there is to say now."""
        known = {name: self._record(name) for name in self.names if name not in self.failed}
        return LibraryReport(
            self.recipe.device.name,
            [record for record in known.values() if record is not None],
            dict(sorted(self.failed.items())),
            tuple(name for name, record in known.items() if record is None),
            self.worked,
            seconds,
        )


def _write_manifest(report: LibraryReport, path: Path) -> None:
    text = printable(json.dumps(report.manifest(), ensure_ascii=False, allow_nan=False, indent=1))
    with atomic_file(path) as file, naming(path):
        file.write((text + "\n").encode())
