"""Files written aside: nobody can divert them, a kill at any moment leaves old or new, and the dead are cleared up."""

from __future__ import annotations

import errno
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from itertools import cycle
from pathlib import Path
from typing import Any

import pytest

from chainsim import load_device
from drivers import FileError, UnreadableWaveform, atomic_file, atomic_files, read_waveform, settled, write_waveform
from drivers.files.parts import part_of
from encoders import GridShape, TextOptions, TextSource, encode_text
from planner import Plan, plan_scene

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="needs flock and kill")

TOKEN = "0123456789abcdef"


def plan_of(words: str) -> Plan:
    scene = encode_text(TextSource.of_text(words), GridShape(6, 6), TextOptions(dwell_s=0.5))
    return plan_scene(scene, load_device("paper-6x6"))


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir())}


def parts(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir() if part_of(path) is not None)


def test_names_cannot_be_guessed(tmp_path: Path) -> None:
    seen = set()
    for _ in range(20):
        with atomic_file(tmp_path / "x"):
            (name,) = parts(tmp_path)
            assert re.fullmatch(r"\.x\.dotwave-[0-9a-f]{16}\.part", name)
            seen.add(name)
    assert len(seen) == 20


def test_a_planted_link_is_not_followed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    victim = tmp_path / "victim"
    victim.write_bytes(b"precious")
    (tmp_path / f".x.{os.getpid()}.part").symlink_to(victim)
    with atomic_file(tmp_path / "x") as file:
        file.write(b"1")
    # Even a name that was guessed does not help.
    monkeypatch.setattr("drivers.files.whole.secrets.token_hex", lambda _: TOKEN)
    (tmp_path / f".x.dotwave-{TOKEN}.part").symlink_to(victim)
    with pytest.raises(FileError, match="x: there is a file"), atomic_file(tmp_path / "x"):
        raise AssertionError("opened")
    assert victim.read_bytes() == b"precious"
    assert (tmp_path / "x").read_bytes() == b"1"


def test_a_part_that_is_exchanged_in_mid_write_is_not_put_in_place(tmp_path: Path) -> None:
    victim = tmp_path / "victim"
    victim.write_bytes(b"precious")

    def exchange() -> None:
        (name,) = parts(tmp_path)
        (tmp_path / name).unlink()
        (tmp_path / name).symlink_to(victim)

    with pytest.raises(FileError, match="x: another program took away"), atomic_file(tmp_path / "x"):
        exchange()
    assert contents(tmp_path) == {"victim": b"precious"}


@pytest.mark.parametrize("umask", [0o022, 0o027, 0o077])
def test_permissions_are_those_of_any_new_file(tmp_path: Path, umask: int) -> None:
    before = os.umask(umask)
    try:
        with atomic_file(tmp_path / "x"):
            pass
        (tmp_path / "plain").open("wb").close()
    finally:
        os.umask(before)
    assert (tmp_path / "x").stat().st_mode == (tmp_path / "plain").stat().st_mode


def test_a_device_is_not_replaced(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(FileError, match="pipe: this is a device or a pipe"), atomic_file(tmp_path / "pipe"):
        raise AssertionError("opened")
    assert (tmp_path / "pipe").is_fifo()


# What others left


def test_parts_of_dead_writers_are_cleared_and_nothing_else(tmp_path: Path) -> None:
    (tmp_path / "folder").mkdir()
    kept = {".x.part": b"1", ".x.4711.part": b"2", f"x.dotwave-{TOKEN}.part": b"3", ".x.dotwave-0123.part": b"4"}
    for name, data in kept.items():
        (tmp_path / name).write_bytes(data)
    (tmp_path / f".dir.dotwave-{TOKEN}.part").mkdir()
    (tmp_path / f".link.dotwave-{TOKEN}.part").symlink_to(tmp_path / ".x.part")
    os.link(tmp_path / ".x.part", tmp_path / f".hard.dotwave-{TOKEN}.part")
    os.mkfifo(tmp_path / f".pipe.dotwave-{TOKEN}.part")
    left = {path.name for path in tmp_path.iterdir()}
    for number in range(24):
        (tmp_path / f".y{number}.dotwave-{number:016x}.part").write_bytes(b"dead")
    with atomic_file(tmp_path / "new"):
        pass
    assert {path.name for path in tmp_path.iterdir()} == left | {"new"}
    assert {name: (tmp_path / name).read_bytes() for name in kept} == kept


HOLDS = """
import sys
from pathlib import Path
from drivers import atomic_file
with atomic_file(Path(sys.argv[1])) as file:
    file.write(b"half")
    file.flush()
    print("open", flush=True)
    sys.stdin.read()
"""


@contextmanager
def holder(path: Path) -> Iterator[subprocess.Popen[str]]:
    """Another process in the middle of writing `path`."""
    process = subprocess.Popen(
        [sys.executable, "-c", HOLDS, path], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert process.stdin
    assert process.stdout
    try:
        assert process.stdout.readline() == "open\n"
        yield process
    finally:
        process.stdin.close()
        process.stdout.close()
        process.wait(30)


def test_the_living_are_left_alone_and_the_dead_are_not(tmp_path: Path) -> None:
    with holder(tmp_path / "theirs") as other:
        for _ in range(2):
            with atomic_file(tmp_path / "mine"):
                pass
            assert len(parts(tmp_path)) == 1
        other.kill()
        other.wait(30)
        assert len(parts(tmp_path)) == 1
        # Nothing in the folder has changed since, so nothing tells this process; the next change does.
        (tmp_path / "change").write_bytes(b"")
        with atomic_file(tmp_path / "mine"):
            pass
    assert sorted(contents(tmp_path)) == ["change", "mine"]
    with holder(tmp_path / "theirs"):
        pass
    assert (tmp_path / "theirs").read_bytes() == b"half"


def test_without_locks_files_are_written_and_those_of_others_left_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object) -> None:
        raise OSError(errno.ENOLCK, "no locks")

    monkeypatch.setattr("fcntl.flock", refuse)
    (tmp_path / f".x.dotwave-{TOKEN}.part").write_bytes(b"whose?")
    with atomic_files(tmp_path / "x", tmp_path / "y") as (x, y):
        x.write(b"1")
        y.write(b"2")
    assert contents(tmp_path) == {f".x.dotwave-{TOKEN}.part": b"whose?", "x": b"1", "y": b"2"}


def test_thousands_of_files_do_not_look_through_the_folder_again_and_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    looks, scandir = [], os.scandir

    def counted(folder: Path) -> Any:
        looks.append(folder)
        return scandir(folder)

    monkeypatch.setattr(os, "scandir", counted)
    for number in range(100):
        with atomic_files(tmp_path / f"{number}.a", tmp_path / f"{number}.b"):
            pass
    assert len(looks) == 1


@pytest.mark.parametrize("other", ["important.txt", "x.txt", "xx.wav"])
def test_a_made_up_write_replaces_no_other_file(tmp_path: Path, other: str) -> None:
    write_waveform(plan_of("a"), tmp_path / "x.wav")
    (tmp_path / other).write_bytes(b"precious")
    (tmp_path / f".{other}.dotwave-{TOKEN}.part").write_bytes(b"evil")
    (tmp_path / f".x.json.dotwave-{TOKEN}.ready").write_bytes(b"evil")
    before = contents(tmp_path)
    read_waveform(tmp_path / "x.wav")
    assert contents(tmp_path) == before
    write_waveform(plan_of("a"), tmp_path / "x.wav")
    assert contents(tmp_path) == before


def test_links_and_pipes_with_the_name_of_a_write_are_passed_over(tmp_path: Path) -> None:
    write_waveform(plan_of("a"), tmp_path / "x.wav")
    (tmp_path / "victim").write_bytes(b"precious")
    (tmp_path / f".x.json.dotwave-{TOKEN}.ready").symlink_to(tmp_path / "victim")
    os.link(tmp_path / "victim", tmp_path / f".x.wav.dotwave-{TOKEN}.ready")
    os.mkfifo(tmp_path / f".x.wav.dotwave-{TOKEN}.part")
    before = sorted(tmp_path.iterdir())
    manifest, reader = read_waveform(tmp_path / "x.wav")
    manifest.check_digest(reader.path)
    assert sorted(tmp_path.iterdir()) == before


def test_a_folder_that_refuses_the_first_name_keeps_the_old_files(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Such as /tmp, where another user's file of that name cannot be replaced."""
    replace = os.replace

    def refuse(source: Path, target: Path) -> None:
        if Path(target).name == "one":
            raise PermissionError(errno.EPERM, "not yours", str(source), None, str(target))
        replace(source, target)

    (tmp_path / "two").write_bytes(b"old")
    monkeypatch.setattr(os, "replace", refuse)
    with pytest.raises(FileError, match="one: no permission"), atomic_files(tmp_path / "one", tmp_path / "two"):
        pass
    assert contents(tmp_path) == {"two": b"old"}


# A kill at every moment

KILLS = """
import os, signal
from pathlib import Path
from chainsim import load_device
from drivers import write_waveform
from encoders import GridShape, TextOptions, TextSource, encode_text
from planner import plan_scene

def kill_at(last):
    calls = 0
    def counted(name):
        real = getattr(os, name)
        def call(*given, **named):
            nonlocal calls
            calls += 1
            if calls == last:
                os.kill(os.getpid(), signal.SIGKILL)
            return real(*given, **named)
        return call
    for name in ("open", "fdopen", "fsync", "replace", "unlink", "lstat"):
        setattr(os, name, counted(name))

def plan_of(words):
    scene = encode_text(TextSource.of_text(words), GridShape(6, 6), TextOptions(dwell_s=0.5))
    return plan_scene(scene, load_device("paper-6x6"))

OLD, NEW = plan_of("a"), plan_of("x")
number, status = 0, -1
while status:
    number += 1
    folder = Path({folder!r}) / str(number)
    folder.mkdir()
    if {before!r}:
        write_waveform(OLD, folder / {before!r})
    if not (child := os.fork()):
        kill_at(number)
        write_waveform(NEW, folder / "x.wav")
        os._exit(0)
    _, status = os.waitpid(child, 0)
    assert status in (0, signal.SIGKILL)
"""


@pytest.mark.parametrize("before", ["", "x.wav", "x.csv"])
def test_whenever_it_is_killed_the_pair_is_the_old_or_the_new(tmp_path: Path, before: str) -> None:
    code = KILLS.format(folder=str(tmp_path), before=before)
    subprocess.run([sys.executable, "-c", code], check=True)
    folders = sorted(tmp_path.iterdir(), key=lambda folder: int(folder.name))
    last = folders.pop()
    assert parts(last) == []
    new = {name: (last / name).read_bytes() for name in ("x.wav", "x.json")}
    old = {name: data for name, data in contents(folders[0]).items() if part_of(Path(name)) is None}
    assert sorted(old) == sorted({before, "x.json"} if before else [])
    halves, found = 0, []
    for folder, path in zip(folders, cycle(["x.wav", "x.json"]), strict=False):
        raw = contents(folder)
        halves += (raw.get("x.wav") == new["x.wav"]) != (raw.get("x.json") == new["x.json"])
        if before or "x.json" in raw or any(name.endswith(".ready") for name in raw):
            # The old pair may have no x.wav.
            with suppress(UnreadableWaveform, FileError):
                read_waveform(folder / path)
            manifest, reader = read_waveform(folder / "x.json")
            manifest.check_digest(reader.path)
        else:
            with pytest.raises(FileError, match="no such file"):
                read_waveform(folder / path)
        found.append(contents(folder))
        assert found[-1] in (old, old | new)
        write_waveform(plan_of("it"), folder / "x.wav")
        assert parts(folder) == []
        manifest, reader = read_waveform(folder / path)
        manifest.check_digest(reader.path)
        assert manifest.frames[0].text == "it"
    assert len(folders) > 20
    assert halves > 0
    # Once new, always new: there is one moment.
    assert found == sorted(found, key=lambda one: one != old)
    assert found[0] == old
    assert found[-1] == old | new


def test_an_interrupt_between_the_names_puts_all_in_place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    replace, calls = os.replace, []

    def interrupted(source: Path, target: Path) -> None:
        calls.append(target)
        if len(calls) == 2:
            raise KeyboardInterrupt
        replace(source, target)

    monkeypatch.setattr(os, "replace", interrupted)
    for name in ("one", "two"):
        (tmp_path / name).write_bytes(b"old")
    with pytest.raises(KeyboardInterrupt), atomic_files(tmp_path / "one", tmp_path / "two") as (one, two):
        assert one.write(b"new") == two.write(b"new")
    assert (tmp_path / "one").read_bytes() == b"old"
    settled(tmp_path / "one", {"one", "two"}.__contains__)
    assert contents(tmp_path) == {"one": b"new", "two": b"new"}


@pytest.mark.parametrize(
    ("left", "data"),
    [
        ({".one.dotwave-{}.part", ".two.dotwave-{}.part"}, b"old"),
        ({".one.dotwave-{}.part", ".two.dotwave-{}.ready"}, b"new"),
    ],
)
@pytest.mark.parametrize("at", [1, 2])
def test_settling_may_be_cut_off_too(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, left: set[str], data: bytes, at: int
) -> None:
    calls = []

    def cut_off(name: str) -> None:
        real = getattr(os, name)

        def call(*given: object) -> None:
            calls.append(name)
            if len(calls) == at:
                raise KeyboardInterrupt
            real(*given)

        monkeypatch.setattr(os, name, call)

    for name in ("one", "two"):
        (tmp_path / name).write_bytes(b"old")
    for name in left:
        (tmp_path / name.format(TOKEN)).write_bytes(b"new")
    cut_off("replace")
    cut_off("unlink")
    with pytest.raises(KeyboardInterrupt):
        settled(tmp_path / "two", {"one", "two"}.__contains__)
    settled(tmp_path / "two", {"one", "two"}.__contains__)
    assert contents(tmp_path) == {"one": data, "two": data}
