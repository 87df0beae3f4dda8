"""The plan cache: computed once ever, never in the way, never another device's plan."""

from __future__ import annotations

import json
import logging
import os
import pickletools
import sqlite3
import subprocess
import sys
from collections.abc import Iterator
from contextlib import closing
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from chainsim import Device, load_device
from encoders import Frame, GridShape, Scene, TargetPattern
from planner import FramePlan, OperatingPoint, Ramp, plan_scene
from planner.amplitudes.deflection import Deflection
from planner.amplitudes.vibration import Vibration
from planner.cache import PLANS_VERSION, PlanCache, cache_path
from planner.family import AmplitudeFamily

ROOT = Path(__file__).resolve().parents[2]
PAPER, LINKED = load_device("paper-6x6"), load_device("linked-6x6")
DOTS = np.random.default_rng(4).integers(0, 2, (5, 6, 6)).astype(np.float64)
FRAMES = [Frame(TargetPattern(dots.astype(np.complex128)), 1.0) for dots in DOTS]


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("DOTWAVE_CACHE", str(tmp_path / "kept"))
    return tmp_path / "kept"


@pytest.fixture
def work(monkeypatch: pytest.MonkeyPatch) -> dict[str, int]:
    """How many states and ramps were computed so far."""
    done = {"states": 0, "ramps": 0}

    def counting(kind: type[AmplitudeFamily]) -> None:
        plain_states, plain_ramps = kind.states, kind.ramps

        def states(self: AmplitudeFamily, targets: NDArray[np.float64], *goals: object) -> list[OperatingPoint]:
            done["states"] += len(targets)
            return plain_states(self, targets, *goals)

        def ramps(
            self: AmplitudeFamily, before: list[OperatingPoint], after: list[OperatingPoint], *how: Any
        ) -> list[Ramp | None]:
            done["ramps"] += len(after)
            return plain_ramps(self, before, after, *how)

        monkeypatch.setattr(kind, "states", states)
        monkeypatch.setattr(kind, "ramps", ramps)

    counting(Deflection)
    counting(Vibration)
    return done


def planned(device: Device = PAPER, **options: float) -> list[FramePlan]:
    return list(plan_scene(Scene(GridShape(6, 6), FRAMES), device, **options).frames)


def same(one: Any, other: Any) -> bool:
    """Equal bit for bit, arrays included."""
    if isinstance(one, np.ndarray):
        return bool(one.dtype == other.dtype and np.array_equal(one, other))
    if isinstance(one, tuple):
        return len(one) == len(other) and all(same(a, b) for a, b in zip(one, other, strict=True))
    if isinstance(one, OperatingPoint | Ramp):
        return type(one) is type(other) and all(same(v, vars(other)[k]) for k, v in vars(one).items())
    if isinstance(one, FramePlan):
        return all(same(v, vars(other)[k]) for k, v in vars(one).items())
    return one is other or bool(one == other)


@pytest.mark.parametrize("device", [PAPER, LINKED], ids=["paper", "linked"])
def test_a_second_planner_computes_nothing(device: Device, work: dict[str, int]) -> None:
    first = planned(device)
    assert work["states"] > 0
    assert work["ramps"] > 0
    before = dict(work)
    second = planned(device)
    assert work == before
    assert all(same(one, other) for one, other in zip(first, second, strict=True))


def test_everything_is_planned_once_within_a_run(work: dict[str, int]) -> None:
    rows = {row.tobytes() for row in DOTS.reshape(-1, 6)} | {bytes(48)}
    chains = [[bytes(48)] * 6, *([row.tobytes() for row in dots] for dots in DOTS), [bytes(48)] * 6]
    steps = {pair for one, other in pairwise(chains) for pair in zip(one, other, strict=True)}
    planned()
    assert work == {"states": len(rows), "ramps": sum(one != other for one, other in steps)}


OTHERS: dict[str, dict[str, Any]] = {
    "beta": {"beta": -0.9},
    "full_scale": {"full_scale": 0.12},
    "f0_hz": {"f0_hz": 140.0},
    "delta": {"delta": 6e-3},
    "volts": {"amplifier": PAPER.amplifier.model_copy(update={"volts": 99.0})},
    "coupling": {
        "coupling": PAPER.coupling.model_copy(update={"lam": PAPER.coupling.lam.model_copy(update={"min": 1e-3})})
    },
}


@pytest.mark.parametrize("field", OTHERS)
def test_another_device_does_not_hit(field: str, work: dict[str, int]) -> None:
    planned()
    before = dict(work)
    planned(PAPER.model_copy(update=OTHERS[field]))
    assert work["states"] == 2 * before["states"]
    assert work["ramps"] == 2 * before["ramps"]


def test_another_contrast_does_not_hit(work: dict[str, int], monkeypatch: pytest.MonkeyPatch) -> None:
    """Even for rows without an unraised dot, whose targets are the same."""
    monkeypatch.setattr(sys.modules[__name__], "FRAMES", [Frame(TargetPattern(np.ones((6, 6), dtype=complex)), 1.0)])
    planned(LINKED)
    assert work == {"states": 2, "ramps": 2}
    planned(LINKED, contrast_db=15.0)
    assert work == {"states": 4, "ramps": 4}


def test_another_name_does_hit(work: dict[str, int]) -> None:
    planned()
    before = dict(work)
    planned(PAPER.model_copy(update={"name": "copy", "description": "the same", "notes": {}}))
    assert work == before


def test_another_version_does_not_hit(work: dict[str, int], monkeypatch: pytest.MonkeyPatch) -> None:
    planned()
    before = dict(work)
    monkeypatch.setattr("planner.cache.PLANS_VERSION", PLANS_VERSION + 1)
    planned()
    assert work["states"] == 2 * before["states"]


def warnings_of(caplog: pytest.LogCaptureFixture) -> list[str]:
    return [record.getMessage() for record in caplog.records if record.levelno >= logging.WARNING]


def check_planning_goes_on(reference: list[FramePlan], caplog: pytest.LogCaptureFixture) -> None:
    caplog.clear()
    found = planned()
    assert all(same(one, other) for one, other in zip(reference, found, strict=True))
    (warning,) = warnings_of(caplog)
    assert "plan cache" in warning
    assert str(cache_path()) in warning


@pytest.mark.parametrize(
    "damage", ["noise", "cut", "no_column", "value", "value_cut", "value_other", "value_list", "value_text"]
)
def test_a_damaged_file_is_no_obstacle(damage: str, caplog: pytest.LogCaptureFixture) -> None:
    reference = planned()
    path = cache_path()
    assert not warnings_of(caplog)
    if damage == "noise":
        path.write_bytes(np.random.default_rng(0).bytes(20_000))
    elif damage == "cut":
        path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    else:
        statement = {
            "no_column": "ALTER TABLE plans RENAME COLUMN value TO other",
            "value": "UPDATE plans SET value = x'00ff00ff'",
            "value_cut": "UPDATE plans SET value = substr(value, 1, length(value) - 40)",
            "value_other": 'UPDATE plans SET value = CAST(\'{"type": "Ramp", "colour": 1}\' || char(10) AS BLOB)',
            "value_list": "UPDATE plans SET value = CAST('[1]' || char(10) AS BLOB)",
            "value_text": "UPDATE plans SET value = 'words'",
        }[damage]
        with closing(sqlite3.connect(path)) as connection:
            connection.execute(statement)
            connection.commit()
    check_planning_goes_on(reference, caplog)


@pytest.mark.parametrize("place", ["a_file", "below_a_file", "proc", "folder_in_place_of_the_file"])
def test_an_unusable_folder_is_no_obstacle(
    place: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    reference = planned()
    (tmp_path / "file").write_text("not a folder")
    (tmp_path / "full" / "plans.sqlite").mkdir(parents=True)
    places = {
        "a_file": tmp_path / "file",
        "below_a_file": tmp_path / "file" / "below",
        "proc": Path("/proc/none"),
        "folder_in_place_of_the_file": tmp_path / "full",
    }
    monkeypatch.setenv("DOTWAVE_CACHE", str(places[place]))
    check_planning_goes_on(reference, caplog)


@pytest.mark.skipif(os.geteuid() == 0, reason="permissions do not bind root")
def test_a_read_only_folder_is_no_obstacle(folder: Path, caplog: pytest.LogCaptureFixture) -> None:
    kept_before = planned(LINKED)
    cache_path().chmod(0o400)
    folder.chmod(0o500)
    try:
        assert all(same(one, other) for one, other in zip(kept_before, planned(LINKED), strict=True))
        assert not warnings_of(caplog)
        check_planning_goes_on(planned(), caplog)
    finally:
        folder.chmod(0o700)


def test_a_cache_that_stops_taking_is_no_obstacle(work: dict[str, int], caplog: pytest.LogCaptureFixture) -> None:
    """A database that reads but does not write (a full disk, a read-only mount)."""
    planned(LINKED)
    with closing(sqlite3.connect(cache_path())) as connection:
        connection.execute("CREATE TRIGGER full BEFORE INSERT ON plans BEGIN SELECT RAISE(ABORT, 'disk is full'); END")
        connection.commit()
    caplog.clear()
    first = planned()
    (warning,) = warnings_of(caplog)
    assert "disk is full" in warning
    before = dict(work)
    assert all(same(one, other) for one, other in zip(first, planned(), strict=True))
    assert work["states"] > before["states"]


PROCESS = """
import sys, numpy as np
from chainsim import load_device
from encoders import Frame, GridShape, Scene, TargetPattern
from planner import cache, plan_scene
# Neither gives up on the other, however seldom it gets the processor.
cache.PATIENCE_S = 600.0
dots = np.random.default_rng(int(sys.argv[1])).integers(0, 2, (40, 6, 6)).astype(complex)
scene = Scene(GridShape(6, 6), [Frame(TargetPattern(d), 1.0) for d in dots])
print(sum(len(f.states) for f in plan_scene(scene, load_device("linked-6x6")).frames))
"""


@pytest.mark.slow
def test_two_processes_at_once() -> None:
    command = [sys.executable, "-W", "error", "-c", PROCESS]
    both = [
        subprocess.Popen([*command, seed], cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        for seed in ("1", "1")
    ]
    for process in both:
        out, err = process.communicate(timeout=600)
        assert (process.returncode, out, err) == (0, "246\n", "")
    with closing(sqlite3.connect(cache_path())) as connection:
        assert connection.execute("PRAGMA integrity_check").fetchone() == ("ok",)


def kept() -> Iterator[bytes]:
    with closing(sqlite3.connect(cache_path())) as connection:
        yield from (value for (value,) in connection.execute("SELECT value FROM plans"))


@pytest.mark.parametrize("device", [PAPER, LINKED], ids=["paper", "linked"])
def test_what_is_kept_is_plain(device: Device) -> None:
    """A line of JSON, then arrays of numbers: nothing that loading could execute."""
    planned(device)
    values = list(kept())
    assert len(values) > 20
    for value in values:
        head, arrays = value.split(b"\n", 1)
        assert json.loads(head)["type"] in {"OperatingPoint", "Ramp"}
        assert arrays.startswith(b"\x93NUMPY")
        assert b"'|O'" not in arrays
        with pytest.raises(ValueError, match="opcode"):
            list(pickletools.genops(value))


def test_an_object_array_is_refused(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """Somebody else's pickle in the file is not loaded."""
    reference = planned()
    evil = tmp_path / "evil.npy"
    np.save(evil, np.array([Bomb(tmp_path / "exploded")], dtype=object), allow_pickle=True)
    head = b'{"type": "Ramp", "t_s": {"array": 0}}\n'
    with closing(sqlite3.connect(cache_path())) as connection:
        connection.execute("UPDATE plans SET value = ?", (head + evil.read_bytes(),))
        connection.commit()
    check_planning_goes_on(reference, caplog)
    assert not (tmp_path / "exploded").exists()


class Bomb:
    """Touches a file when it is unpickled."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> tuple[object, tuple[object, ...]]:
        return Path.touch, (self.path,)


def test_where_it_is_kept(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    assert cache_path() == tmp_path / "kept" / "plans.sqlite"
    monkeypatch.delenv("DOTWAVE_CACHE")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "xdg"))
    assert cache_path() == tmp_path / "xdg" / "dotwave" / "plans.sqlite"
    monkeypatch.delenv("XDG_CACHE_HOME")
    assert cache_path() == Path.home() / ".cache" / "dotwave" / "plans.sqlite"


def test_found_is_what_was_kept() -> None:
    (state, *_) = Vibration(LINKED, 20.0).states(np.array([[1.0, 0.1, 1.0, 0.1, 0.1, 1.0]]))
    one, other = PlanCache(LINKED, 20.0), PlanCache(LINKED, 20.0)
    ramp = Ramp(t_s=np.array([0.0, 0.1]), lacking='a "word" \u00e9')
    one.keep([(b"a", state), (b"b", ramp)])
    found = other.find([b"b", b"nothing", b"a"])
    assert found[1] is None
    assert same(found[0], ramp)
    assert same(found[2], state)
    assert not found[2].lam.flags.writeable
