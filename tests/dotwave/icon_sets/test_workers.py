"""Processes that work on icons: one that hangs, ends or takes all memory is replaced, and none outlives its parent."""

from __future__ import annotations

import json
import multiprocessing
import os
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

import psutil
import pytest

from dotwave.errors import AppError
from dotwave.icon_sets.build import IconOptions, render_icons
from dotwave.icon_sets.pool import LocalPool
from dotwave.icon_sets.work import Record, Task
from dotwave.workers import end_with_parent

SAMPLES = Path(__file__).resolve().parents[3] / "samples" / "icons"
PATIENT_S = 120.0


def spin_in_c() -> None:
    """Never ends, and never lets another thread of its process run."""
    sum(iter(int, 1))


def hard(recipe: object, tasks: Sequence[Task]) -> Iterator[Record]:
    """Does what the key of a task says."""
    for task in tasks:
        if task.key.startswith("spin"):
            spin_in_c()
        elif task.key.startswith("sleep"):
            signal.pause()
        elif task.key.startswith("exit"):
            os._exit(3)
        elif task.key.startswith("kill"):
            os.kill(os.getpid(), signal.SIGKILL)
        elif task.key.startswith("raise"):
            raise ValueError("planted\nhere")
        elif task.key.startswith("grow"):
            soft, most = resource.getrlimit(resource.RLIMIT_AS)
            resource.setrlimit(resource.RLIMIT_AS, (psutil.Process().memory_info().vms + (64 << 20), most))
            try:
                kept = [bytes(1 << 20) for _ in range(1 << 20)]
                assert not kept
            finally:
                resource.setrlimit(resource.RLIMIT_AS, (soft, most))
        yield {"key": task.key, "pid": os.getpid()}


def noted(recipe: Path, tasks: Sequence[Task]) -> Iterator[Record]:
    """Write down what was given together, in order, then do what `hard` does."""
    folder = recipe
    Path(folder, f"{len(list(folder.iterdir()))}-{'+'.join(task.key for task in tasks)}").touch()
    return hard(recipe, tasks)


def done(keys: list[str], batch: int, workers: int = 2, seconds: float = 0.5) -> tuple[dict[str, Record], int]:
    """Records by key, and how often each came."""
    with LocalPool(workers, seconds) as pool:
        records = [one for part in pool.run(hard, None, map(Task, keys), batch) for one in part]
    return {record["key"]: record for record in records}, len(records)


@pytest.mark.parametrize(
    ("planted", "says"),
    [
        ("spin", "took more than 0.5 s of processor time; simplify the picture, or raise --icon-seconds"),
        ("kill", "ended"),
        ("raise", "ValueError: planted here"),
        ("grow", "MemoryError"),
    ],
)
def test_a_task_that_goes_wrong_takes_no_other_with_it(planted: str, says: str) -> None:
    keys = [str(number) for number in range(20)]
    keys[3], keys[19] = (f"{planted}{number}" for number in range(2))
    found, count = done(keys, batch=8)
    assert set(found) == set(keys)
    assert count == len(keys)
    for key, record in found.items():
        assert ("lost" in record) == key.startswith(planted)
        if "lost" in record:
            assert says in record["bad"]
            assert "\n" not in record["bad"]


def test_a_task_that_waits_for_ever_is_ended_by_the_clock() -> None:
    found, count = done(["0", "sleep", "1", "2"], batch=4, workers=1, seconds=0.2)
    assert count == len(found) == 4
    assert "did not end within 2 s" in found["sleep"]["bad"]


def test_the_task_that_ends_its_process_is_known(tmp_path: Path) -> None:
    """Of a batch only the one that ended the process is tried alone; those before it are done once more."""
    keys = ["0", "1", "kill", "2", "3"]
    with LocalPool(1) as pool:
        assert len([one for part in pool.run(noted, tmp_path, map(Task, keys), 5) for one in part]) == 5
    tries = [path.name.split("-")[1].split("+") for path in sorted(tmp_path.iterdir())]
    assert tries == [keys, ["0", "1", "2", "3"], ["kill"]]


def test_many_that_end_their_process_end_no_set() -> None:
    keys = ["0", "kill1", "kill2", "3", "kill4"]
    found, count = done(keys, batch=5)
    assert count == len(keys)
    assert {key for key, record in found.items() if "lost" not in record} == {"0", "3"}


def test_no_process_is_left_when_the_work_is_stopped_halfway() -> None:
    before = set(psutil.Process().children(recursive=True))
    with LocalPool(2) as pool:
        next(pool.run(hard, None, map(Task, ["0", "sleep", "1", "2"]), 1))
    left = {one for one in psutil.Process().children(recursive=True) if "resource_tracker" not in str(one.cmdline())}
    assert left <= before


def test_a_pool_goes_on_after_work_that_was_given_up() -> None:
    with LocalPool(1) as pool:
        given_up = pool.run(hard, None, map(Task, "abcdefgh"), 2)
        next(given_up)
        given_up.close()  # type: ignore[attr-defined]
        records = [one for part in pool.run(hard, None, map(Task, "xyz"), 2) for one in part]
    assert [record["key"] for record in records] == ["x", "y", "z"]


def test_processes_that_cannot_begin_are_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("multiprocessing.spawn.get_executable", lambda: b"/bin/false")
    with pytest.raises(AppError, match="ended before it could begin"), LocalPool(2) as pool:
        list(pool.run(hard, None, map(Task, "abc"), 1))
    monkeypatch.setattr("multiprocessing.spawn.get_executable", lambda: b"/nowhere/at/all")
    with pytest.raises(AppError, match="process"), LocalPool(2) as pool:
        list(pool.run(hard, None, map(Task, "abc"), 1))


def announce(recipe: str, tasks: Sequence[Task]) -> Iterator[Record]:
    """Write the number of the process down, then do what `hard` does."""
    Path(recipe, f"{os.getpid()}").touch()
    return hard(recipe, tasks)


ORPHANS = """
import sys
from dotwave.icon_sets.pool import LocalPool
from dotwave.icon_sets.work import Task
from tests.dotwave.icon_sets.test_workers import announce
if __name__ == "__main__":
    with LocalPool(2, 1e6) as pool:
        list(pool.run(announce, sys.argv[1], [Task(sys.argv[2]), Task(sys.argv[2])], 1))
"""


def numbers(folder: Path, count: int, parent: subprocess.Popen[bytes]) -> list[psutil.Process]:
    """The processes that wrote their numbers down."""
    until = time.monotonic() + PATIENT_S
    while len(found := list(folder.iterdir())) < count:
        assert parent.poll() is None
        assert time.monotonic() < until
        time.sleep(0.01)
    return [psutil.Process(int(path.name)) for path in found]


@pytest.mark.parametrize("what", ["spin", "sleep"])
def test_no_worker_outlives_a_parent_that_is_killed(tmp_path: Path, what: str) -> None:
    script, folder = tmp_path / "orphans.py", tmp_path / "numbers"
    script.write_text(ORPHANS, encoding="utf-8")
    folder.mkdir()
    root = Path(__file__).resolve().parents[3]
    with subprocess.Popen([sys.executable, script, folder, what], env=os.environ | {"PYTHONPATH": str(root)}) as parent:
        workers = numbers(folder, 2, parent)
        parent.kill()
    _, alive = psutil.wait_procs(workers, PATIENT_S)
    for one in alive:
        one.kill()
    assert not alive


def late(place: str) -> None:
    """A process whose parent has ended before it could ask to end with it."""
    Path(place, f"{os.getpid()}").touch()
    while psutil.pid_exists(int(Path(place, "..", "parent").read_text())):
        time.sleep(0.01)
    end_with_parent()
    signal.pause()


LATE = """
import multiprocessing, os, sys
from pathlib import Path
from tests.dotwave.icon_sets.test_workers import late
if __name__ == "__main__":
    Path(sys.argv[1], "..", "parent").write_text(str(os.getpid()))
    multiprocessing.get_context("spawn").Process(target=late, args=(sys.argv[1],)).start()
"""


def test_a_parent_that_ended_early_is_noticed(tmp_path: Path) -> None:
    script, folder = tmp_path / "late.py", tmp_path / "numbers"
    script.write_text(LATE, encoding="utf-8")
    folder.mkdir()
    root = Path(__file__).resolve().parents[3]
    with subprocess.Popen([sys.executable, script, folder], env=os.environ | {"PYTHONPATH": str(root)}) as parent:
        workers = numbers(folder, 1, parent)
        parent.kill()
    _, alive = psutil.wait_procs(workers, PATIENT_S)
    for one in alive:
        one.kill()
    assert not alive


def test_the_process_that_nobody_started_goes_on() -> None:
    assert multiprocessing.parent_process() is None
    end_with_parent()


def heavy(count: int) -> str:
    """A drawing that passes all limits and takes long: circles over the whole of it."""
    circle = '<circle cx="50" cy="50" r="40" stroke="#000" stroke-width="9"/>'
    return f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 100 100">{circle * count}</svg>'


@pytest.mark.slow
def test_an_icon_that_takes_too_long_is_reported_and_tried_again(tmp_path: Path) -> None:
    folder, out = tmp_path / "set", tmp_path / "out"
    folder.mkdir()
    (folder / "heavy.svg").write_text(heavy(15_000), encoding="utf-8")
    for name in ("heart.svg", "play.svg", "sun.svg"):
        (folder / name).write_bytes((SAMPLES / name).read_bytes())
    options = IconOptions(workers=1, icon_seconds=3.0)
    report = render_icons([str(folder)], out, options)
    assert [icon.name for icon in report.icons] == ["heart.svg", "play.svg", "sun.svg"]
    assert list(report.failed) == ["heavy.svg"]
    assert "took more than 3 s of processor time" in report.failed["heavy.svg"]
    keys = [json.loads(line)["key"] for line in (out / "journal.jsonl").read_bytes().splitlines() if line]
    assert len(keys) == 3
    assert render_icons([str(folder)], out, options).worked == 1
