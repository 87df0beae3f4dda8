"""Help in groups, what a shell is offered for half a word, and what was probably meant by a wrong one."""

from __future__ import annotations

import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import typer.main

from chainsim import device_names
from dotwave.cli.app import application
from dotwave.cli.completion import completed_devices, completed_files
from dotwave.cli.help import GROUPS

ROOT = Path(__file__).resolve().parents[3]
COMMANDS = typer.main.get_group(application()).commands


def test_every_command_stands_in_one_group_of_the_help(dotwave) -> None:
    shown = dotwave("--help").out
    assert shown.isascii()
    assert "Commands:" not in shown
    listed = []
    for group in GROUPS:
        section = re.search(rf"^{group}:\n((?:  .*\n)+)", shown, flags=re.MULTILINE)
        assert section is not None, group
        listed += re.findall(r"^  ([a-z]+)  ", section[1], flags=re.MULTILINE)
    assert sorted(listed) == sorted(COMMANDS)
    lines = {line.split()[0]: line for line in shown.splitlines() if line.startswith("  ")}
    for name, command in COMMANDS.items():
        assert lines[name].endswith(command.short_help), name


def test_devices_are_completed_without_being_read() -> None:
    assert completed_devices("") == device_names()
    assert completed_devices("linked") == ["linked-40x96", "linked-6x6", "linked-grid-6x6"]


def test_files_are_completed_by_their_kind(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("a.wav", "a.txt", "B.WAV", ".hidden.wav", "two words.wav"):
        (tmp_path / name).touch()
    (tmp_path / "alone").mkdir()
    (tmp_path / "alone" / "in.wav").touch()
    monkeypatch.chdir(tmp_path)
    wavs = completed_files(".wav")
    assert wavs("") == ["B.WAV", "a.wav", "alone/"]
    assert wavs("al") == ["alone/", "alone/in.wav"]
    assert wavs(".h") == [".hidden.wav"]
    assert wavs(str(tmp_path / "a.")) == [str(tmp_path / "a.wav")]
    assert wavs("none/") == []
    (tmp_path / "mine.yaml").touch()
    assert completed_devices("mi") == ["mine.yaml"]


def offered(words: str, folder: Path, shell: str = "bash") -> subprocess.CompletedProcess[str]:
    environment = os.environ | {
        "PYTHONPATH": str(ROOT), "_DOTWAVE_COMPLETE": f"complete_{shell}", "COMP_WORDS": words,
        "COMP_CWORD": str(len(words.split(" ")) - 1), "_TYPER_COMPLETE_ARGS": words,
        "_TYPER_COMPLETE_FISH_ACTION": "get-args",
    }  # fmt: skip
    code = "import atexit, sys; atexit.register(lambda: print(*sys.modules, file=sys.stderr)); "
    code += "from dotwave.cli.app import main; main()"
    command = [sys.executable, "-c", code]
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)


@pytest.mark.parametrize(
    ("words", "answers"),
    [
        ("dotwave ver", {"verify"}),
        ("dotwave text Hello --device linked", {"linked-40x96", "linked-6x6", "linked-grid-6x6"}),
        ("dotwave devices ultra", {"ultrasonic-6x6"}),
        ("dotwave verify ", {"a.wav"}),
        ("dotwave render ", {"job.yaml"}),
        ("dotwave text Hello --presentation by", {"by-row", "by-dot"}),
    ],
)
def test_a_shell_is_answered(tmp_path: Path, words: str, answers: set[str]) -> None:
    for name in ("a.wav", "job.yaml", "note.md"):
        (tmp_path / name).touch()
    ended = offered(words, tmp_path)
    assert ended.returncode == 0
    assert set(ended.stdout.split()) == answers
    assert not {"numpy", "yaml", "rich", "PIL"} & set(ended.stderr.split())


@pytest.mark.parametrize("shell", ["zsh", "fish"])
def test_other_shells_are_answered(tmp_path: Path, shell: str) -> None:
    assert "linked-40x96" in offered("dotwave text Hello --device linked", tmp_path, shell).stdout


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_each_shell_has_its_script(tmp_path: Path, shell: str) -> None:
    environment = os.environ | {"PYTHONPATH": str(ROOT), "_DOTWAVE_COMPLETE": f"source_{shell}"}
    command = [sys.executable, "-m", "dotwave"]
    script = subprocess.run(command, env=environment, capture_output=True, text=True, check=True).stdout
    assert "_DOTWAVE_COMPLETE=complete_" + shell in script
    if shell == "bash" and shutil.which("bash"):
        calls = f'COMP_WORDS=(dotwave ver); COMP_CWORD=1; _dotwave_completion {tmp_path}/dotwave; echo "$COMPREPLY"'
        program = tmp_path / "dotwave"
        start = f"PYTHONPATH={shlex.quote(str(ROOT))} exec {shlex.quote(sys.executable)}"
        program.write_text(f'#!/bin/sh\n{start} -m dotwave "$@"\n', encoding="utf-8")
        program.chmod(0o755)
        answer = subprocess.run(["bash", "-c", f"{script}\n{calls}"], capture_output=True, text=True, check=True)
        assert answer.stdout == "verify\n"


@pytest.mark.parametrize(("name", "meant"), [("linked-66", "linked-6x6"), ("Paper-6X6", "paper-6x6")])
def test_a_device_that_was_probably_meant_is_named(dotwave, name: str, meant: str) -> None:
    ended = dotwave("devices", name)
    assert ended.code == 2
    assert ended.err.endswith(f"; did you mean {meant}?\n")
    assert "did you mean" not in dotwave("devices", "quite another").err


@pytest.mark.parametrize(
    ("words", "meant"), [("germna", "german"), ("en-ueb-g3.ctb", "en-ueb-g"), ("frensh", "french")]
)
def test_a_table_that_was_probably_meant_is_named(dotwave, words: str, meant: str) -> None:
    ended = dotwave("tables", words)
    assert ended.code == 2
    assert f"; did you mean {meant}" in ended.err
    assert "`dotwave tables` lists all" in dotwave("tables", "no such language").err


def test_simulate_takes_the_option_that_all_others_take(dotwave, tmp_path: Path) -> None:
    chain = tmp_path / "chain.yaml"
    chain.write_text(
        "chain: {n: 1, delta: 0.05, beta: 0.0}\nsetting: {epsilon: 0.01, omega: 1.1}\nrung: linear\ntol: 1.0e-6\n",
        encoding="utf-8",
    )
    plain, asked = dotwave("simulate", chain), dotwave("simulate", chain, "--json")
    assert (plain.code, asked.code) == (0, 0)
    assert asked.out.partition('"stats"')[0] == plain.out.partition('"stats"')[0]
