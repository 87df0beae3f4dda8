"""`dotwave sweep`: many settings solved in chunks, each kept on disk until all are done, then put into one file."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..errors import AppError
from ..progress import progress
from ..workers import end_with_parent

if TYPE_CHECKING:
    from chainsim import Setting, SettingSweep, SweepResult

    from ..as_built.settings import AsBuiltSettings
    from .sweep_files import Arrays, SweepParts

__all__ = ["FIELDS", "SweepReport", "answers", "run_sweep"]

FIELDS = (
    "epsilon", "lam", "omega", "outcome", "phasor", "phase_step_deg", "third", "mean", "stable", "locked",
    "multipliers", "branch", "answers", "error_estimate",
)  # fmt: skip
"""What is written for every setting: what was asked, then the fields of `dotwave simulate`."""

SCHEMA = "dotwave/sweep/1"
# Units of `chainsim.unit_of` in a chunk: 65,536 settings of a short chain. As built one takes seconds.
UNITS = 16
UNIT_AS_BUILT = 1


@dataclass(frozen=True)
class _Task:
    """What is done for a chunk: how many settings it has, what is kept, what is asked of chains as built."""

    chunk: int
    fields: tuple[str, ...]
    as_built: AsBuiltSettings | None


@dataclass(frozen=True)
class SweepReport:
    """What a sweep did.

    out : the file. settings : how many. counts : settings by outcome. resumed : chunks found done. seconds : wall time.
    """

    out: Path
    settings: int
    counts: dict[str, int]
    resumed: int
    seconds: float

    def as_dict(self) -> dict[str, Any]:
        """Plain JSON types."""
        return {
            "file": str(self.out), "settings": self.settings, "outcomes": self.counts,
            "chunks_resumed": self.resumed, "seconds": self.seconds,
        }  # fmt: skip

    def as_text(self) -> str:
        """A line for the file and one for each outcome."""
        lines = [f"{self.out}: {self.settings} settings in {self.seconds:.2f} s"]
        if self.resumed:
            lines.append(f"  {self.resumed} chunks were already done")
        return "\n".join(lines + [f"  {name}: {count}" for name, count in self.counts.items()])


def run_sweep(
    source: Path,
    out: Path,
    *,
    only: tuple[str, ...] | None = None,
    workers: int = 1,
    units: int = UNITS,
    as_built: AsBuiltSettings | None = None,
    scheduler: str | None = None,
) -> SweepReport:
    """Solve every setting of the sweep file `source` and write `out` (.npz or .csv).

    Chunks that are done lie in the folder ``OUT.parts`` until the end: the same call goes on where it was stopped. One
    that was damaged there is solved again.
    Memory holds one chunk a worker. The file does not depend on `workers`, `units` or `scheduler` in any bit.

    Parameters
    ----------
    only : which of `FIELDS`, and as built of `AS_BUILT_FIELDS`, to write; None: all.
    workers : processes that solve chunks side by side (each uses all cores where it can).
    units : size of a chunk, in `chainsim.unit_of` settings; as built in settings.
    as_built : also ask what chains drawn at random reach.
    scheduler : address of a dask.distributed scheduler whose workers solve the chunks.

    Raises
    ------
    AppError
        When `out` cannot be written or names no known format, the folder of its parts is not this sweep's, chains of
        its kind are not drawn, or the scheduler cannot be used.
    chainsim.ChainError
        When the sweep file does not fit.
    """
    from chainsim import read_sweep, unit_of
    from drivers import FileError, atomic_file, made_folder

    from .sweep_files import WRITERS, SweepParts
    from .sweep_parts import claimed, removed

    began = time.perf_counter()
    fields = _fields(only, as_built)
    if out.suffix.lower() not in WRITERS:
        raise AppError(f"{out}: expected a file named {' or '.join(WRITERS)}")
    if workers < 1 or units < 1:
        raise AppError(f"workers, units: expected 1 or more, got {workers}, {units}")
    sweep = read_sweep(source)
    chunk = units * (unit_of(sweep.chain.n) if as_built is None else UNIT_AS_BUILT)
    note = _note(sweep, fields, chunk, as_built)
    stored = SweepParts(out.with_name(out.name + ".parts"), range(0, len(sweep), chunk), note["sweep"])
    try:
        with made_folder(out), claimed(stored.folder, note):
            todo = [first for first in stored.firsts if not stored.done(first)]
            task = _Task(chunk, fields, as_built)
            if scheduler is not None:
                _solve_on_cluster(scheduler, stored, todo, task, sweep)
            else:
                _solve_all(source, stored, todo, task, workers, sweep)
            counts = _counted(stored)
            with atomic_file(out) as file:
                WRITERS[out.suffix.lower()](file, stored, fields, len(sweep))
            removed(stored.folder, stored.firsts)
    except FileError:
        raise
    except OSError as error:
        raise AppError(f"{out}: {error.strerror or error}") from None
    return SweepReport(out, len(sweep), counts, len(stored.firsts) - len(todo), time.perf_counter() - began)


def _fields(only: tuple[str, ...] | None, as_built: AsBuiltSettings | None) -> tuple[str, ...]:
    """Which are written, in order."""
    there: tuple[str, ...] = FIELDS
    if as_built is not None:
        from ..as_built.settings import AS_BUILT_FIELDS

        there += AS_BUILT_FIELDS
    unknown = [name for name in only or () if name not in there]
    if unknown:
        raise AppError(f"{unknown[0]}: no such field; there are {', '.join(there)}")
    return tuple(name for name in there if only is None or name in only)


def _note(sweep: SettingSweep, fields: tuple[str, ...], chunk: int, as_built: AsBuiltSettings | None) -> dict[str, Any]:
    """What tells the parts of this sweep from those of any other."""
    digest = hashlib.sha256(repr((sweep.chain, sweep.tol, sweep.from_rest, sweep.shape)).encode())
    for name, column in [*zip(("epsilon", "lam", "omega"), sweep.columns, strict=True), *sweep.fixed.items()]:
        digest.update(name.encode() + np.ascontiguousarray(column, dtype=np.float64).tobytes())
    if as_built is not None:
        digest.update(repr((as_built.device, as_built.devices, as_built.seed)).encode())
    return {"schema": SCHEMA, "sweep": digest.hexdigest(), "fields": list(fields), "chunk": chunk}


def _solve_all(
    source: Path, stored: SweepParts, todo: list[int], task: _Task, workers: int, sweep: SettingSweep
) -> None:
    with progress("sweep") as update:
        if workers == 1 or len(todo) < 2:
            for done, first in enumerate(todo):
                update(done, len(todo))
                stored.save(first, _solved(sweep, first, task))
            return
        # A fresh interpreter each: a fork of a process with running threads may hang.
        with ProcessPoolExecutor(workers, get_context("spawn"), end_with_parent) as pool:
            jobs = [pool.submit(_solve_in_process, source, stored, first, task) for first in todo]
            for done, job in enumerate(jobs):
                update(done, len(todo))
                job.result()


def _solve_on_cluster(address: str, stored: SweepParts, todo: list[int], task: _Task, sweep: SettingSweep) -> None:
    from ..cluster import RETRIES, connected, one_line_of

    with progress("sweep") as update, connected(address) as (distributed, client):
        sent = client.scatter(sweep, broadcast=True)
        futures = {
            client.submit(_solved, sent, first, task, pure=False, retries=RETRIES): first for first in todo
        }  # fmt: skip
        for done, future in enumerate(distributed.as_completed(list(futures), loop=client.loop)):
            update(done, len(todo))
            if future.status != "finished":
                raise AppError(f"{address}: a worker failed: {one_line_of(future.exception())}")
            stored.save(futures.pop(future), future.result())


def _solve_in_process(source: Path, stored: SweepParts, first: int, task: _Task) -> None:
    from chainsim import read_sweep

    stored.save(first, _solved(read_sweep(source), first, task))


def _solved(sweep: SettingSweep, first: int, task: _Task) -> Arrays:
    return answers(sweep, first, first + task.chunk, task.fields, task.as_built)


def _counted(stored: SweepParts) -> dict[str, int]:
    counts: dict[str, int] = {}
    for outcomes in stored.field("outcome"):
        for name, count in zip(*np.unique(outcomes, return_counts=True), strict=True):
            counts[str(name)] = counts.get(str(name), 0) + int(count)
    return counts


def answers(
    sweep: SettingSweep, first: int, last: int, fields: tuple[str, ...], as_built: AsBuiltSettings | None = None
) -> Arrays:
    """Solve the settings first..last-1; their outcomes and `fields` by name, each with an entry a setting.

    The outcome is there for the report whether or not it is asked for.

    Raises
    ------
    AppError
        As built, when chains of its kind are not drawn.
    """
    from chainsim import sweep as solve_many

    setting = sweep.settings(first, last)
    found = solve_many(sweep.chain, setting, tol=sweep.tol, from_rest=sweep.from_rest)
    open_end = not setting.lam[:, :1].any()
    made: dict[str, Callable[[], NDArray[Any]]] = {
        "epsilon": lambda: setting.epsilon,
        "lam": lambda: setting.lam[:, 1:] if open_end else setting.lam,
        "omega": lambda: setting.omega,
        "phasor": lambda: found.phasor,
        "phase_step_deg": lambda: np.degrees(found.phase_step),
        "third": lambda: found.third,
        "mean": lambda: found.mean,
        "stable": lambda: found.stable,
        "locked": lambda: found.locked,
        "multipliers": lambda: found.multipliers.reshape(len(setting), -1),
        "branch": lambda: found.branch,
        "answers": lambda: found.answers,
        "error_estimate": lambda: found.error_estimate,
    }
    drawn = {} if as_built is None else _drawn(sweep, setting, found, as_built)
    made["outcome"] = lambda: found.outcome_name
    return {name: drawn[name] if name in drawn else made[name]() for name in dict.fromkeys(("outcome", *fields))}


def _drawn(sweep: SettingSweep, setting: Setting, found: SweepResult, as_built: AsBuiltSettings) -> Arrays:
    from ..as_built.settings import OutcomeOfMany

    if np.any(sweep.fixed["preload"]) or np.any(sweep.fixed["bias"]):
        raise AppError("--as-built: expected a drive alone; leave out preload and bias")
    nominal = OutcomeOfMany(found.outcome_name, np.abs(found.phasor))
    return as_built.answers(
        sweep.chain, setting.epsilon, setting.lam, setting.omega, nominal, suddenly=sweep.from_rest
    )  # fmt: skip
