"""Processes that work for this one: each piece of work is limited in time, and none outlives this process."""

from __future__ import annotations

import ctypes
import multiprocessing
import os
import pickle
import queue
import signal
import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from typing import Any

from .errors import AppError

__all__ = ["Failed", "Gone", "Made", "Ready", "Worker", "end_with_parent"]

# Times the limit of processor time that a piece may take by the clock: a busy machine is no reason to end it.
PATIENCE = 10
PR_SET_PDEATHSIG = 1
MOST_MARKS = 1 << 16


@dataclass(frozen=True)
class Ready:
    """A worker has begun."""


@dataclass(frozen=True)
class Made:
    """What came of all pieces of a batch."""

    results: tuple[Any, ...]


@dataclass(frozen=True)
class Failed:
    """The piece after those with `results` raised an error; `begun` pieces were begun, those after it not."""

    results: tuple[Any, ...]
    begun: int
    problem: str


@dataclass(frozen=True)
class Gone:
    """The process ended at piece `at` of a batch; `limited` when it was ended for taking too long."""

    at: int
    problem: str
    limited: bool


Answer = Ready | Made | Failed | Gone


def end_with_parent() -> None:
    """Make this process, which `multiprocessing` started, end as soon as the one that started it does, however.

    On Linux the kernel sees to it, even while C code holds the interpreter; it takes the end of the thread that
    started this process for the end. Elsewhere, and when it is too late for that, a thread does.
    """
    parent = multiprocessing.parent_process()
    if parent is None:
        return
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
    threading.Thread(target=_end_after, args=(parent.sentinel,), daemon=True).start()


def _end_after(sentinel: int) -> None:
    wait([sentinel])
    os._exit(1)


class Worker:
    """A process that takes batches, one after another, and says which piece it was at when it ends.

    Parameters
    ----------
    seconds : processor time that one piece may take, and a tenth of what it may take by the clock. The kernel ends
        the process then, whatever it is doing.

    Raises
    ------
    AppError
        When no process can be started.
    """

    def __init__(self, seconds: float) -> None:
        context = multiprocessing.get_context("spawn")
        self.pipe, theirs = context.Pipe()
        # A byte for each piece that is begun: cheaper than a message, and there when the process has ended.
        self._begun, marks = context.Pipe(duplex=False)
        self._seconds = seconds
        self._process = context.Process(target=_serve, args=(theirs, marks, seconds), daemon=True)
        try:
            with _quiet_children():
                self._process.start()
        except OSError as error:
            raise AppError(f"no process can be started: {error.strerror or error}; give fewer --workers") from None
        theirs.close()
        marks.close()

    def give(self, work: Callable[[Any, Sequence[Any]], Iterable[Any]], given: object, pieces: Sequence[Any]) -> None:
        """Have ``work(given, pieces)`` done after what was given before; it must give a result for each in turn."""
        # Whether the process still lives is heard on the pipe.
        with suppress(OSError):
            self.pipe.send((work, given, tuple(pieces)))

    def hear(self) -> Answer:
        """The next answer; waits for it."""
        try:
            answer: Answer = self.pipe.recv()
        except (EOFError, OSError):
            return self._gone()
        if isinstance(answer, Made | Failed):
            self._taken(answer.begun if isinstance(answer, Failed) else len(answer.results))
        return answer

    def _taken(self, most: int) -> int:
        """Take up to so many marks; how many there were."""
        count = 0
        while count < most and (marks := os.read(self._begun.fileno(), most - count)):
            count += len(marks)
        return count

    def _gone(self) -> Gone:
        self._process.kill()
        self._process.join()
        at = max(0, self._taken(MOST_MARKS) - 1)
        self.end()
        code = self._process.exitcode
        if code == -signal.SIGPROF:
            return Gone(at, f"it took more than {self._seconds:g} s of processor time", True)
        if code == -signal.SIGALRM:
            return Gone(at, f"it did not end within {PATIENCE * self._seconds:g} s", True)
        return Gone(at, "the process that worked on it ended at once (out of memory?)", False)

    def end(self) -> None:
        """End the process at once."""
        self._process.kill()
        self._process.join()
        self.pipe.close()
        self._begun.close()


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


def _serve(pipe: Connection, marks: Connection, seconds: float) -> None:
    """What a worker does."""
    end_with_parent()
    for number in (signal.SIGPROF, signal.SIGALRM):
        signal.signal(number, signal.SIG_DFL)
    asked: queue.SimpleQueue[bytes | None] = queue.SimpleQueue()
    threading.Thread(target=_listen, args=(pipe, asked), daemon=True).start()
    # When nobody hears any more there is nothing left to do.
    with suppress(OSError):
        pipe.send(Ready())
        while (batch := asked.get()) is not None:
            pipe.send(_answer(batch, marks.fileno(), seconds))


def _listen(pipe: Connection, asked: queue.SimpleQueue[bytes | None]) -> None:
    """Take what is sent at once: two that wait for one another to read would wait for ever."""
    with suppress(EOFError, OSError):
        while True:
            asked.put(pipe.recv_bytes())
    asked.put(None)


def _answer(batch: bytes, marks: int, seconds: float) -> Made | Failed:
    results: list[Any] = []
    begun = 0
    try:
        work, given, pieces = pickle.loads(batch)
        made = _lazily(work, given, pieces)
        for _ in pieces:
            begun += os.write(marks, b".")
            with _limited(seconds):
                results.append(next(made))
    except BaseException as error:
        # The last net of this process: whatever it is, the one that asked is told.
        return Failed(tuple(results), begun, f"{type(error).__name__}: {' '.join(str(error).split())}"[:300])
    return Made(tuple(results))


def _lazily(work: Callable[[Any, Sequence[Any]], Iterable[Any]], given: object, pieces: Sequence[Any]) -> Iterator[Any]:
    yield from work(given, pieces)


@contextmanager
def _limited(seconds: float) -> Iterator[None]:
    """The kernel ends this process when the body takes longer."""
    signal.setitimer(signal.ITIMER_PROF, seconds)
    signal.setitimer(signal.ITIMER_REAL, PATIENCE * seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.setitimer(signal.ITIMER_REAL, 0)
