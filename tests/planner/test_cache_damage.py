"""Whatever happens to the plan cache's file, a plan is found as it was kept or made again."""

from __future__ import annotations

import logging
import sqlite3
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from chainsim import load_device
from encoders import Frame, GridShape, Scene, TargetPattern
from planner import FramePlan, OperatingPoint, Ramp, plan_scene
from planner.amplitudes.vibration import Vibration
from planner.cache import PlanCache, cache_path
from planner.cache_file import digest_of

PAPER, LINKED = load_device("paper-6x6"), load_device("linked-6x6")
CONTRAST_DB = 20.0
Items = list[tuple[bytes, OperatingPoint | Ramp]]


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("DOTWAVE_CACHE", str(tmp_path / "kept"))
    return tmp_path / "kept"


@pytest.fixture(scope="module")
def items() -> Items:
    strategy = Vibration(LINKED, CONTRAST_DB)
    states = strategy.states(np.array([[1.0, 0.1, 1.0, 0.1, 0.1, 1.0], [0.1] * 6, [1.0] * 6]))
    ramps = strategy.ramps(states[:-1], states[1:])
    found: Items = [(b"state%d" % index, state) for index, state in enumerate(states)]
    return found + [(b"ramp%d" % index, ramp) for index, ramp in enumerate(ramps) if ramp is not None]


def same(one: object, other: object) -> bool:
    """Equal bit for bit, arrays included."""
    if isinstance(one, np.ndarray):
        return isinstance(other, np.ndarray) and one.dtype == other.dtype and np.array_equal(one, other)
    if isinstance(one, tuple):
        return isinstance(other, tuple) and len(one) == len(other) and all(map(same, one, other))
    if isinstance(one, OperatingPoint | Ramp | FramePlan):
        return type(one) is type(other) and all(same(value, vars(other)[name]) for name, value in vars(one).items())
    return one is other or one == other


def warnings_of(caplog: pytest.LogCaptureFixture) -> list[str]:
    return [record.getMessage() for record in caplog.records if record.levelno >= logging.WARNING]


def kept(items: Items) -> bytes:
    """The cache's file with all of them."""
    PlanCache(LINKED, CONTRAST_DB).keep(items)
    assert all(one is not None for one in PlanCache(LINKED, CONTRAST_DB).find([key for key, _ in items]))
    return cache_path().read_bytes()


def change(statement: str, *values: object) -> None:
    with closing(sqlite3.connect(cache_path())) as connection:
        connection.execute(statement, values)
        connection.commit()


def check(damaged: bytes, items: Items, caplog: pytest.LogCaptureFixture) -> int:
    """Nothing else than what was kept is found, what is missing is kept, and then all is there; how many were found."""
    for path in cache_path().parent.iterdir():
        path.unlink()
    cache_path().write_bytes(damaged)
    caplog.clear()
    cache = PlanCache(LINKED, CONTRAST_DB)
    found = cache.find([key for key, _ in items])
    assert all(one is None or same(one, value) for one, (_, value) in zip(found, items, strict=True))
    cache.keep([item for item, one in zip(items, found, strict=True) if one is None])
    lost = PlanCache(LINKED, CONTRAST_DB)
    lost.keep(item for item, one in zip(items, lost.find([key for key, _ in items]), strict=True) if one is None)
    assert same(tuple(PlanCache(LINKED, CONTRAST_DB).find([key for key, _ in items])), tuple(v for _, v in items))
    assert len(warnings_of(caplog)) <= 1
    assert not list(cache_path().parent.glob(".*"))
    return sum(one is not None for one in found)


def flipped(clean: bytes, step: int) -> Iterator[bytes]:
    for bit in range(0, 8 * len(clean), step):
        damaged = bytearray(clean)
        damaged[bit // 8] ^= 1 << bit % 8
        yield bytes(damaged)


def worse(clean: bytes) -> Iterator[bytes]:
    """Scattered bytes, pages of zeros, cuts, things that are no database."""
    chance = np.random.default_rng(3)
    for count in (1, 5, 40, 1000) * 10:
        damaged = np.frombuffer(clean, dtype=np.uint8).copy()
        damaged[chance.integers(0, len(clean), count)] = chance.integers(0, 256, count, dtype=np.uint8)
        yield damaged.tobytes()
    for start in range(0, len(clean), 4096):
        yield clean[:start] + bytes(4096) + clean[start + 4096 :]
        yield clean[:start]
        yield clean[: start + 100]
    yield from (bytes(len(clean)), b"words\n", b"SQLite format 3\0", clean[::-1], clean + clean)


def test_a_flipped_bit_changes_no_plan(items: Items, caplog: pytest.LogCaptureFixture) -> None:
    for damaged in flipped(kept(items), 4999):
        check(damaged, items, caplog)


def test_no_bit_of_the_first_page_changes_a_plan(items: Items, caplog: pytest.LogCaptureFixture) -> None:
    clean = kept(items)
    for damaged in flipped(clean[:200], 23):
        check(damaged + clean[200:], items, caplog)
    for damaged in flipped(clean[3900:4096], 41):
        check(clean[:3900] + damaged + clean[4096:], items, caplog)


def test_worse_damage_changes_no_plan(items: Items, caplog: pytest.LogCaptureFixture) -> None:
    for damaged in worse(kept(items)):
        check(damaged, items, caplog)


@pytest.mark.slow
def test_ten_thousands_of_flipped_bits(items: Items, caplog: pytest.LogCaptureFixture) -> None:
    for damaged in flipped(kept(items), 31):
        check(damaged, items, caplog)


def test_a_bit_flipped_in_every_row_changes_no_frame(caplog: pytest.LogCaptureFixture) -> None:
    """In the numbers, where nothing else than the digest would see it."""

    dots = np.random.default_rng(4).integers(0, 2, (3, 6, 6)).astype(np.complex128)
    frames = [Frame(TargetPattern(each), 1.0) for each in dots]

    def planned() -> list[FramePlan]:
        return list(plan_scene(Scene(GridShape(6, 6), frames), PAPER).frames)

    reference = planned()
    with closing(sqlite3.connect(cache_path())) as connection:
        rows = connection.execute("SELECT key, value FROM plans").fetchall()
        for key, value in rows:
            damaged = bytearray(value)
            damaged[-30] ^= 4
            connection.execute("UPDATE plans SET value = ? WHERE key = ?", (bytes(damaged), key))
        connection.commit()
    found = planned()
    assert all(same(one, other) for one, other in zip(reference, found, strict=True))
    (warning,) = warnings_of(caplog)
    assert str(cache_path()) in warning
    caplog.clear()
    planned()
    assert not warnings_of(caplog)


def test_the_value_of_another_key_is_not_found(items: Items) -> None:
    kept(items)
    with closing(sqlite3.connect(cache_path())) as connection:
        ((value,),) = connection.execute("SELECT value FROM plans LIMIT 1").fetchall()
    change("UPDATE plans SET value = ?", value)
    found = PlanCache(LINKED, CONTRAST_DB).find([key for key, _ in items])
    assert sum(one is not None for one in found) == 1


TABLES = {
    "fewer_columns": "CREATE TABLE plans (key BLOB PRIMARY KEY)",
    "other_types": "CREATE TABLE plans (key TEXT, value INTEGER)",
    "another_table_too": "CREATE TABLE plans (key BLOB PRIMARY KEY, value BLOB); CREATE TABLE other (a)",
}


def test_the_other_rows_of_a_file_with_a_damaged_one_stay(items: Items, caplog: pytest.LogCaptureFixture) -> None:
    kept(items)
    change(
        "UPDATE plans SET value = substr(value, 1, length(value) - 1) || x'00' WHERE key = (SELECT min(key) FROM plans)"
    )
    cache = PlanCache(LINKED, CONTRAST_DB)
    for found in (cache, cache, PlanCache(LINKED, CONTRAST_DB)):
        assert sum(one is None for one in found.find([key for key, _ in items])) == 1
    (warning,) = warnings_of(caplog)
    assert f"{cache_path()}: damaged; made anew with {len(items) - 1} whole plans" in warning


def test_what_another_wrote_with_a_digest_is_not_found(items: Items) -> None:
    kept(items)
    with closing(sqlite3.connect(cache_path())) as connection:
        ((key,), *_) = connection.execute("SELECT key FROM plans").fetchall()
    for value in (
        b"words",
        b"[1]\n",
        b'{"type": "Ramp", "colour": 1}\n',
        b"",
        b'{"type": "Ramp", "t_s": {"array": 0}}\n',
    ):
        change("UPDATE plans SET value = ? WHERE key = ?", value + digest_of(key, value), key)
        found = PlanCache(LINKED, CONTRAST_DB).find([key for key, _ in items])
        assert sum(one is None for one in found) == 1


@pytest.mark.parametrize("statement", TABLES.values(), ids=TABLES)
def test_another_layout_is_moved_aside(
    statement: str, items: Items, folder: Path, caplog: pytest.LogCaptureFixture
) -> None:
    folder.mkdir()
    for ending in (".damaged", ".damaged-2"):
        with closing(sqlite3.connect(cache_path())) as connection:
            connection.executescript(statement)
        before = cache_path().read_bytes()
        kept(items)
        assert (folder / f"plans.sqlite{ending}").read_bytes() == before
        assert all(one is not None for one in PlanCache(LINKED, CONTRAST_DB).find([key for key, _ in items]))
        (warning,) = warnings_of(caplog)
        assert "moved to plans.sqlite" in warning
        caplog.clear()
        cache_path().unlink()


def test_another_programs_database_is_not_touched(items: Items, folder: Path, caplog: pytest.LogCaptureFixture) -> None:
    folder.mkdir()
    with closing(sqlite3.connect(cache_path())) as connection:
        connection.executescript("CREATE TABLE songs (title TEXT); INSERT INTO songs VALUES ('one')")
    before = cache_path().read_bytes()
    PlanCache(LINKED, CONTRAST_DB).keep(items)
    assert cache_path().read_bytes() == before
    (warning,) = warnings_of(caplog)
    assert "another program's database" in warning
    assert [path.name for path in folder.iterdir()] == ["plans.sqlite"]


def test_a_locked_file_is_left_alone(
    items: Items, folder: Path, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = kept(items)
    monkeypatch.setattr("planner.cache.PATIENCE_S", 0.0)
    with closing(sqlite3.connect(cache_path(), isolation_level=None)) as connection:
        connection.execute("BEGIN EXCLUSIVE")
        cache = PlanCache(LINKED, CONTRAST_DB)
        assert cache.find([items[0][0]]) == [None]
        cache.keep(items)
        (warning,) = warnings_of(caplog)
        assert "locked" in warning
    assert cache_path().read_bytes() == before
    assert [path.name for path in folder.iterdir()] == ["plans.sqlite"]


def test_a_file_that_another_process_made_anew_is_not_moved(items: Items, folder: Path) -> None:
    kept(items)
    slow = PlanCache(LINKED, CONTRAST_DB)
    broken = cache_path().with_name("elsewhere")
    cache_path().rename(broken)
    broken.write_bytes(bytes(100) + broken.read_bytes()[100:])
    kept(items)
    assert all(one is None or same(one, items[0][1]) for one in slow.find([items[0][0]]))
    slow.keep(items)
    assert sorted(path.name for path in folder.iterdir()) == ["elsewhere", "plans.sqlite"]


def test_rows_of_older_versions_are_superseded(items: Items, caplog: pytest.LogCaptureFixture) -> None:
    """They have no digest at their end; the table is the same."""
    kept(items)
    change("UPDATE plans SET value = substr(value, 1, length(value) - 16)")
    check(cache_path().read_bytes(), items, caplog)


def test_the_table_of_older_versions_is_superseded(
    items: Items, folder: Path, caplog: pytest.LogCaptureFixture
) -> None:
    folder.mkdir()
    with closing(sqlite3.connect(cache_path())) as connection:
        connection.executescript(
            "CREATE TABLE IF NOT EXISTS plans (key BLOB PRIMARY KEY, value BLOB); "
            "INSERT INTO plans VALUES (x'00', x'00')"
        )
    kept(items)
    assert not warnings_of(caplog)
    assert [path.name for path in folder.iterdir()] == ["plans.sqlite"]
