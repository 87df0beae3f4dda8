"""`dotwave live` and `dotwave replay` as they are typed."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from dotwave.cli.live_doctor import examine_live
from tests.support.bridge_clients import brlapi_client, needs_brlapi

ROOT = Path(__file__).resolve().parents[3]


def dotwave(*words: str, folder: Path, **how) -> subprocess.CompletedProcess[str]:
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    return subprocess.run(
        [sys.executable, "-m", "dotwave", *words], cwd=folder, env=environment, capture_output=True, text=True,
        timeout=120, check=False, **how,
    )  # fmt: skip


def test_a_line_is_felt_recorded_and_felt_again(tmp_path: Path) -> None:
    words = ["live", "--from", "lines", "--device", "paper-6x6", "--idle", "0.2", "--show", "--record", "s.jsonl"]
    ran = dotwave(*words, folder=tmp_path, input="Hello\n")
    # A machine that is too busy lets the buffer run dry, which is exit code 1 and no matter here.
    assert ran.returncode in (0, 1), ran.stderr
    assert "⠠⠓⠑ ⠇⠇⠕; dots 6 125 15 123 123 135; Hello; " in ran.stdout
    assert "a line on standard input is a window" in ran.stderr
    lines = [json.loads(line) for line in (tmp_path / "s.jsonl").read_text().splitlines()]
    assert lines[0]["device"] == "paper-6x6"
    assert {"cells": "⠠⠓⠑⠇⠇⠕", "text": "Hello"}.items() <= lines[1].items()
    assert lines[2]["stands"] == "⠠⠓⠑⠇⠇⠕"
    again = dotwave("replay", "s.jsonl", "--device", "paper-6x6", "--json", "--record", "t.jsonl", folder=tmp_path)
    assert json.loads(again.stdout)["shown"] >= 1, again.stderr
    felt = [json.loads(line).get("stands") for line in (tmp_path / "t.jsonl").read_text().splitlines()]
    assert "⠠⠓⠑⠇⠇⠕" in felt


@pytest.mark.parametrize("command", ["live", "replay"])
def test_only_sinks_that_play_live_are_offered(command: str, tmp_path: Path) -> None:
    shown = dotwave(command, "--help", folder=tmp_path).stdout
    assert "controller:PORT or none." in shown
    assert "audio" not in shown


def test_a_sound_card_is_refused_in_one_line_that_says_what_it_can_do(tmp_path: Path) -> None:
    ran = dotwave("live", "--from", "lines", "--device", "paper-6x6", "--to", "audio:0", folder=tmp_path, input="Hi\n")
    assert ran.returncode == 2
    (line,) = ran.stderr.splitlines()
    assert line.endswith("a sound card plays written files (dotwave play OUT --audio CARD)")


@needs_brlapi
def test_ctrl_c_ends_a_session_that_serves_a_client(tmp_path: Path) -> None:
    line = [sys.executable, "-m", "dotwave", "live", "--device", "paper-6x6", "--show"]
    live = subprocess.Popen(
        line, env=os.environ | {"PYTHONPATH": str(ROOT)}, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
        stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    try:
        assert live.stderr is not None
        told = live.stderr.readline()
        found = re.search(r"127\.0\.0\.1:(\d+)", told)
        assert found, told + live.stderr.read()
        with brlapi_client(host=f"127.0.0.1:{int(found[1]) - 4101}") as client:
            client.ask("enterTtyModeWithPath", [])
            client.ask("writeText", "hello")
            assert live.stdout is not None
            # It stands, so the session has it: read before the client, and what it wrote, goes.
            assert live.stdout.readline().startswith("⠓⠑⠇ ⠇⠕⠀; dots 125 15 123 123 135 0; hello; ")
            live.send_signal(signal.SIGINT)
            out, wrong = live.communicate(timeout=60)
        assert live.returncode in (0, 1), wrong
        assert "1 windows came, 1 stood" in out
    finally:
        live.kill()
        live.communicate()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["live", "--from", "lines", "--link", "x"], "--link belongs to --from baum"),
        (["live", "--from", "baum", "--key-file", "x"], "--key-file belongs to --from brlapi"),
        (["live", "--from", "canute", "--table", "x"], "--table: over canute"),
        (["live", "--record", "x.txt"], "give it that ending"), (["live", "--keys", "none"], "none"),
        (["live", "--key-file", "empty"], "everybody would be let in"), (["live", "--table", "nonsense"], "nonsense"),
        (["replay", "none.jsonl"], "none.jsonl"), (["replay", "empty"], "empty; "),
    ],
)  # fmt: skip
def test_bad_input_is_one_line(words: list[str], said: str, tmp_path: Path) -> None:
    (tmp_path / "empty").write_text("")
    ran = dotwave(*words, folder=tmp_path, stdin=subprocess.DEVNULL)
    assert ran.returncode == 2
    assert said in ran.stderr
    assert len(ran.stderr.splitlines()) == 1
    assert not list(tmp_path.glob("*x*"))


def test_the_doctor_says_what_to_type() -> None:
    health = examine_live("linked-6x6")
    said = health.as_text()
    for word in ("orca --replace", "-b ba -B ba:host=127.0.0.1:0", "-b bm -d serial:", "NVDA", "127.0.0.1:4101"):
        assert word in said
    assert {check["name"] for check in health.as_dict()["checks"]} >= {"BrlAPI's port", "brltty", "orca", "liblouis"}
