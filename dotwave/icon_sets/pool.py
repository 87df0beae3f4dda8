"""Where batches of work are done: the cores of this machine, or a dask.distributed cluster."""

from __future__ import annotations

import os
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from multiprocessing.connection import Connection, wait
from types import TracebackType
from typing import TypeVar, cast

from ..cluster import RETRIES, connect, one_line_of
from ..errors import AppError
from ..workers import Failed, Gone, Made, Ready, Worker
from .work import Record, Task, all_of_batch

__all__ = ["TASK_S", "ClusterPool", "LocalPool", "Pool", "Work"]

Given = TypeVar("Given")
Work = Callable[[Given, Sequence[Task]], Iterable[Record]]
"""Gives a record for each task, in their order, as it goes; what it is given besides is mostly a recipe."""

# Processor time of a task; icons take milliseconds, the largest that are let through a few seconds.
TASK_S = 20.0
SIMPLER = "simplify the picture, or raise --icon-seconds"
# Batches handed out ahead for each worker.
AHEAD = 3
# Large pictures go in smaller batches, so that few of them are in memory at a time.
BATCH_BYTES = 1 << 20


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

    def run(self, work: Work[Given], recipe: Given, tasks: Iterable[Task], batch: int) -> Iterator[list[Record]]:
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
                yield ended.records or [_lost(task, ended.problem)]

    @abstractmethod
    def _finished(self, work: Work[Given], recipe: Given, batches: Iterable[tuple[Task, ...]]) -> Iterator[Ended]:
        """Batches as they end."""

    def __enter__(self) -> Pool:
        return self

    @abstractmethod
    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Let go of the workers; at once when the body was interrupted."""


def _lost(task: Task, problem: str) -> Record:
    return {"key": task.key, "bad": problem, "lost": True}


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
    """Processes on this machine, one a core unless told otherwise; one that ends or takes too long is replaced.

    Parameters
    ----------
    seconds : processor time that a task may take; one that takes more is not tried again.
    cure : for a task that takes more.

    Raises
    ------
    AppError
        When a process cannot be started, or ends before it could begin.
    """

    def __init__(self, workers: int | None = None, seconds: float = TASK_S, cure: str = SIMPLER) -> None:
        self.size = workers or os.cpu_count() or 1
        self._cure = cure
        self._seconds = seconds
        self._workers: list[_Busy] = []
        self._again: deque[tuple[Task, ...]] = deque()

    def _finished(self, work: Work[Given], recipe: Given, batches: Iterable[tuple[Task, ...]]) -> Iterator[Ended]:
        source = iter(batches)
        try:
            while True:
                while (batch := self._next(source)) is not None:
                    self._free().give(work, recipe, batch)
                heard = {busy.worker.pipe: busy for busy in self._workers if busy.batches}
                if not heard:
                    return
                for pipe in wait(heard):
                    yield from self._heard(heard[cast(Connection, pipe)])
        finally:
            # Stopped halfway: later answers would be taken for those to something else.
            if any(busy.batches for busy in self._workers):
                self._end()

    def _next(self, source: Iterator[tuple[Task, ...]]) -> tuple[Task, ...] | None:
        """A batch, while there are some and a worker has not enough."""
        if len(self._workers) == self.size and all(len(busy.batches) >= AHEAD for busy in self._workers):
            return None
        return self._again.popleft() if self._again else next(source, None)

    def _free(self) -> _Busy:
        """The worker that has least to do; a new one rather than one that has something."""
        least = min(self._workers, key=lambda busy: len(busy.batches), default=None)
        if least is None or (least.batches and len(self._workers) < self.size):
            least = _Busy(Worker(self._seconds))
            self._workers.append(least)
        return least

    def _heard(self, busy: _Busy) -> Iterator[Ended]:
        """Take the next answer of a worker; what it left undone is given out again."""
        answer = busy.worker.hear()
        if isinstance(answer, Ready):
            busy.ready = True
            return
        batch = busy.batches.popleft()
        if isinstance(answer, Made):
            yield Ended(batch, list(answer.results))
            return
        results = answer.results if isinstance(answer, Failed) else ()
        at = answer.at if isinstance(answer, Gone) else len(results)
        if results:
            yield Ended(batch[:at], list(results))
        # What was done and not told by a process that has ended is done again.
        self._again += filter(None, [batch[len(results) : at] + batch[at + 1 :]])
        if isinstance(answer, Gone):
            self._replace(busy)
        if isinstance(answer, Gone) and answer.limited:
            yield Ended(batch[at : at + 1], [_lost(batch[at], f"{answer.problem}; {self._cure}")])
        else:
            yield Ended(batch[at : at + 1], None, answer.problem)

    def _replace(self, busy: _Busy) -> None:
        if not busy.ready:
            raise AppError("a process ended before it could begin to work; is there memory left? try fewer --workers")
        self._workers.remove(busy)
        self._again += busy.batches

    def _end(self) -> None:
        for busy in self._workers:
            busy.worker.end()
        self._workers.clear()
        self._again.clear()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._end()


@dataclass(eq=False)
class _Busy:
    """A worker with the batches it was given and has not answered."""

    worker: Worker
    batches: deque[tuple[Task, ...]] = field(default_factory=deque)
    ready: bool = False

    def give(self, work: Work[Given], recipe: Given, batch: tuple[Task, ...]) -> None:
        self.batches.append(batch)
        self.worker.give(work, recipe, batch)


class ClusterPool(Pool):
    """The workers of a dask.distributed scheduler; work of a lost worker goes to another one.

    Dask cannot stop one task, so there is no limit of time for one: a worker that hangs is given up by the scheduler
    after its ``worker-ttl``, a batch that ends workers after ``allowed-failures``; its tasks are then tried one by one.

    Raises
    ------
    AppError
        When dask.distributed is not installed, nobody answers at `address`, or workers have another dotwave.
    """

    def __init__(self, address: str) -> None:
        self._distributed, self._client = connect(address)
        self.size = max(1, sum(self._client.nthreads().values()))

    def _finished(self, work: Work[Given], recipe: Given, batches: Iterable[tuple[Task, ...]]) -> Iterator[Ended]:
        source = iter(batches)
        running: dict[str, tuple[Task, ...]] = {}
        queue = self._distributed.as_completed([], loop=self._client.loop)

        def submit() -> None:
            batch = next(source, None)
            if batch is not None:
                future = self._client.submit(all_of_batch, work, recipe, batch, pure=False, retries=RETRIES)
                running[future.key] = batch
                queue.add(future)

        for _ in range(AHEAD * self.size):
            submit()
        while running:
            future = next(queue)
            submit()
            done = future.status == "finished"
            problem = "" if done else one_line_of(future.exception())
            yield Ended(running.pop(future.key), future.result() if done else None, problem)
            future.release()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._client.close(timeout=1)
