"""The command line as Markdown, from the parser itself: nothing about an option is typed twice."""

from __future__ import annotations

import re
from enum import Enum
from pathlib import Path
from typing import Any, get_args, get_type_hints

import typer.main

from dotwave.cli.app import application
from dotwave.cli.help import GROUPS

__all__ = ["command_names", "commands", "section", "summary"]

APPLICATION = application()
EXAMPLE = "Example:"
KINDS = {int: "whole number", float: "number", str: "text", Path: "file or folder"}


def commands() -> dict[str, Any]:
    """Every command by name, as the parser has it."""
    return dict(typer.main.get_command(APPLICATION).commands)  # type: ignore[attr-defined]


def command_names() -> list[str]:
    """All names, group by group as in ``dotwave --help``."""
    found = commands()
    return [name for group in GROUPS for name in found if getattr(found[name], "rich_help_panel", None) == group]


def summary() -> str:
    """One table of all commands."""
    found = commands()
    rows = [
        f"| [`dotwave {name}`](#dotwave-{name}) | {text_of(found[name].get_short_help_str(200))} | {group} |"
        for group in GROUPS
        for name in command_names()
        if found[name].rich_help_panel == group
    ]
    return "\n".join(["| command | what it does | group |", "|---|---|---|", *rows])


def section(name: str) -> str:
    """What a command does, its arguments and options, and its example."""
    command = commands()[name]
    words, _, example = command.help.replace("\b\n", "").partition(EXAMPLE)
    paragraphs = [" ".join(one.split()) for one in words.strip().split("\n\n")]
    arguments = [one for one in command.params if one.param_type_name == "argument"]
    options = [one for one in command.params if one.param_type_name == "option"]
    parts = [f"### dotwave {name}", *map(text_of, paragraphs)]
    parts.append("```sh\n" + "\n".join(line.strip() for line in example.strip().splitlines()) + "\n```")
    if arguments:
        parts.append("\n".join(["| argument | meaning |", "|---|---|", *map(_argument, arguments)]))
    if options:
        hints = _hints(name)
        rows = [_row(one, hints[one.name]) for one in options]
        parts.append("\n".join(["| option | value | meaning | without it |", "|---|---|---|---|", *rows]))
    return "\n\n".join(parts)


def text_of(words: str) -> str:
    """Words of the parser, safe in Markdown."""
    pieces = re.split(r"(`[^`]*`)", words)
    return "".join(one if one.startswith("`") else _escaped(one) for one in pieces)


def _escaped(words: str) -> str:
    for sign in "*<_|":
        words = words.replace(sign, f"\\{sign}")
    return re.sub(r"(?<!\w)(--[a-z][a-z-]*)", r"`\1`", words)


def _argument(argument: Any) -> str:
    name = str(argument.metavar or argument.name.upper())
    return f"| `{name}` | {text_of(argument.help)} |"


def _row(option: Any, hint: Any) -> str:
    names = ", ".join(f"`{name}`" for name in (*reversed(option.opts), *option.secondary_opts))
    return f"| {names} | {_value(option, hint)} | {text_of(option.help)} | {_default(option)} |"


def _value(option: Any, hint: Any) -> str:
    if option.is_flag:
        return "none"
    kind, info = _kind_of(hint)
    if isinstance(kind, type) and issubclass(kind, Enum):
        return ", ".join(f"`{one.value}`" for one in kind)
    if option.metavar:
        return f"`{option.metavar}`"
    return KINDS[kind] + _range(info.min, info.max)


def _kind_of(hint: Any) -> tuple[Any, Any]:
    """The type of an option without `None`, and what was said of it."""
    kind, info = get_args(hint)[:2]
    return next((one for one in get_args(kind) if one is not type(None)), kind), info


def _range(low: float | None, high: float | None) -> str:
    if low is not None and high is not None:
        return f", {low:g} to {high:g}"
    return "" if low is None else f", {low:g} or more"


def _default(option: Any) -> str:
    if option.required:
        return "required"
    value = getattr(option.default, "value", option.default)
    return "not set" if option.is_flag or value in (None, "") else f"`{value}`"


def _hints(name: str) -> dict[str, Any]:
    """The annotations of a command's function; they say more than the parser keeps."""
    groups = (group.typer_instance for group in APPLICATION.registered_groups)
    parts = (APPLICATION, *(group for group in groups if group is not None))
    found = (one.callback for part in parts for one in part.registered_commands if one.callback is not None)
    callback = next(one for one in found if one.__name__.rstrip("_") == name)
    return get_type_hints(callback, include_extras=True)
