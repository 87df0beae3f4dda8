"""A command that was started without standard streams does its work, and says into no file what is for a person."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from drivers import read_waveform

ROOT = Path(__file__).resolve().parents[3]

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="needs a shell that closes streams")


def run(folder: Path, command: str) -> subprocess.CompletedProcess[str]:
    line = f"'{sys.executable}' -m dotwave {command}"
    given = os.environ | {"PYTHONPATH": str(ROOT)}
    return subprocess.run(["sh", "-c", line], cwd=folder, env=given, capture_output=True, text=True, check=False)


@pytest.mark.parametrize("closed", ["2>&-", ">&-", ">&- 2>&-", "<&- >&- 2>&-"])
def test_closed_streams(tmp_path: Path, closed: str) -> None:
    ended = run(tmp_path, f"text a -d independent-6x6 --json -o x.wav {closed}")
    assert (ended.returncode, ended.stderr) == (0, "")
    assert ended.stdout == "" if ">&-" in closed.replace("2>&-", "") else json.loads(ended.stdout)["ok"]
    manifest, reader = read_waveform(tmp_path / "x.wav")
    manifest.check_digest(reader.path)


def test_an_error_without_stderr_is_an_exit_code(tmp_path: Path) -> None:
    ended = run(tmp_path, "verify nosuch.wav 2>&-")
    assert (ended.returncode, ended.stdout, ended.stderr) == (2, "", "")
