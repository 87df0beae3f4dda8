"""How runs end: one line for whatever went wrong, the traceback on request, and output that nobody takes."""

from __future__ import annotations

import os
import subprocess
import sys
from importlib import metadata
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture
def failing(dotwave, monkeypatch: pytest.MonkeyPatch):
    """End a command with an error of our choice."""

    def end(error: BaseException):
        def fail(path: Path, icon: str | None) -> None:
            raise error

        fake = ModuleType("dotwave.api.felt")
        vars(fake).update(verify=fail)
        monkeypatch.setitem(sys.modules, "dotwave.api.felt", fake)
        return dotwave("verify", "x.wav")

    return end


def of_numpy() -> MemoryError:
    with pytest.raises(MemoryError) as caught:
        np.empty(1 << 59)
    return caught.value


@pytest.mark.parametrize(
    ("error", "says"),
    [
        (OSError(28, "No space left on device", "deep/x.bin"), "deep/x.bin: the disk is full; free some space"),
        (OSError(36, "File name too long", "y" * 5000), "yyy: File name too long"),
        (PermissionError(13, "Permission denied", b"a/b"), "a/b: no permission in folder a"),
        (OSError(24, "Too many open files"), "could not be read or written: Too many open files"),
        (MemoryError(), "not enough memory; give it less at a time"),
        (of_numpy(), "not enough memory (Unable to allocate 4.00 EiB"),
        (RecursionError("maximum recursion depth exceeded"), "nested too deeply"),
    ],
)
def test_bad_circumstances_are_one_line_and_exit_code_2(failing, error: Exception, says: str) -> None:
    ended = failing(error)
    assert (ended.code, ended.out) == (2, "")
    assert ended.err.startswith("dotwave: ")
    assert ended.err.count("\n") == 1
    assert says in ended.err
    assert len(ended.err) < 400


def test_a_fault_of_the_program_says_how_to_report_it(failing) -> None:
    ended = failing(ZeroDivisionError("division\nby zero \x1b[2J"))
    assert (ended.code, ended.out) == (70, "")
    assert ended.err.count("\n") == 1
    assert "\x1b" not in ended.err
    for part in (metadata.version("dotwave"), "ZeroDivisionError: division by zero", "test_ending.py:", "report"):
        assert part in ended.err
    assert "DOTWAVE_DEBUG=1" in ended.err
    assert "Traceback" not in ended.err


@pytest.mark.parametrize(("error", "code"), [(ZeroDivisionError(), 70), (OSError(28, "full"), 2), (MemoryError(), 2)])
def test_the_traceback_on_request(failing, monkeypatch: pytest.MonkeyPatch, error: Exception, code: int) -> None:
    monkeypatch.setenv("DOTWAVE_DEBUG", "1")
    ended = failing(error)
    assert ended.code == code
    assert "Traceback (most recent call last)" in ended.err
    assert ended.err.splitlines()[-1].startswith("dotwave: ")


def started(*arguments: str, stdout: int) -> subprocess.CompletedProcess[str]:
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-m", "dotwave", *arguments]
    return subprocess.run(command, env=environment, stdout=stdout, stderr=subprocess.PIPE, text=True, check=False)


@pytest.mark.parametrize("arguments", [["tables"], ["devices"], ["schema"], ["--help"]])
def test_a_reader_that_has_gone_is_no_fault(arguments: list[str]) -> None:
    reading, writing = os.pipe()
    os.close(reading)
    try:
        ended = started(*arguments, stdout=writing)
    finally:
        os.close(writing)
    assert (ended.returncode, ended.stderr) == (141, "")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no /dev/full")
@pytest.mark.parametrize("arguments", [["tables"], ["devices"], ["schema"], ["--help"]])
def test_output_that_cannot_be_written_is_one_line(arguments: list[str]) -> None:
    with open("/dev/full", "wb") as full:
        ended = started(*arguments, stdout=full.fileno())
    assert ended.returncode == 2
    assert ended.stderr.count("\n") == 1
    assert "No space left on device" in ended.stderr
    assert arguments == ["--help"] or "standard output" in ended.stderr
