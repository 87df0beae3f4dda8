"""Markdown (CommonMark, with tables and struck text), by markdown-it-py."""

from __future__ import annotations

import re
from html import unescape
from typing import TYPE_CHECKING, Any

from ..characters import decoded
from ..errors import InvalidText, UnsupportedSource
from .blocks import BlockBuilder, feed
from .extra import extra
from .limits import MOST_PART_BYTES
from .markup import html_tree
from .model import Document

if TYPE_CHECKING:
    from markdown_it.token import Token
else:
    Token = Any

__all__ = ["read_markdown"]

_TAGS = {"fence": "pre", "code_block": "pre"}


def read_markdown(data: bytes, encoding: str | None = None) -> Document:
    """A Markdown file; HTML in it is read as such.

    Raises
    ------
    InvalidText
        When the bytes are not of the encoding.
    DocumentsMissing
        When markdown-it-py is not installed.
    """
    text = decoded(data, encoding)
    if len(data) > MOST_PART_BYTES:
        raise UnsupportedSource(f"more than {MOST_PART_BYTES} bytes; give it in parts")
    parser = extra("markdown_it").MarkdownIt("commonmark").enable(["table", "strikethrough"])
    try:
        tokens = parser.parse(_without_head(text))
    except (RecursionError, IndexError) as error:
        raise InvalidText(f"not Markdown that can be read ({type(error).__name__}); nest it less") from None
    builder = BlockBuilder()
    line = 0
    for token in tokens:
        line = token.map[0] + 1 if token.map else line
        _take(builder, token, line)
    builder.flush()
    return Document(tuple(builder.blocks))


def _without_head(text: str) -> str:
    """The text with the YAML lines at its start made empty: they tell programs about it."""
    lines = text.removeprefix("\ufeff").split("\n")
    if lines[0].rstrip() != "---":
        return text
    end = next((at for at, line in enumerate(lines[1:], 1) if line.rstrip() in ("---", "...")), 0)
    return "\n".join([""] * (end + 1) + lines[end + 1 :]) if end else text


def _take(builder: BlockBuilder, token: Token, line: int) -> None:
    if token.type == "inline":
        for child in token.children or ():
            _take(builder, child, line)
            line += child.type in ("softbreak", "hardbreak")
    elif token.type in _TAGS:
        builder.start("pre", line)
        builder.text(token.content.rstrip("\n"), line + (token.type == "fence"))
        builder.end("pre")
    elif token.type in ("text", "code_inline"):
        builder.text(token.content, line)
    elif token.type == "softbreak":
        builder.text(" ", line)
    elif token.type == "hardbreak":
        builder.start("br", line)
    elif token.type == "image":
        given = {"src": str(token.attrGet("src") or ""), "alt": _alternative(token)}
        builder.start("img", line, lambda name: given.get(name, ""))
    elif token.type in ("html_inline", "html_block"):
        _html(builder, token, line)
    elif token.nesting == 1:
        builder.start(token.tag, line, lambda name: str(token.attrGet(name) or ""))
    elif token.nesting == -1:
        builder.end(token.tag)


def _html(builder: BlockBuilder, token: Token, line: int) -> None:
    """HTML between lines of Markdown, or a single element in a line."""
    if token.type == "html_block":
        root = html_tree(token.content.encode("utf-8", "replace"), "utf-8", f"line {line}")
        if root is not None:
            builder.flush()
            feed(builder, root, {})
        return
    found = _ELEMENT.match(token.content)
    if found and found[1]:
        builder.end(found[2].lower())
    elif found:
        attributes = {name.lower(): unescape(value) for name, value in _ATTRIBUTE.findall(token.content)}
        builder.start(found[2].lower(), line, lambda name: attributes.get(name, ""))


_ELEMENT = re.compile(r"<(/?)([A-Za-z][A-Za-z0-9-]*)")
_ATTRIBUTE = re.compile(r"\s([A-Za-z-]+)=[\"']([^\"']*)")


def _alternative(token: Token) -> str:
    """The words of an image: its children's text, emphasis and all."""
    return "".join(child.content for child in token.children or () if child.type in ("text", "code_inline")) or str(
        token.content
    )
