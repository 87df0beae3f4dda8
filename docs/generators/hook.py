"""Fills the pages in while mkdocs builds: a line ``<!-- made: ... -->`` gives way to what is made from the program."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

from api import api, packages
from commands import section, summary
from script import page_of

ROOT = Path(__file__).resolve().parents[2]
MARK = re.compile(r"^<!-- made: (\S+)(?: (\S+))? -->$", flags=re.MULTILINE)
TUTORIAL = ROOT / "docs" / "tutorial.py"
NO_NOTEBOOK = "The notebook is not in this tree."


def on_page_markdown(markdown: str, **_: Any) -> str:
    """The page with everything in it that is made."""
    return MARK.sub(lambda mark: made(mark[1], mark[2] or ""), markdown)


def made(what: str, name: str) -> str:
    """The text for one mark.

    Raises
    ------
    KeyError
        When nothing of that name is made.
    """
    makers: dict[str, Callable[[str], str]] = {
        "summary": lambda _: summary(),
        "command": section,
        "api": lambda _: api(),
        "packages": lambda _: packages(),
        "protocol": lambda _: protocol(),
        "notebook": lambda _: notebook(),
    }
    return makers[what](name)


def protocol() -> str:
    """The protocol's page without its own title."""
    return (ROOT / "drivers" / "PROTOCOL.md").read_text(encoding="utf-8").partition("\n")[2]


def notebook() -> str:
    """The notebook's cells, and what they print."""
    return page_of(TUTORIAL.read_text(encoding="utf-8")) if TUTORIAL.is_file() else NO_NOTEBOOK
