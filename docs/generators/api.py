"""The Python API as Markdown, from the docstrings of what `dotwave` and the packages below it offer."""

from __future__ import annotations

import importlib
import inspect
import re
from typing import Any

__all__ = ["PACKAGES", "api", "markdown_of", "packages"]

PACKAGES = ("encoders", "chainsim", "planner", "drivers")
NOT_YET = "This version has no names of its own under `dotwave`; the packages below are its Python interface."
ENTRY = re.compile(r"^(\S.*?) : (.*)$")


def api() -> str:
    """Every name of `dotwave.__all__` with its signature and docstring."""
    module = importlib.import_module("dotwave")
    names = list(getattr(module, "__all__", ()))
    return "\n\n".join(_entry(name, getattr(module, name)) for name in names) if names else NOT_YET


def packages() -> str:
    """The public names of the packages below, a table for each."""
    return "\n\n".join(_package(name) for name in PACKAGES)


def _package(package: str) -> str:
    module = importlib.import_module(package)
    rows = [f"| `{name}` | {_first_sentence(getattr(module, name))} |" for name in sorted(module.__all__)]
    intro = " ".join((module.__doc__ or "").split("\n\n")[0].split())
    return "\n".join([f"### {package}", "", _safe(intro), "", "| name | what it is |", "|---|---|", *rows])


def _first_sentence(thing: Any) -> str:
    if not (inspect.isclass(thing) or inspect.isroutine(thing)):
        return f"A constant: `{thing!r}`." if len(repr(thing)) <= 60 else "A constant."
    first = " ".join((inspect.getdoc(thing) or "").split("\n\n")[0].split())
    return _safe(first)


def _entry(name: str, thing: Any) -> str:
    parts = [f"### dotwave.{name}"]
    if inspect.isclass(thing) or inspect.isroutine(thing):
        signature = _signature(thing)
        if signature:
            parts.append(f"```python\n{name}{signature}\n```")
        parts.append(markdown_of(inspect.getdoc(thing) or ""))
    else:
        parts.append(_first_sentence(thing))
    if inspect.isclass(thing):
        parts += [
            f"#### {name}.{member}\n\n{markdown_of(inspect.getdoc(value) or '')}" for member, value in _members(thing)
        ]
    return "\n\n".join(part for part in parts if part)


def _signature(thing: Any) -> str:
    try:
        return str(inspect.signature(thing))
    except (TypeError, ValueError):
        return ""


def _members(thing: type) -> list[tuple[str, Any]]:
    """Methods and properties of the class's own that have a docstring, in the order they are written."""
    found = [(name, value) for name, value in vars(thing).items() if not name.startswith("_")]
    return [(name, value) for name, value in found if _is_member(value) and inspect.getdoc(value)]


def _is_member(value: Any) -> bool:
    return inspect.isroutine(value) or isinstance(value, property | classmethod | staticmethod)


def markdown_of(docstring: str) -> str:
    """A numpydoc docstring as Markdown: section titles in bold, their entries as lists, examples as code."""
    out: list[str] = []
    lines = docstring.splitlines()
    in_section = False
    for index, line in enumerate(lines):
        following = lines[index + 1] if index + 1 < len(lines) else ""
        if line and re.fullmatch("-{3,}", following):
            out += ["", f"**{line}**", ""]
            in_section = True
        elif not re.fullmatch("-{3,}", line):
            out += _line(line, in_section)
    return _fenced("\n".join(out)).strip()


def _line(line: str, in_section: bool) -> list[str]:
    if not in_section or not line or line.startswith((">>>", "...", " ")):
        return [line if line.lstrip().startswith((">>>", "...")) else _safe(line.strip() if in_section else line)]
    entry = ENTRY.match(line)
    return [f"- `{entry[1]}`: {_safe(entry[2])}"] if entry else [f"- {_safe(line)}"]


def _fenced(text: str) -> str:
    """Examples with prompts, as far as the next blank line, in fences."""
    return re.sub(r"(?m)^>>> (?:.+\n?)+", lambda match: f"\n```pycon\n{match[0].rstrip()}\n```\n", text)


def _safe(words: str) -> str:
    pieces = re.split(r"(``?[^`]*``?)", words)
    return "".join(
        one
        if one.startswith("`")
        else one.replace("<", "&lt;").replace("*", "\\*").replace("_", "\\_").replace("|", "\\|")
        for one in pieces
    )
