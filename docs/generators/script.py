"""A notebook kept as a script in the percent format, as Markdown."""

from __future__ import annotations

import re

__all__ = ["page_of"]

CELL = re.compile(r"^# %%(.*)$", flags=re.MULTILINE)


def page_of(script: str) -> str:
    """The cells in order: words as they are, code in fences."""
    pieces = CELL.split(script)
    cells = zip(pieces[1::2], pieces[2::2], strict=True)
    return "\n\n".join(filter(None, (_cell(kind, body) for kind, body in cells))) + "\n"


def _cell(kind: str, body: str) -> str:
    if "[markdown]" in kind or "[md]" in kind:
        return "\n".join(re.sub(r"^# ?", "", line) for line in body.strip("\n").splitlines())
    code = body.strip("\n")
    return f"```python\n{code}\n```" if code else ""
