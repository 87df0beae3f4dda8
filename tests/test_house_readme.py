"""The manual keeps up with the program: commands, examples, exit codes, files."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
import typer.main

from dotwave.cli.app import application
from encoders import picture_rules

ROOT = Path(__file__).resolve().parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")
COMMANDS = typer.main.get_command(application()).commands  # type: ignore[attr-defined]

each_command = pytest.mark.parametrize("name", sorted(COMMANDS))


@each_command
def test_command_has_help_with_an_example(name: str) -> None:
    command = COMMANDS[name]
    assert command.get_short_help_str()
    assert f"Example:\n  dotwave {name}" in command.help.replace("\b\n", "")


@each_command
def test_every_parameter_is_explained(name: str) -> None:
    for parameter in COMMANDS[name].params:
        assert parameter.help, f"{name}: {parameter.name}"


@each_command
def test_readme_shows_the_command(name: str) -> None:
    assert f"dotwave {name}" in README


def test_readme_shows_every_option() -> None:
    for name, command in COMMANDS.items():
        for parameter in command.params:
            long = [option for option in parameter.opts if option.startswith("--")]
            assert all(f"`{option}" in README for option in long), f"{name}: {long}"


def test_readme_and_help_show_every_choice_of_a_picture() -> None:
    table = README[README.index("| option of `image` |") :]
    options = {option: one for one in COMMANDS["image"].params for option in one.opts}
    for name, rule in picture_rules().items():
        option = f"--{'as' if name == 'output' else name}"
        if not rule.choices or option not in options:
            continue
        row = next(line for line in table.splitlines() if line.startswith(f"| `{option}`"))
        assert all(f"`{word}`" in row for word in rule.choices), row
        assert ", ".join(rule.choices) in options[option].help


def test_readme_knows_only_commands_that_exist() -> None:
    blocks = re.findall(r"```sh\n(.*?)```", README, flags=re.DOTALL)
    shown = set(re.findall(r"^dotwave ([a-z]+)", "".join(blocks), flags=re.MULTILINE))
    shown |= set(re.findall(r"`dotwave ([a-z]+)", README))
    assert shown == set(COMMANDS)


def test_readme_shows_the_exit_codes_and_the_two_commands() -> None:
    assert all(f"| {code} |" in README for code in (0, 1, 2, 130, 143))
    assert "./run demo" in README
    assert "./run test" in README


def test_pictures_and_linked_files_exist_and_pictures_have_words() -> None:
    for words, target in re.findall(r"!\[([^\]]*)\]\(([^)]+)\)", README):
        assert len(words) > 40, f"{target}: say what the picture shows"
        assert (ROOT / target).is_file()
    for target in re.findall(r"(?<!!)\[[^\]]*\]\((?!http|#)([^)]+)\)", README):
        assert (ROOT / target).exists(), target
