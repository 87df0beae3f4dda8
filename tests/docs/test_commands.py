"""Commands on the pages: what is made from the parser is all there, every line parses, and the cheap ones run."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.support.docs_pages import DOCS, EVERY, README, ROOT, blocks, generator, prose, read
from tests.support.everyday import one_in

MADE = generator("commands")
COMMANDS = MADE.commands()
# A terminal of their own, hardware, minutes, or files of somebody else's.
NOT_HERE = re.compile(r"emulate|--live|--port|bootstrap|arrived|bench|tradeoff|pareto|dotwave ports")

each_command = pytest.mark.parametrize("name", sorted(COMMANDS))


def shown(pages: list[Path]) -> Iterator[str]:
    """Every line with dotwave in a shell block, one command each."""
    for block in blocks("sh", pages):
        for line in block.text.replace("\\\n", " ").splitlines():
            for part in re.split(r"&&|\||;", line):
                if part.strip().startswith(("dotwave ", "./run dotwave ")):
                    yield part.strip().removeprefix("./run ")


LINES = sorted(set(shown(EVERY)))


def words_of(line: str) -> list[str]:
    """The arguments behind the command's name; what goes to or comes from a file is the shell's."""
    words = shlex.split(line, comments=True)[1:]
    return words[: words.index(">")] if ">" in words else words


@each_command
def test_the_page_is_made_of_every_command(name: str) -> None:
    assert f"<!-- made: command {name} -->" in read(DOCS / "cli.md")
    text = MADE.section(name)
    for parameter in COMMANDS[name].params:
        for option in parameter.opts if parameter.param_type_name == "option" else ():
            assert f"`{option}`" in text
    assert f"dotwave {name}" in text
    assert f"`dotwave {name}`" in MADE.summary()


@each_command
def test_every_row_of_a_made_table_has_as_many_cells_as_its_head(name: str) -> None:
    for table in re.findall(r"(?:^\|.*\n?)+", MADE.section(name), flags=re.MULTILINE):
        # A stroke in code or behind a backslash parts no cells.
        rows = [re.sub(r"`[^`]*`|\\\|", "", row).count("|") for row in table.splitlines()]
        assert len(set(rows)) == 1, table


def test_every_command_is_in_a_group_and_on_the_page_once() -> None:
    assert sorted(MADE.command_names()) == sorted(COMMANDS)
    marks = re.findall(r"<!-- made: command (\w+) -->", read(DOCS / "cli.md"))
    assert sorted(marks) == sorted(COMMANDS)


@pytest.mark.parametrize("line", LINES)
def test_every_line_parses(line: str) -> None:
    name, *arguments = words_of(line)
    if name.startswith("--"):
        return
    COMMANDS[name].make_context(name, arguments)


@pytest.mark.parametrize("page", EVERY, ids=lambda page: page.name)
def test_options_in_the_prose_exist(page: Path) -> None:
    for code in re.findall(r"`dotwave ([a-z]+[^`]*)`", prose(page)):
        name, *arguments = code.split("\\|")[0].split()
        known = {option for parameter in COMMANDS[name].params for option in parameter.opts}
        wrong = [word for word in arguments if word.startswith("-") and word not in known | {"-"}]
        assert not wrong, f"{page.name}: `dotwave {code}`"


def test_run_knows_what_the_pages_ask_of_it() -> None:
    usage = re.findall(r"^(?:usage:)? +\./run (\w+)", read(ROOT / "run"), flags=re.MULTILINE)
    for page in EVERY:
        assert set(re.findall(r"\./run (\w+)", read(page))) <= set(usage), page.name


@pytest.fixture(scope="module")
def workshop(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with what the pages tell their reader to put there."""
    folder = tmp_path_factory.mktemp("pages")
    (folder / "samples").symlink_to(ROOT / "samples")
    (folder / "docs").mkdir()
    for block in blocks("yaml"):
        before = read(block.page).split(block.text)[0]
        named = re.findall(r"[Pp]ut this into `(\w+\.yaml)`|`(\w+\.yaml)`:\n", before[-300:])
        if named:
            (folder / next(filter(None, named[-1]))).write_text(block.text, encoding="utf-8")
    assert run('dotwave text "Hello world" --device linked-6x6 -o hello.wav', folder).returncode == 0
    return folder


def run(line: str, folder: Path) -> subprocess.CompletedProcess[str]:
    """One line in a process of its own."""
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    call = [sys.executable, "-m", "dotwave", *words_of(line)]
    return subprocess.run(call, cwd=folder, env=environment, capture_output=True, text=True, check=False)


def runnable() -> list[Path]:
    return [README, *(DOCS / f"{name}.md" for name in ("tutorial", "playing", "devices", "apps"))]


@pytest.mark.parametrize("page", one_in(5, runnable()), ids=lambda page: page.name)
def test_the_cheap_ones_run_one_after_another(page: Path, workshop: Path) -> None:
    ran = 0
    for line in dict.fromkeys(shown([page])):
        if NOT_HERE.search(line):
            continue
        ended = run(line, workshop)
        # doctor says 1 where something is missing on this machine.
        assert ended.returncode in ((0, 1) if "doctor" in line else (0,)), f"{line}\n{ended.stderr}"
        ran += 1
    assert ran >= 2
