"""What the command line does with what it should not be given: one line, exit code 2, nothing left behind."""

import os
import resource
import subprocess
import sys
import time
from pathlib import Path

import pytest


def run(
    folder: Path, *arguments: str, stdin: bytes = b"", limit: int | None = None
) -> subprocess.CompletedProcess[bytes]:
    def small_files() -> None:
        if limit is not None:
            resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))

    return subprocess.run(
        [sys.executable, "-m", "dotwave", *arguments],
        cwd=folder,
        input=stdin,
        capture_output=True,
        timeout=600,
        check=False,
        preexec_fn=small_files,
        env=os.environ | {"DOTWAVE_CACHE": str(folder / "cache"), "PYTHONPATH": str(Path(__file__).parents[3])},
    )


def left(folder: Path) -> set[str]:
    """What is in the folder besides what the test put there; .part files count."""
    return {path.name for path in folder.iterdir()} - {"cache", "given.txt", "given.brf"}


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (b"", "empty"),
        (b" \n\t ", "empty"),
        (b"ab\0c", "byte 2"),
        (b"ab\xff\xfec", "byte 2"),
        (b"%PDF-1.7 \n", "PDF"),
        (b"PK\x03\x04" + bytes(40), "zip"),
        (b"\x89PNG\r\n\x1a\n" + bytes(20), "PNG"),
    ],
)
def test_files_that_are_not_text(tmp_path, content, says):
    (tmp_path / "given.txt").write_bytes(content)
    done = run(tmp_path, "text", "given.txt", "-o", "out.wav")
    assert done.returncode == 2
    message = done.stderr.decode()
    assert message.count("\n") == 1
    assert says in message
    assert left(tmp_path) == set()


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["Hello", "--table", "nosuch.ctb"], "nearest"),
        (["Hello", "--table", "language:xx"], "language:xx"),
        (["Hello", "--device", "nosuch"], "not a built-in profile"),
        (["Hello", "--device", "linked-6x6", "--dwell", "0.2"], "--dwell"),
        (["Hello", "--dwell", "-1"], "dwell"),
        (["Hello", "-o", "given.txt/out.wav"], "given.txt is not a folder"),
        (["Hello", "-o", "out.mp3"], ".wav"),
        (["no/such/file.txt"], "no such file"),
        (["漢", "--undefined", "error"], "U+6F22"),
        (["Hello", "--table", "en-us-comp8-ext.utb"], "--dots 6"),
    ],
)
def test_options_that_cannot_be_used(tmp_path, arguments, says):
    (tmp_path / "given.txt").write_text("Hello", "utf-8")
    output = [] if "-o" in arguments else ["-o", "out.wav"]
    done = run(tmp_path, "text", *arguments, *output)
    assert done.returncode == 2, done.stderr
    message = done.stderr.decode()
    assert message.count("\n") == 1
    assert says in message
    assert left(tmp_path) == set()


def test_a_full_disk_is_one_line_and_leaves_nothing(tmp_path):
    done = run(tmp_path, "text", "Hello world", "-o", "out.wav", limit=100_000)
    assert done.returncode == 2
    assert done.stderr.decode().count("\n") == 1
    assert left(tmp_path) == set()


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_a_read_only_folder(tmp_path):
    folder = tmp_path / "locked"
    folder.mkdir(mode=0o555)
    done = run(tmp_path, "text", "Hello", "-o", "locked/out.wav")
    assert done.returncode == 2
    assert "locked" in done.stderr.decode()


def test_a_line_of_a_megabyte_without_a_space(tmp_path):
    (tmp_path / "given.txt").write_text("a" * 100_000 + "\n", "utf-8")
    done = run(tmp_path, "text", "given.txt", "--json")
    assert done.returncode == 0
    assert b'"ok": true' in done.stdout


def test_ten_thousand_emoji(tmp_path):
    (tmp_path / "given.txt").write_text("😀" * 10_000, "utf-8")
    done = run(tmp_path, "text", "given.txt")
    assert done.returncode == 0
    assert "grinning face" in done.stdout.decode()


def test_right_to_left_text_with_marks_comes_from_a_pipe(tmp_path):
    done = run(tmp_path, "text", "-", "--table", "ar-ar-g1.utb", "-o", "out.wav", stdin="السَّلامُ عَلَيْكُم".encode())
    assert done.returncode == 0, done.stderr
    assert left(tmp_path) == {"out.wav", "out.json"}


def test_killed_in_mid_write_an_older_pair_stays(tmp_path):
    (tmp_path / "given.txt").write_text("word " * 4000, "utf-8")
    assert run(tmp_path, "text", "old", "-o", "out.wav").returncode == 0
    before = {name: (tmp_path / name).read_bytes() for name in ("out.wav", "out.json")}
    process = subprocess.Popen(
        [sys.executable, "-m", "dotwave", "text", "given.txt", "-o", "out.wav"],
        cwd=tmp_path,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        env=os.environ | {"DOTWAVE_CACHE": str(tmp_path / "cache"), "PYTHONPATH": str(Path(__file__).parents[3])},
    )
    until = time.monotonic() + 300
    while not any(path.suffix == ".part" and path.stat().st_size > 10**6 for path in tmp_path.iterdir()):
        assert process.poll() is None
        assert time.monotonic() < until
    process.terminate()
    assert process.wait(300) == 143
    assert {name: (tmp_path / name).read_bytes() for name in before} == before
    assert left(tmp_path) == set(before)
