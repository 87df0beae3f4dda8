"""`dotwave studio` as a process: its address, who may come in, and its end."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import urllib.error
import urllib.request
from pathlib import Path

import pytest

pytest.importorskip("starlette", reason="needs the extra studio")
pytest.importorskip("uvicorn", reason="needs the extra studio")

from dotwave.studio import serve

ROOT = Path(__file__).resolve().parents[3]


def test_it_says_its_address_serves_one_browser_and_ends_with_ctrl_c(tmp_path: Path) -> None:
    with subprocess.Popen(
        [sys.executable, "-m", "dotwave", "studio", "--no-browser", "--folder", str(tmp_path / "lessons")],
        cwd=tmp_path, env=os.environ | {"PYTHONPATH": str(ROOT)}, text=True, stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    ) as running:  # fmt: skip
        try:
            look(running)
        finally:
            running.send_signal(signal.SIGINT)
        out, err = running.communicate(timeout=60)
    assert running.returncode == 0, err
    assert "The studio is closed" in out
    # Nothing was made, so nothing was written.
    assert not list(tmp_path.iterdir())


def look(running: subprocess.Popen[str]) -> None:
    """Come in by the address that is printed."""
    assert running.stderr is not None
    first = running.stderr.readline()
    assert first.startswith("Open in a browser (Ctrl-C ends): http://127.0.0.1:")
    address = first.rsplit(" ", 1)[1].strip()
    with pytest.raises(urllib.error.HTTPError, match="403") as refused:
        urllib.request.urlopen(address.partition("?")[0])
    refused.value.close()
    browser = urllib.request.build_opener(urllib.request.HTTPCookieProcessor())
    with browser.open(address) as answer:
        assert b"<h1>dotwave</h1>" in answer.read()
    assert "Open in another browser: " in running.stderr.readline()


def test_what_is_missing_is_named_with_its_cure(dotwave, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(serve, "find_spec", lambda name: None)
    ended = dotwave("studio", "--no-browser")
    assert ended.code == 2
    assert "pip install 'dotwave[studio]'" in ended.err


def test_a_folder_that_is_none_and_a_device_that_is_none_are_refused(dotwave, tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    ended = dotwave("studio", "--no-browser", "--folder", tmp_path / "file")
    assert (ended.code, "is not a folder" in ended.err) == (2, True)
    ended = dotwave("studio", "--no-browser", "--device", "nothing-6x6")
    assert (ended.code, "not a built-in profile" in ended.err) == (2, True)
