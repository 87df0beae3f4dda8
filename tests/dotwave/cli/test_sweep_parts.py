"""The folder of a sweep's parts: whose it is, what is removed of it, and pieces that were damaged."""

from __future__ import annotations

import fcntl
import json
import os
import random
import re
import time
import zipfile
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from dotwave.errors import AppError
from dotwave.studies.sweep import run_sweep
from tests.support.sweeps import TEXT

TOKEN = "0123456789abcdef"


@pytest.fixture
def source(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A sweep of seven small chunks."""
    monkeypatch.setattr("chainsim.batch.sweep._UNIT", 48)
    path = tmp_path / "sweep.yaml"
    path.write_text(TEXT)
    return path


def run(source: Path, out: Path) -> int:
    """How many chunks were found done."""
    return run_sweep(source, out, units=1).resumed


@pytest.fixture
def whole(source: Path, tmp_path: Path) -> bytes:
    """The undisturbed result."""
    run(source, tmp_path / "whole.npz")
    return (tmp_path / "whole.npz").read_bytes()


def stopped(source: Path, out: Path, monkeypatch: pytest.MonkeyPatch, chunks: int = 7) -> Path:
    """The parts of a run that was stopped after so many chunks; with all seven, when it was to write the file."""
    import dotwave.studies.sweep as module

    solve, calls = module.answers, []

    def fails(*given: object) -> object:
        calls.append(given)
        if len(calls) > chunks:
            raise KeyboardInterrupt
        return solve(*given)  # type: ignore[arg-type]

    def refuse(_: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(module, "answers", fails)
        patch.setattr(module, "_counted", refuse)
        with pytest.raises(KeyboardInterrupt):
            run(source, out)
    return out.with_name(out.name + ".parts")


def tree(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def empty(parts: Path) -> None:
    parts.mkdir()


def with_files(parts: Path) -> None:
    parts.mkdir()
    (parts / "thesis.txt").write_text("precious")


def with_chunks(parts: Path) -> None:
    parts.mkdir()
    (parts / "000000000000.npz").write_bytes(b"precious")


def noted(note: str) -> Callable[[Path], None]:
    def make(parts: Path) -> None:
        parts.mkdir()
        (parts / "sweep.json").write_text(note)
        (parts / "thesis.txt").write_text("precious")

    return make


def a_file(parts: Path) -> None:
    parts.write_text("precious")


def a_link(parts: Path) -> None:
    with_files(parts.with_name("elsewhere"))
    parts.symlink_to(parts.with_name("elsewhere"))


def a_pipe(parts: Path) -> None:
    parts.mkdir()
    os.mkfifo(parts / "sweep.json")


FOREIGN = [
    empty, with_files, with_chunks, a_file, a_link, a_pipe,
    *map(noted, ["", "{", "[1]", "{}", '{"schema": "mine/1"}', "\0" * 10, "[" * 100_000]),
]  # fmt: skip


@pytest.mark.parametrize("there", FOREIGN)
def test_a_folder_that_dotwave_did_not_make_is_refused_unharmed(
    source: Path, tmp_path: Path, there: Callable[[Path], None]
) -> None:
    parts = tmp_path / "out.npz.parts"
    there(parts)
    before = tree(tmp_path)
    with pytest.raises(AppError, match="not a folder that dotwave sweep made; move it away, or give -o") as caught:
        run(source, tmp_path / "out.npz")
    assert "\n" not in str(caught.value)
    assert os.path.lexists(parts)
    assert tree(tmp_path) == before


@pytest.fixture
def no_waiting(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nobody waits for a folder that is held: a sweep holds its own."""

    def never(_: float) -> None:
        raise AssertionError("waited for a folder that is held")

    monkeypatch.setattr("drivers.files.locks.time", SimpleNamespace(monotonic=time.monotonic, sleep=never))


@pytest.mark.usefixtures("no_waiting")
def test_only_what_dotwave_put_there_is_removed(
    source: Path, whole: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "out.npz"
    parts = stopped(source, out, monkeypatch, 3)
    (parts / "thesis.txt").write_text("precious")
    (parts / "999999999999.npz").write_text("not of this sweep")
    (parts / "folder").mkdir()
    (parts / f".000000000000.npz.dotwave-{TOKEN}.part").write_text("left by a dead run")
    assert run(source, out) == 3
    assert out.read_bytes() == whole
    assert sorted(path.name for path in parts.iterdir()) == ["999999999999.npz", "folder", "thesis.txt"]


@pytest.mark.usefixtures("no_waiting")
def test_nothing_is_left_of_what_dead_runs_left(
    source: Path, whole: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "out.npz"
    parts = stopped(source, out, monkeypatch)
    (parts / f".000000000003.npz.dotwave-{TOKEN}.part").write_text("left by a dead run")
    # Killed while it made the folder, or took it away.
    for number, files in enumerate(([], ["sweep.json"])):
        aside = tmp_path / f".out.npz.parts.dotwave-{number:016x}.part"
        aside.mkdir()
        for name in files:
            (aside / name).write_text("{}")
    other = tmp_path / f".other.npz.parts.dotwave-{TOKEN}.part"
    other.mkdir()
    assert run(source, out) == 7
    assert out.read_bytes() == whole
    assert sorted(path.name for path in tmp_path.iterdir()) == [other.name, "out.npz", "sweep.yaml", "whole.npz"]


# Damage


def cut(path: Path, share: float) -> None:
    raw = path.read_bytes()
    path.write_bytes(raw[: int(share * len(raw))])


def rewritten(path: Path, change: Callable[[dict[str, np.ndarray]], object]) -> None:
    with np.load(path) as stored:
        arrays = dict(stored)
    change(arrays)
    np.savez(path, **arrays)


def longer(arrays: dict[str, np.ndarray]) -> None:
    arrays["phasor"] = np.concatenate([arrays["phasor"]] * 2)


def nudged(arrays: dict[str, np.ndarray]) -> None:
    arrays["phasor"][0, 0] *= 1 + 1e-12


def huge(path: Path) -> None:
    """An array that says it has a million million numbers."""
    with zipfile.ZipFile(path, "w") as archive, archive.open("phasor.npy", "w") as member:
        np.lib.format.write_array_header_1_0(member, {"descr": "<f8", "fortran_order": False, "shape": (10**12,)})


DAMAGE: dict[str, Callable[[Path], object]] = {
    "empty": lambda path: path.write_bytes(b""),
    "cut short": lambda path: cut(path, 0.5),
    "without its last byte": lambda path: path.write_bytes(path.read_bytes()[:-1]),
    "no zip": lambda path: path.write_bytes(b"garbage" * 100),
    "an npy": lambda path: path.write_bytes(b"\x93NUMPY" + bytes(100)),
    "a field is missing": lambda path: rewritten(path, lambda arrays: arrays.pop("phasor")),
    "longer": lambda path: path.write_bytes(path.read_bytes() + b"0"),
    "wrong shape": lambda path: rewritten(path, longer),
    "another value": lambda path: rewritten(path, nudged),
    "huge": huge,
    "gone": lambda path: path.unlink(),
    "another chunk": lambda path: path.write_bytes(path.with_name("000000000003.npz").read_bytes()),
}


@pytest.mark.parametrize("kind", DAMAGE)
def test_a_damaged_piece_is_solved_again(
    source: Path, whole: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: str
) -> None:
    out = tmp_path / "out.npz"
    parts = stopped(source, out, monkeypatch)
    DAMAGE[kind](parts / "000000000006.npz")
    assert run(source, out) == 6
    assert out.read_bytes() == whole
    assert not parts.exists()


def test_any_flipped_bit_is_noticed(
    source: Path, whole: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from dotwave.studies.sweep_files import SweepParts

    out = tmp_path / "out.npz"
    parts = stopped(source, out, monkeypatch)
    sweep = json.loads((parts / "sweep.json").read_text())["sweep"]
    stored, path = SweepParts(parts, range(0, 20, 3), sweep), parts / "000000000000.npz"
    raw = path.read_bytes()
    assert stored.done(0)
    generator, noticed = random.Random(1), 0
    for _ in range(1000):
        place = generator.randrange(8 * len(raw))
        spoiled = bytearray(raw)
        spoiled[place // 8] ^= 1 << place % 8
        path.write_bytes(spoiled)
        noticed += not stored.done(0)
    assert noticed == 1000
    assert run(source, out) == 6
    assert out.read_bytes() == whole


def test_a_piece_that_is_damaged_after_it_was_checked_is_one_line(
    source: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import dotwave.studies.sweep as module

    out, counted = tmp_path / "out.npz", module._counted

    def spoils(stored: object) -> dict[str, int]:
        found = counted(stored)  # type: ignore[arg-type]
        cut(tmp_path / "out.npz.parts" / "000000000006.npz", 0.5)
        return found

    monkeypatch.setattr(module, "_counted", spoils)
    with pytest.raises(AppError, match=r"000000000006\.npz: damaged; the same call again solves it anew"):
        run(source, out)
    monkeypatch.undo()
    monkeypatch.setattr("chainsim.batch.sweep._UNIT", 48)
    assert run(source, out) == 6


# Two at once


def test_a_second_run_at_the_same_time_is_refused_and_spoils_nothing(
    source: Path, whole: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import dotwave.studies.sweep as module

    out, solve = tmp_path / "out.npz", module.answers
    refused: list[None] = []

    def meanwhile(*given: object) -> object:
        if not refused:
            refused.append(None)
            with pytest.raises(AppError, match="another run is at this sweep; wait for it, or give -o another name"):
                run(source, out)
        return solve(*given)  # type: ignore[arg-type]

    monkeypatch.setattr(module, "answers", meanwhile)
    assert run(source, out) == 0
    assert refused
    assert out.read_bytes() == whole
    assert not any(re.search("parts", path.name) for path in tmp_path.iterdir())


def test_without_locks_a_sweep_is_solved_all_the_same(
    source: Path, whole: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object) -> None:
        raise OSError(95, "no locks here")

    monkeypatch.setattr(fcntl, "flock", refuse)
    out = tmp_path / "out.npz"
    parts = stopped(source, out, monkeypatch, 3)
    assert run(source, out) == 3
    assert out.read_bytes() == whole
    assert not parts.exists()
