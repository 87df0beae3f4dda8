"""Where batches of work are done: the cores of this machine, or a dask.distributed cluster."""

from __future__ import annotations

import multiprocessing
import os
import signal
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import import_module
from types import TracebackType
from typing import Any

from .errors import AppError
from .icon_work import Recipe, Record, Task, code_digest

__all__ = ["ClusterPool", "LocalPool", "Pool", "Work"]

Work = Callable[[Recipe, Sequence[Task]], list[Record]]

# Batches handed out ahead for each worker.
AHEAD = 3
# Large pictures go in smaller batches, so that few of them are in memory at a time.
BATCH_BYTES = 1 << 20
CONNECT_S = 10.0
RETRIES = 3


@dataclass(frozen=True)
class Ended:
    """A batch that ended: its records, or None and one line on the problem."""

    tasks: tuple[Task, ...]
    records: list[Record] | None
    problem: str = ""


class Pool(ABC):
    """Somewhere to work. A newcomer supplies `_finished`; use it as a context manager.

    `size` is how many batches are worked on at a time.
    """

    size: int

    def run(self, work: Work, recipe: Recipe, tasks: Iterable[Task], batch: int) -> Iterator[list[Record]]:
        """Records of all tasks in batches, in the order in which they are finished.

        Tasks are drawn as workers need them. Where a batch fails its tasks are tried one by one, and what fails
        then gets a record with ``bad`` and ``lost``.
        """
        failed: list[Task] = []
        for ended in self._finished(work, recipe, _batches(tasks, batch)):
            if ended.records is None:
                failed += ended.tasks
            else:
                yield ended.records
        # One at a time, so that a task that ends its worker takes no other with it.
        for task in failed:
            for ended in self._finished(work, recipe, [(task,)]):
                yield ended.records or [{"key": task.key, "bad": ended.problem, "lost": True}]

    @abstractmethod
    def _finished(self, work: Work, recipe: Recipe, batches: Iterable[tuple[Task, ...]]) -> Iterator[Ended]:
        """Batches as they end."""

    def __enter__(self) -> Pool:
        return self

    @abstractmethod
    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Let go of the workers; at once when the body was interrupted."""


def _batches(tasks: Iterable[Task], size: int) -> Iterator[tuple[Task, ...]]:
    batch: list[Task] = []
    for task in tasks:
        batch.append(task)
        if len(batch) == size or sum(len(one.data) for one in batch) > BATCH_BYTES:
            yield tuple(batch)
            batch.clear()
    if batch:
        yield tuple(batch)


class LocalPool(Pool):
    """Processes on this machine, one a core unless told otherwise."""

    def __init__(self, workers: int | None = None) -> None:
        self.size = workers or os.cpu_count() or 1
        self._others = set(multiprocessing.active_children())
        self._pool: ProcessPoolExecutor | None = None

    def _executor(self) -> ProcessPoolExecutor:
        if self._pool is None:
            self._pool = ProcessPoolExecutor(self.size, mp_context=multiprocessing.get_context("spawn"))
        return self._pool

    def _finished(self, work: Work, recipe: Recipe, batches: Iterable[tuple[Task, ...]]) -> Iterator[Ended]:
        running: dict[Future[list[Record]], tuple[Task, ...]] = {}
        source = iter(batches)
        while True:
            while len(running) < AHEAD * self.size and (batch := next(source, None)) is not None:
                running[self._submitted(work, recipe, batch)] = batch
            if not running:
                return
            done, _ = wait(running, return_when=FIRST_COMPLETED)
            for future in done:
                problem = future.exception()
                records = future.result() if problem is None else None
                yield Ended(running.pop(future), records, _line(problem))

    def _submitted(self, work: Work, recipe: Recipe, batch: tuple[Task, ...]) -> Future[list[Record]]:
        with _quiet_children():
            try:
                return self._executor().submit(work, recipe, batch)
            except BrokenProcessPool:
                self._drop()
                return self._executor().submit(work, recipe, batch)

    def _drop(self) -> None:
        if self._pool is not None:
            self._pool.shutdown(wait=False, cancel_futures=True)
        self._pool = None

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is None and self._pool is not None:
            self._pool.shutdown()
            return
        self._drop()
        for child in set(multiprocessing.active_children()) - self._others:
            child.terminate()


@contextmanager
def _quiet_children() -> Iterator[None]:
    """Processes started here leave Ctrl-C to this one, and do linear algebra on one core each."""
    before = os.environ.get("OPENBLAS_NUM_THREADS")
    os.environ["OPENBLAS_NUM_THREADS"] = "1"
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        if before is None:
            del os.environ["OPENBLAS_NUM_THREADS"]
        else:
            os.environ["OPENBLAS_NUM_THREADS"] = before
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)


class ClusterPool(Pool):
    """The workers of a dask.distributed scheduler; work of a lost worker goes to another one.

    Raises
    ------
    AppError
        When dask.distributed is not installed, nobody answers at `address`, or workers have another dotwave.
    """

    def __init__(self, address: str) -> None:
        try:
            self._distributed: Any = import_module("distributed")
        except ImportError:
            raise AppError("--scheduler needs dask.distributed: pip install 'dotwave[cluster]'") from None
        try:
            self._client = self._distributed.Client(address, timeout=CONNECT_S, set_as_default=False)
        except (OSError, ValueError) as error:
            raise AppError(f"{address}: no dask scheduler answers: {_line(error)}; start one, or correct it") from None
        if set(self._client.run(code_digest).values()) - {code_digest()}:
            self._client.close(timeout=1)
            raise AppError(f"{address}: a worker has another version of dotwave; install the same one everywhere")
        self.size = max(1, sum(self._client.nthreads().values()))

    def _finished(self, work: Work, recipe: Recipe, batches: Iterable[tuple[Task, ...]]) -> Iterator[Ended]:
        source = iter(batches)
        running: dict[str, tuple[Task, ...]] = {}
        queue = self._distributed.as_completed([], loop=self._client.loop)

        def submit() -> None:
            batch = next(source, None)
            if batch is not None:
                future = self._client.submit(work, recipe, batch, pure=False, retries=RETRIES)
                running[future.key] = batch
                queue.add(future)

        for _ in range(AHEAD * self.size):
            submit()
        while running:
            future = next(queue)
            submit()
            done = future.status == "finished"
            problem = "" if done else _line(future.exception())
            yield Ended(running.pop(future.key), future.result() if done else None, problem)
            future.release()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._client.close(timeout=1)


def _line(problem: BaseException | None) -> str:
    if isinstance(problem, BrokenProcessPool):
        return "the process that worked on it ended at once (out of memory?)"
    return "" if problem is None else f"{type(problem).__name__}: {' '.join(str(problem).split())}"[:300]
