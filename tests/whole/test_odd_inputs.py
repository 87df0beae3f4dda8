"""Inputs that are pipes, devices or without an end: read where that can be, else refused in one line; never waited for
in silence, and never taken into memory without a bound."""

from __future__ import annotations

import json
import logging
import os
import resource
import struct
import threading
import tracemalloc
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

import chainsim.reading
import drivers.waveform.manifest
import encoders.reading
from chainsim import ProfileError, first_bytes
from chainsim.files.sweep_table import read_table
from dotwave.icon_sets.archives import members
from dotwave.icon_sets.journal import Journal
from dotwave.studies.sweep_files import SweepParts
from drivers import FileError, UnreadableWaveform, WaveformError, read_waveform
from drivers.exchange.file import read_exchange
from encoders import PictureError, TextSource, resolve_tables
from encoders.errors import TableMissing
from encoders.picture.reading import read_picture

pytestmark = pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs pipes with names")

HUGE = 1 << 40
CHAIN = """\
chain: {n: 3, delta: 6.0e-3, beta: -1.0}
setting: {epsilon: 1.0e-4, lam: 6.0e-3, omega: 1.0}
rung: linear
tol: 0.1
"""


def huge(path: Path, start: bytes = b"", end: bytes = b"") -> Path:
    """A terabyte that takes no room on the disk."""
    with path.open("wb") as file:
        file.write(start)
        file.seek(HUGE - len(end))
        file.write(end or b"\0")
    return path


@pytest.fixture
def pair(tmp_path: Path, dotwave) -> Path:
    """A written waveform."""
    assert dotwave("text", "a", "-d", "independent-6x6", "-o", tmp_path / "x.wav").code == 0
    return tmp_path / "x.wav"


@pytest.fixture
def late_writer(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[Callable[[str, bytes], Path]]:
    """Makes a pipe that somebody writes to when the log says that it is waited for."""
    started: list[threading.Thread] = []

    class Writer(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            assert isinstance(record.args, tuple)
            (path,) = record.args
            assert isinstance(path, Path)
            started.append(threading.Thread(target=path.write_bytes, args=(waiting.pop(path),)))
            started[-1].start()

    def made(name: str, data: bytes) -> Path:
        path = tmp_path / name
        os.mkfifo(path)
        waiting[path] = data
        return path

    waiting: dict[Path, bytes] = {}
    writer = Writer()
    for module in (chainsim.reading, encoders.reading):
        monkeypatch.setattr(module, "PATIENCE_S", 0.0)
        module.log.addHandler(writer)
    yield made
    for module in (chainsim.reading, encoders.reading):
        module.log.removeHandler(writer)
    for thread in started:
        thread.join()
    assert started
    assert not waiting


def test_a_pipe_is_waited_for_aloud(late_writer, dotwave, caplog: pytest.LogCaptureFixture) -> None:
    ended = dotwave("simulate", late_writer("chain.yaml", CHAIN.encode()))
    assert (ended.code, json.loads(ended.out)["outcome"]) == (0, "ok")
    assert dotwave("calibrate", late_writer("measured.csv", b"row\n"), "-d", "independent-6x6").code == 2
    words = TextSource.of_path(late_writer("words.txt", b"some words"))
    assert words.text == "some words"
    with pytest.raises(PictureError, match="not a picture"):
        read_picture(late_writer("picture.png", b"none"), 40)
    assert [record.message.rpartition("/")[2] for record in caplog.records] == [
        f"{name}: it is a pipe, and nothing has come through it yet"
        for name in ("chain.yaml", "measured.csv", "words.txt", "picture.png")
    ]


def test_a_pipe_that_is_written_to_is_read_in_silence(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(encoders.reading, "PATIENCE_S", 0.0)
    out, into = os.pipe()
    os.write(into, b"some words")
    os.close(into)
    # As a shell gives what <(COMMAND) writes.
    assert TextSource.of_path(Path(f"/dev/fd/{out}")).text == "some words"
    os.close(out)
    assert not caplog.records


@pytest.mark.parametrize("module", [chainsim.reading, encoders.reading])
def test_no_more_than_the_first_bytes_are_taken(module, tmp_path: Path) -> None:
    assert module.first_bytes(huge(tmp_path / "huge", b"ab"), 3) == b"ab\0"
    assert module.first_bytes(Path("/dev/zero"), 3) == b"\0\0\0"
    (tmp_path / "short").write_bytes(b"a")
    assert module.first_bytes(tmp_path / "short", 3) == b"a"
    with pytest.raises(IsADirectoryError):
        first_bytes(tmp_path, 3)


@pytest.mark.parametrize("name", ["x.wav", "x.json"])
@pytest.mark.parametrize("kind", ["pipe", "zeros", "folder"])
def test_a_waveform_is_two_plain_files(name: str, kind: str, pair: Path, dotwave) -> None:
    path = pair.with_name(name)
    path.unlink()
    {"pipe": lambda: os.mkfifo(path), "zeros": lambda: path.symlink_to("/dev/zero"), "folder": path.mkdir}[kind]()
    ended = dotwave("verify", pair)
    why = "this is a folder" if kind == "folder" else "this is a device or a pipe"
    assert (ended.code, ended.err) == (2, f"dotwave: {path}: {why}; give the name of a file\n")


def test_what_is_too_long_is_not_taken_into_memory(pair: Path, dotwave) -> None:
    limit = resource.getrlimit(resource.RLIMIT_AS)
    huge(pair.with_name("x.json"), b"{")
    huge(pair.with_name("x.ahap"), b"{")
    try:
        resource.setrlimit(resource.RLIMIT_AS, (8 << 30, limit[1]))
        ended = dotwave("verify", pair)
        with pytest.raises(UnreadableWaveform, match="more than 500000000 bytes"):
            read_exchange(pair.with_name("x.ahap"))
    finally:
        resource.setrlimit(resource.RLIMIT_AS, limit)
    assert ended.code == 2
    assert (
        ended.err == f"dotwave: {pair.with_name('x.json')}: more than 500000000 bytes; a manifest has at most so many\n"
    )


def test_no_manifest_is_written_that_is_not_read_again(pair: Path, dotwave, monkeypatch: pytest.MonkeyPatch) -> None:
    before = pair.read_bytes()
    monkeypatch.setattr(drivers.waveform.manifest, "REST_BYTES", drivers.waveform.manifest.MOST_BYTES - 1000)
    ended = dotwave("text", "two words, and more", "-d", "independent-6x6", "-o", pair)
    assert ended.code == 2
    assert "give less at a time" in ended.err
    assert pair.read_bytes() == before
    assert read_waveform(pair)
    assert issubclass(WaveformError, ValueError)


def test_a_csv_is_taken_line_by_line_of_sensible_length(pair: Path, dotwave) -> None:
    path = pair.with_name("y.csv")
    assert dotwave("text", "a", "-d", "independent-6x6", "-o", path).code == 0
    lines = path.read_bytes().splitlines(keepends=True)
    lines[7] = b" " * 100_000 + lines[7]
    path.write_bytes(b"".join(lines))
    _, reader = read_waveform(path)
    with pytest.raises(UnreadableWaveform, match=r"y\.csv:8: expected 37 columns"):
        next(reader.blocks(100))


def zip_end(directory: int) -> bytes:
    """The end of an archive whose directory has so many bytes."""
    whole = struct.pack("<4sQHHIIQQQQ", b"PK\6\6", 44, 45, 45, 0, 0, 1, 1, directory, HUGE - 98 - directory)
    place = struct.pack("<4sIQI", b"PK\6\7", 0, HUGE - 98, 1)
    return whole + place + struct.pack("<4s4H2IH", b"PK\5\6", 0, 0, 1, 1, 0xFFFFFFFF, 0xFFFFFFFF, 0)


def test_the_directory_of_an_archive_has_a_bound(tmp_path: Path, pair: Path, dotwave) -> None:
    end = zip_end(HUGE // 2)
    assert len(end) == 98
    assert dotwave("text", "a", "-d", "independent-6x6", "-o", pair.with_suffix(".npz")).code == 0
    with pytest.raises(UnreadableWaveform, match="its directory has 549755813888 bytes"):
        read_waveform(huge(pair.with_suffix(".npz"), end=end))
    with pytest.raises(ProfileError, match="its directory has 549755813888 bytes"):
        read_table(huge(tmp_path / "table.npz", end=end))
    ended = dotwave("icons", huge(tmp_path / "icons.zip", end=end), "-o", tmp_path / "out")
    assert (ended.code, "a directory of 549755813888 bytes" in ended.err) == (2, True)


@pytest.mark.parametrize("name", ["table.csv", "table.npz"])
def test_a_table_is_a_plain_file(name: str, tmp_path: Path) -> None:
    os.mkfifo(tmp_path / name)
    with pytest.raises(ProfileError, match=f"{name}: is not a file"):
        read_table(tmp_path / name)


@pytest.mark.parametrize("name", ["set.zip", "set.tar", "set.tar.gz"])
def test_an_archive_is_a_plain_file(name: str, tmp_path: Path) -> None:
    os.mkfifo(tmp_path / name)
    with pytest.raises(OSError, match="is not a file"):
        next(members(tmp_path / name))


def test_an_icon_is_a_plain_file(tmp_path: Path, dotwave) -> None:
    os.mkfifo(tmp_path / "pipe.png")
    ended = dotwave("icons", tmp_path / "pipe.png", "-o", tmp_path / "out")
    assert (ended.code, "pipe.png: cannot be read: is not a file" in ended.out) == (1, True)


def test_a_line_of_a_journal_has_a_bound(tmp_path: Path) -> None:
    path = tmp_path / "journal.jsonl"
    with Journal(path) as journal:
        journal.add({"key": "a", "value": 1})
    with path.open("ab") as file:
        file.truncate(1 << 28)
    tracemalloc.start()
    with Journal(path) as journal:
        assert tracemalloc.get_traced_memory()[1] < 1 << 27
        tracemalloc.stop()
        assert journal.find("a") == {"key": "a", "value": 1}
        journal.add({"key": "b"})
        assert journal.find("b") == {"key": "b"}


@pytest.mark.parametrize("kind", ["pipe", "zeros"])
def test_a_chunk_of_a_sweep_is_a_plain_file(kind: str, tmp_path: Path) -> None:
    parts = SweepParts(tmp_path, range(1))
    os.mkfifo(parts.path(0)) if kind == "pipe" else parts.path(0).symlink_to("/dev/zero")
    assert not parts.done(0)
    with pytest.raises(FileError, match="a device or a pipe"):
        parts.save(0, {})


def test_a_braille_table_is_a_file(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.ctb")
    for name in (str(tmp_path / "pipe.ctb"), "/dev/zero"):
        with pytest.raises(TableMissing, match="a device or a pipe"):
            resolve_tables(f"unicode.dis,{name}")
