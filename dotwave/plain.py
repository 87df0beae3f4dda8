"""Words for people: names and texts that others made, shown as what they are.

Every writer of a terminal, a text, a page, a table or a picture takes its words through here. Letters of every
script are left alone. JSON keeps the exact words; what stands here as an escape is the same character there.
"""

from __future__ import annotations

import html
import re
from typing import Any, Protocol

__all__ = ["HIDDEN", "Printable", "csv_cell", "html_words", "one_line", "printable"]

# Control characters, which could write over a terminal; line separators; marks that turn the direction of what
# follows, so that a name shows as another one; halves of surrogate pairs (bytes of file names that are not UTF-8).
HIDDEN = "\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff"
"""Characters that are never shown as they are, for a class of a regular expression; newline and tab are not in it."""

_HIDDEN = re.compile(f"[{HIDDEN}]")
_HIDDEN_OR_BREAK = re.compile(f"[{HIDDEN}\t\n]")
# What a spreadsheet takes for a formula; an apostrophe too, so that taking one off gives the words back.
_FORMULA = ("=", "+", "-", "@", "'")


class Printable(Protocol):
    """What every report can be shown as."""

    def as_dict(self) -> dict[str, Any]:
        """Plain JSON types."""
        ...

    def as_text(self) -> str:
        """Lines of plain text."""
        ...


def printable(words: str) -> str:
    r"""`words` with what must not be shown as escapes such as ``\u001b``; newlines and tabs stay."""
    return _HIDDEN.sub(_escaped, words)


def one_line(words: str) -> str:
    r"""As `printable`, with newlines and tabs as escapes too: a name cannot pass for a further line."""
    return _HIDDEN_OR_BREAK.sub(_escaped, words)


def html_words(words: str) -> str:
    """`words` on one line for a page, in text and in quoted attributes."""
    return html.escape(one_line(words))


def csv_cell(words: str) -> str:
    """`words` on one line for a table; an apostrophe goes before what a spreadsheet would take for a formula.

    Cells that begin with an apostrophe get another one: without its first apostrophe a cell is what it was.
    """
    shown = one_line(words)
    return "'" + shown if shown.startswith(_FORMULA) else shown


def _escaped(found: re.Match[str]) -> str:
    return f"\\u{ord(found[0]):04x}"
