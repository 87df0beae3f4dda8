"""A notebook kept as a script in the percent format, as Markdown, with what its cells print."""

from __future__ import annotations

import io
import re
from contextlib import chdir, redirect_stdout
from tempfile import TemporaryDirectory
from typing import Any

__all__ = ["page_of"]

CELL = re.compile(r"^# %%(.*)$", flags=re.MULTILINE)


def page_of(script: str) -> str:
    """The cells in order: words as they are with headings one level lower, code in fences, what it prints below.

    The cells run in a folder of their own, one after another.
    """
    pieces = CELL.split(script)
    names: dict[str, Any] = {"__name__": "__main__"}
    with TemporaryDirectory() as folder, chdir(folder):
        cells = [_cell(kind, body.strip("\n"), names) for kind, body in zip(pieces[1::2], pieces[2::2], strict=True)]
    return "\n\n".join(filter(None, cells)) + "\n"


def _cell(kind: str, body: str, names: dict[str, Any]) -> str:
    if "[markdown]" in kind or "[md]" in kind:
        words = re.sub(r"(?m)^# ?", "", body)
        return re.sub(r"(?m)^#", "##", words)
    printed = io.StringIO()
    with redirect_stdout(printed):
        exec(compile(body, "cell", "exec"), names)
    said = printed.getvalue().rstrip()
    code = re.sub(r" *# noqa.*", "", body)
    return "\n\n".join(f"```{language}\n{text}\n```" for language, text in (("python", code), ("text", said)) if text)
