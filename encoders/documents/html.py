"""HTML: whole pages and fragments."""

from __future__ import annotations

import re

from ..characters import declared
from ..errors import InvalidText
from .blocks import Files, blocks_of
from .markup import html_tree
from .model import Document

__all__ = ["html_document", "read_html"]

_CHARSET = re.compile(rb"<meta[^>]{0,200}?charset\s*=\s*[\"']?\s*([\w.:-]{1,40})", re.IGNORECASE)
_XML = re.compile(rb"<\?xml[^>]{0,200}?encoding\s*=\s*[\"']([\w.:-]{1,40})", re.IGNORECASE)
HEAD_BYTES = 2048


def read_html(data: bytes, encoding: str | None = None) -> Document:
    """A page or a fragment, in the encoding it declares, else UTF-8.

    Raises
    ------
    InvalidText
        When the bytes are not of that encoding, or it nests too deep.
    """
    return html_document(data, encoding)


def html_document(data: bytes, encoding: str | None = None, part: str = "", files: Files | None = None) -> Document:
    """The same of a page that is a part of a document, with what finds its pictures."""
    head = data[:HEAD_BYTES]
    named = _XML.search(head) or _CHARSET.search(head)
    try:
        text = declared(data, encoding, named[1].decode("ascii") if named else "")
    except InvalidText as error:
        raise InvalidText(f"{part}: {error}" if part else str(error)) from None
    root = html_tree(text.encode("utf-8", "replace"), "utf-8", part)
    if root is None:
        return Document(())
    return Document(tuple(blocks_of(root, part, files) if files else blocks_of(root, part)))
