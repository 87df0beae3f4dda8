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
    from chainsim import SettingSweep

    from .sweep_files import Arrays, SweepParts

__all__ = ["FIELDS", "SweepReport", "answers", "run_sweep"]

FIELDS = (
    "epsilon", "lam", "omega", "outcome", "phasor", "phase_step_deg", "third", "mean", "stable", "locked",
    "multipliers", "branch", "answers", "error_estimate",
)  # fmt: skip
"""What is written for every setting: what was asked, then the fields of `dotwave simulate`."""

SCHEMA = "dotwave/sweep/1"
# Units of `chainsim.unit_of` in a chunk: 65,536 settings of a short chain.
UNITS = 16


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
    source: Path, out: Path, *, only: tuple[str, ...] = FIELDS, workers: int = 1, units: int = UNITS
) -> SweepReport:
    """Solve every setting of the sweep file `source` and write `out` (.npz or .csv).

    Chunks that are done lie in the folder ``OUT.parts`` until the end: the same call goes on where it was stopped. One
    that was damaged there is solved again.
    Memory holds one chunk a worker. The file does not depend on `workers` or `units` in any bit.

    Parameters
    ----------
    only : which of `FIELDS` to write.
    workers : processes that solve chunks side by side (each uses all cores where it can).
    units : size of a chunk, in `chainsim.unit_of` settings.

    Raises
    ------
    AppError
        When `out` cannot be written or names no known format, or the folder of its parts is not this sweep's.
    chainsim.ChainError
        When the sweep file does not fit.
    """
    from chainsim import read_sweep, unit_of
    from drivers import FileError, atomic_file, made_folder

    from .sweep_files import WRITERS, SweepParts
    from .sweep_parts import claimed, removed

    began = time.perf_counter()
    unknown = [name for name in only if name not in FIELDS]
    if unknown:
        raise AppError(f"{unknown[0]}: no such field; there are {', '.join(FIELDS)}")
    if out.suffix.lower() not in WRITERS:
        raise AppError(f"{out}: expected a file named {' or '.join(WRITERS)}")
    if workers < 1 or units < 1:
        raise AppError(f"workers, units: expected 1 or more, got {workers}, {units}")
    sweep = read_sweep(source)
    chunk = units * unit_of(sweep.chain.n)
    fields = tuple(name for name in FIELDS if name in only)
    note = _note(sweep, fields, chunk)
    stored = SweepParts(out.with_name(out.name + ".parts"), range(0, len(sweep), chunk), note["sweep"])
    try:
        with made_folder(out), claimed(stored.folder, note):
            todo = [first for first in stored.firsts if not stored.done(first)]
            _solve_all(source, stored, todo, chunk, fields, workers, sweep)
            counts = _counted(stored)
            with atomic_file(out) as file:
                WRITERS[out.suffix.lower()](file, stored, fields, len(sweep))
            removed(stored.folder, stored.firsts)
    except FileError:
        raise
    except OSError as error:
        raise AppError(f"{out}: {error.strerror or error}") from None
    return SweepReport(out, len(sweep), counts, len(stored.firsts) - len(todo), time.perf_counter() - began)


def _note(sweep: SettingSweep, fields: tuple[str, ...], chunk: int) -> dict[str, Any]:
    """What tells the parts of this sweep from those of any other."""
    digest = hashlib.sha256(repr((sweep.chain, sweep.tol, sweep.from_rest, sweep.shape)).encode())
    for name, column in [*zip(("epsilon", "lam", "omega"), sweep.columns, strict=True), *sweep.fixed.items()]:
        digest.update(name.encode() + np.ascontiguousarray(column, dtype=np.float64).tobytes())
    return {"schema": SCHEMA, "sweep": digest.hexdigest(), "fields": list(fields), "chunk": chunk}


def _solve_all(
    source: Path,
    stored: SweepParts,
    todo: list[int],
    chunk: int,
    fields: tuple[str, ...],
    workers: int,
    sweep: SettingSweep,
) -> None:
    with progress("sweep") as update:
        if workers == 1 or len(todo) < 2:
            for done, first in enumerate(todo):
                update(done, len(todo))
                _solve_part(sweep, stored, first, chunk, fields)
            return
        # A fresh interpreter each: a fork of a process with running threads may hang.
        with ProcessPoolExecutor(workers, get_context("spawn"), end_with_parent) as pool:
            jobs = [pool.submit(_solve_in_process, source, stored, first, chunk, fields) for first in todo]
            for done, job in enumerate(jobs):
                update(done, len(todo))
                job.result()


def _solve_in_process(source: Path, stored: SweepParts, first: int, chunk: int, fields: tuple[str, ...]) -> None:
    from chainsim import read_sweep

    _solve_part(read_sweep(source), stored, first, chunk, fields)


def _solve_part(sweep: SettingSweep, stored: SweepParts, first: int, chunk: int, fields: tuple[str, ...]) -> None:
    solved = answers(sweep, first, first + chunk, fields)
    # The outcome is counted for the report whether or not it is asked for.
    stored.save(first, solved)


def _counted(stored: SweepParts) -> dict[str, int]:
    counts: dict[str, int] = {}
    for outcomes in stored.field("outcome"):
        for name, count in zip(*np.unique(outcomes, return_counts=True), strict=True):
            counts[str(name)] = counts.get(str(name), 0) + int(count)
    return counts


def answers(sweep: SettingSweep, first: int, last: int, fields: tuple[str, ...]) -> Arrays:
    """Solve the settings first..last-1; their outcomes and `fields` by name, each with an entry a setting."""
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
    return {"outcome": found.outcome_name} | {name: made[name]() for name in fields if name != "outcome"}
