"""Tables for notebooks: with a caption and headers that a screen reader announces, and nothing said by colour."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from ..plain import html_words

__all__ = ["html_facts", "html_table"]


def html_table(caption: str, columns: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """A table with a row of column headers; the first cell of every row names it."""
    head = "".join(f'<th scope="col">{html_words(name)}</th>' for name in columns)
    body = "".join(_row(row) for row in rows)
    return f"<table><caption>{html_words(caption)}</caption><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def html_facts(caption: str, facts: Mapping[str, object]) -> str:
    """A table of names and values."""
    return html_table(caption, ("what", "value"), facts.items())


def _row(cells: Sequence[object]) -> str:
    first, *others = (html_words(str(cell)) for cell in cells)
    return f'<tr><th scope="row">{first}</th>' + "".join(f"<td>{cell}</td>" for cell in others) + "</tr>"
