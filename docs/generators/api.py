"""The Python API as Markdown, from the docstrings of what `dotwave` and the packages below it offer."""

from __future__ import annotations

import importlib
import inspect
import re
from enum import Enum
from typing import Any

__all__ = ["PACKAGES", "api", "markdown_of", "packages"]

PACKAGES = ("encoders", "chainsim", "planner", "drivers")
NOT_YET = "This version has no names of its own under `dotwave`; the packages below are its Python interface."
ENTRY = re.compile(r"^(\S.*?) : (.*)$")
WIDE = 80
TITLE, ESCAPE = "\x00", "\\"


def api() -> str:
    """Every name of `dotwave.__all__` with its signature and docstring: functions, then classes, then errors."""
    module = importlib.import_module("dotwave")
    names = sorted(getattr(module, "__all__", ()), key=lambda name: (_rank(getattr(module, name)), name))
    return "\n\n".join(_entry(name, getattr(module, name)) for name in names) if names else NOT_YET


def _rank(thing: Any) -> int:
    if inspect.isclass(thing):
        return 2 if issubclass(thing, BaseException) else 1
    return 0


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
        signature = _signature(name, thing)
        if signature:
            parts.append(f"```python\n{signature}\n```")
        parts.append(markdown_of(inspect.getdoc(thing) or ""))
    else:
        parts.append(_first_sentence(thing))
    if inspect.isclass(thing):
        parts += [
            f"#### {name}.{member}\n\n{markdown_of(inspect.getdoc(value) or '')}" for member, value in _members(thing)
        ]
    return "\n\n".join(part for part in parts if part)


def _signature(name: str, thing: Any) -> str:
    """How it is called, annotations without quotes; a model that is read from files has its fields in the docstring."""
    if hasattr(thing, "model_fields") or (inspect.isclass(thing) and issubclass(thing, BaseException | Enum)):
        return ""
    words = re.sub(r"(: |-> )'([^']*)'", r"\1\2", str(inspect.signature(thing)))
    words = re.sub(r"<(\w+\.\w+): [^>]*>", r"\1", words)
    words = words.removesuffix(" -> None")
    if len(name + words) <= WIDE:
        return name + words
    parameters, _, back = words.removeprefix("(").rpartition(")")
    return f"{name}(\n    " + ",\n    ".join(re.split(r", (?=[*\w]+(?::|=|,|$)|\*,)", parameters)) + f",\n){back}"


def _members(thing: type) -> list[tuple[str, Any]]:
    """Methods and properties of the class's own that have a docstring, in the order they are written."""
    found = [(name, value) for name, value in vars(thing).items() if not name.startswith("_")]
    return [(name, value) for name, value in found if _is_member(value) and inspect.getdoc(value)]


def _is_member(value: Any) -> bool:
    return inspect.isroutine(value) or isinstance(value, property | classmethod | staticmethod)


def markdown_of(docstring: str) -> str:
    """A numpydoc docstring as Markdown: section titles in bold, their entries as lists, examples as code."""
    return _sections("\n\n".join(map(_paragraph, _paragraphs(docstring)))).strip()


def _paragraphs(docstring: str) -> list[str]:
    """Cut at blank lines; the title of a section stands alone."""
    titles = re.sub(r"(?m)^(\S.*)\n-{3,}$", r"\n" + TITLE + r"\1\n", docstring)
    return [one.strip("\n") for one in re.split(r"\n\s*\n", titles) if one.strip()]


def _paragraph(text: str) -> str:
    if text.startswith(TITLE):
        return text
    return f"```pycon\n{text}\n```" if text.lstrip().startswith(">>>") else _safe(text)


def _sections(text: str) -> str:
    """Below titles, entries that begin a line as lists; what is indented goes on."""
    head, *parts = re.split(rf"(?m)^{TITLE}", text)
    made = [head.strip()]
    for part in parts:
        title, _, body = part.partition("\n")
        made.append(f"**{title.strip()}**\n\n{_entries(body.strip())}")
    return "\n\n".join(made)


def _entries(body: str) -> str:
    if "```" in body:
        return body
    lines = body.splitlines()
    return "\n".join(_item(line, after) for line, after in zip(lines, [*lines[1:], ""], strict=True))


def _item(line: str, after: str) -> str:
    """A name with its meaning behind a colon or indented below it is an item; other lines are as they are."""
    entry = ENTRY.match(line)
    if entry:
        return f"- `{entry[1].replace(ESCAPE, '')}`: {entry[2]}"
    return f"- {line}" if after.startswith(" ") and not line.startswith(" ") else line


def _safe(words: str) -> str:
    pieces = re.split(r"(``?[^`]*``?)", words)
    return "".join(
        one
        if one.startswith("`")
        else one.replace("<", "&lt;").replace("*", "\\*").replace("_", "\\_").replace("|", "\\|")
        for one in pieces
    )
