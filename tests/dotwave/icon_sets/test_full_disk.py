"""A disk that becomes full under a set of icons: one line, nothing damaged, and the next run goes on."""

from __future__ import annotations

import errno
import json
import os
import resource
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from dotwave.icon_sets.build import IconOptions, render_icons
from dotwave.icon_sets.journal import Journal
from drivers import FileError
from tests.support.everyday import one_in

ROOT = Path(__file__).resolve().parents[3]
SAMPLES = ROOT / "samples" / "icons"
NAMES = ("heart.svg", "play.svg", "sun.svg", "pause.svg")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    made = tmp_path / "set"
    made.mkdir()
    for name in NAMES:
        shutil.copy(SAMPLES / name, made)
    return made


@pytest.fixture
def disk(tmp_path: Path) -> Iterator[Callable[[str], Path]]:
    """A small file system of its own, by size; asked again it gets another size."""
    place = tmp_path / "disk"
    place.mkdir()
    options = ["-t", "tmpfs", "tmpfs", str(place)]

    def mounted(size: str) -> Path:
        more = f"size={size}" + (",remount" if os.path.ismount(place) else "")
        if subprocess.run(["mount", "-o", more, *options], capture_output=True, check=False).returncode:
            pytest.skip("may not mount a file system")
        return place

    yield mounted
    if os.path.ismount(place):
        subprocess.run(["umount", str(place)], check=True)


def records(out: Path) -> list[dict[str, Any]]:
    """All lines of the journal but one that may have been cut short."""
    lines = [line for line in (out / "journal.jsonl").read_bytes().split(b"\n") if line]
    found = []
    for number, line in enumerate(lines):
        try:
            found.append(json.loads(line))
        except ValueError:
            assert number == len(lines) - 1
    return found


def test_a_full_disk_is_one_line_and_the_next_run_goes_on(
    dotwave: Callable[..., Any], folder: Path, disk: Callable[[str], Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    out = disk("5m") / "out"
    call = ("icons", folder, "-o", out, "--waveforms", "--workers", 1)
    # There was room when it was looked at; others fill the disk meanwhile.
    monkeypatch.setattr("shutil.disk_usage", lambda _: SimpleNamespace(free=1e12))
    ended = dotwave(*call)
    assert ended.code == 2
    assert ended.err.count("\n") == 1
    assert "the disk is full; free some space" in ended.err
    written = [path.name for path in (out / "waveforms").iterdir()]
    assert not [name for name in written if name.endswith(".part")]
    kept = records(out)
    assert len({record["key"] for record in kept}) == len(kept)
    waves = sum(record["key"].startswith("wave:") for record in kept)
    assert 0 < waves < len(NAMES)
    disk("80m")
    again = dotwave(*call, "--json")
    assert again.code == 0
    assert json.loads(again.out)["worked"] == len(NAMES) - waves


@pytest.mark.parametrize("room", [0, 16 << 10])
def test_a_disk_that_is_full_from_the_start(
    dotwave: Callable[..., Any], folder: Path, disk: Callable[[str], Path], room: int
) -> None:
    place = disk("128k")
    (place / "stuff").write_bytes(bytes((128 << 10) - room))
    ended = dotwave("icons", folder, "-o", place / "out", "--workers", 1)
    assert ended.code == 2
    assert ended.err.count("\n") == 1
    assert "the disk is full; free some space" in ended.err
    (place / "stuff").unlink()
    disk("8m")
    assert dotwave("icons", folder, "-o", place / "out", "--workers", 1).code == 0


@pytest.mark.parametrize("name", one_in(2, ["nothing", "manifest.csv", "journal.jsonl", "index.html"]))
def test_files_that_may_not_grow(folder: Path, tmp_path: Path, name: str) -> None:
    """One of the files, or none at all, just does not fit."""
    out = tmp_path / "out"
    render_icons([str(folder)], tmp_path / "good", IconOptions(workers=1))
    limit = (tmp_path / "good" / name).stat().st_size - 1 if name != "nothing" else 0

    def small_files() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))

    done = subprocess.run(
        [sys.executable, "-m", "dotwave", "icons", folder, "-o", out, "--workers", "1"],
        capture_output=True, preexec_fn=small_files, check=False, env=os.environ | {"PYTHONPATH": str(ROOT)},
    )  # fmt: skip
    assert done.returncode == 2
    assert done.stderr.decode().count("\n") == 1
    assert "grows past what may be written" in done.stderr.decode()
    kept = len(records(out))
    assert render_icons([str(folder)], out, IconOptions(workers=1)).worked == len(NAMES) - kept


def test_outputs_that_take_nothing(dotwave: Callable[..., Any], folder: Path, tmp_path: Path) -> None:
    ended = dotwave("icons", folder, "-o", "/dev/full")
    assert ended.code == 2
    assert ended.err.count("\n") == 1
    assert "/dev/full: there is a file of this name" in ended.err
    out = tmp_path / "out"
    out.mkdir()
    (out / "journal.jsonl").symlink_to("/dev/full")
    ended = dotwave("icons", folder, "-o", out)
    assert ended.code == 2
    assert ended.err.count("\n") == 1
    assert "journal.jsonl: this is a symbolic link; remove it" in ended.err
    (out / "journal.jsonl").unlink()
    assert dotwave("icons", folder, "-o", out, "--workers", 1).code == 0
    for name in ("manifest.csv", "manifest.json", "contact.png", "index.html"):
        (out / name).unlink()
        (out / name).symlink_to("/dev/full")
        ended = dotwave("icons", folder, "-o", out, "--workers", 1)
        assert (ended.code, ended.err.count("\n")) == (2, 1)
        assert f"{name}: this is a device or a pipe; give the name of a file" in ended.err
        (out / name).unlink()
    assert dotwave("icons", folder, "-o", out, "--workers", 1).code == 0
    assert json.loads((out / "manifest.json").read_text(encoding="utf-8"))["complete"]


def test_a_journal_whose_line_is_cut_short_says_so_and_loses_that_line_only(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    room, plain = 30, os.write

    def filling(file: int, data: Any) -> int:
        nonlocal room
        if not room:
            raise OSError(errno.ENOSPC, "No space left on device")
        part = bytes(data)[:room]
        room -= len(part)
        return plain(file, part)

    path = tmp_path / "j.jsonl"
    with Journal(path) as journal:
        monkeypatch.setattr(os, "write", filling)
        journal.add({"key": "whole"})
        with pytest.raises(FileError, match=r"j\.jsonl: the disk is full") as caught:
            journal.add({"key": "cut short"})
        assert caught.value.errno == errno.ENOSPC
        monkeypatch.undo()
    with Journal(path) as journal:
        assert journal.find("whole") == {"key": "whole"}
        assert journal.find("cut short") is None
        journal.add({"key": "later"})
    with Journal(path) as journal:
        assert "whole" in journal
        assert "later" in journal


def test_a_pipe_is_no_journal(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "j.jsonl")
    with pytest.raises(FileError, match="not a plain file"):
        Journal(tmp_path / "j.jsonl")
