"""Several living writers of the same files: what is there belongs together, and is of the last one."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from drivers import atomic_files, settled
from drivers.files.parts import NEW, PartFile, is_at, make, part_of
from tests.support.known import known

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="needs locks on folders")

ROOT = Path(__file__).resolve().parents[2]
NAMES = ("x.wav", "x.json")
# Writes its own word into both files whenever it is told to. After every new name the other one gets its turn.
WRITER = """
import os, sys
from pathlib import Path
from drivers import atomic_files
folder, word = Path(sys.argv[1]), sys.argv[2].encode()
renamed = os.replace
def replace(*names):
    renamed(*names)
    for _ in range(200):
        os.sched_yield()
os.replace = replace
for line in sys.stdin:
    with atomic_files(folder / "x.wav", folder / "x.json") as files:
        for file in files:
            file.write(word + line.encode())
    print("done", flush=True)
"""
# Dies when it has given `argv[2]` new names.
DYING = """
import os, sys
from pathlib import Path
from drivers import atomic_files
renamed, left = os.replace, [int(sys.argv[2])]
def replace(*names):
    renamed(*names)
    left[0] -= 1
    if not left[0]:
        os._exit(9)
os.replace = replace
with atomic_files(Path(sys.argv[1]) / "x.wav", Path(sys.argv[1]) / "x.json") as files:
    for file in files:
        file.write(b"of the dead")
"""


def words(folder: Path) -> set[bytes]:
    return {(folder / name).read_bytes() for name in NAMES}


@pytest.mark.parametrize("rounds", [30, pytest.param(300, marks=pytest.mark.slow)])
def test_two_writers_at_once_leave_the_files_of_one(rounds: int, tmp_path: Path) -> None:
    writers = [
        subprocess.Popen(
            [sys.executable, "-c", WRITER, str(tmp_path), word], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
            env=os.environ | {"PYTHONPATH": str(ROOT)}, text=True,
        )
        for word in ("one", "other")
    ]  # fmt: skip
    seen = set()
    for number in range(rounds):
        for writer in writers:
            known(writer.stdin).write(f" {number}\n")
            known(writer.stdin).flush()
        assert [known(writer.stdout).readline() for writer in writers] == ["done\n"] * 2
        assert len(words(tmp_path)) == 1
        seen |= words(tmp_path)
    for writer in writers:
        writer.communicate()
        assert writer.returncode == 0
    assert len(seen) == rounds
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(NAMES)


@pytest.mark.parametrize("names_given", [1, 2, 3])
def test_one_that_died_in_between_comes_before_who_ends_later(names_given: int, tmp_path: Path) -> None:
    with atomic_files(*(tmp_path / name for name in NAMES)) as files:
        for file in files:
            file.write(b"of the living")
        dead = subprocess.run(
            [sys.executable, "-c", DYING, str(tmp_path), str(names_given)],
            env=os.environ | {"PYTHONPATH": str(ROOT)}, check=False,
        )  # fmt: skip
        assert dead.returncode == 9
    settled(tmp_path / "x.json", NAMES.__contains__)
    assert words(tmp_path) == {b"of the living"}
    assert not [path for path in tmp_path.iterdir() if part_of(path)]


def test_a_part_taken_for_that_of_a_dead_writer_is_not_deleted_later(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Another writer locks a part before its own writer does, and deletes it when that has gone on."""
    import fcntl

    part, opened = PartFile(tmp_path / "x.wav", "0" * 16), os.open
    taken: list[int] = []

    def open_and_take(path: Path, flags: int, *more: int) -> int:
        number = opened(path, flags, *more)
        if flags == NEW and not taken:
            taken.append(opened(path, os.O_RDONLY))
            fcntl.flock(taken[0], fcntl.LOCK_EX)
        return number

    def delete(_: float = 0.0) -> None:
        part.part.unlink()
        os.close(taken.pop())
        taken.append(-1)

    monkeypatch.setattr("drivers.files.parts.os.open", open_and_take)
    monkeypatch.setattr("drivers.files.locks.time.sleep", delete)
    with make(part) as file:
        if taken != [-1]:
            delete()
        assert is_at(part.part, file.fileno())


def test_a_folder_that_somebody_holds_is_written_to_all_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import fcntl

    monkeypatch.setattr("drivers.files.locks.PATIENCE_S", 0.0)
    number = os.open(tmp_path, os.O_RDONLY)
    fcntl.flock(number, fcntl.LOCK_EX)
    with atomic_files(*(tmp_path / name for name in NAMES)) as files:
        for file in files:
            file.write(b"all the same")
    os.close(number)
    assert words(tmp_path) == {b"all the same"}
