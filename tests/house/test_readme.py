"""The entrance keeps up with the program: help, README, exit codes."""

from __future__ import annotations

import re

import pytest

from encoders import picture_rules
from tests.support.docs_pages import DOCS, README, generator, read

COMMANDS = generator("commands").commands()
LONGEST_README = 150

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


def test_the_readme_is_short_and_leads_on() -> None:
    readme = read(README)
    assert len(readme.splitlines()) <= LONGEST_README
    linked = set(re.findall(r"\]\(docs/(\w+\.md)\)", readme))
    assert {"tutorial.md", "cli.md", "devices.md", "safety.md", "theory.md", "architecture.md"} <= linked


def test_the_readme_has_the_two_commands_five_of_dotwave_and_five_lines_of_python() -> None:
    shell = "".join(re.findall(r"```sh\n(.*?)```", read(README), flags=re.DOTALL))
    assert set(re.findall(r"^\./run (\w+)", shell, flags=re.MULTILINE)) == {"demo", "test"}
    assert len(re.findall(r"^dotwave ", shell, flags=re.MULTILINE)) == 5
    (python,) = re.findall(r"```python\n(.*?)```", read(README), flags=re.DOTALL)
    assert len(list(filter(None, python.splitlines()))) == 5


def test_pages_and_readme_know_only_commands_that_exist() -> None:
    text = "".join(map(read, [README, *DOCS.glob("*.md")]))
    blocks = "".join(re.findall(r"```sh\n(.*?)```", text, flags=re.DOTALL))
    shown = set(re.findall(r"^dotwave ([a-z]+)", blocks, flags=re.MULTILINE))
    shown |= set(re.findall(r"`dotwave ([a-z]+)", text))
    assert shown <= set(COMMANDS)


def test_help_shows_every_choice_of_a_picture() -> None:
    options = {option: one for one in COMMANDS["image"].params for option in one.opts}
    for name, rule in picture_rules().items():
        option = f"--{'as' if name == 'output' else name}"
        if rule.choices and option in options:
            assert ", ".join(rule.choices) in options[option].help


def test_the_exit_codes_are_said() -> None:
    page = read(DOCS / "cli.md")
    assert all(f"| {code} |" in page for code in (0, 1, 2, 70, 130, 141, 143))
