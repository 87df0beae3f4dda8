"""DOCX, by mammoth: to HTML, and from there as HTML is read."""

from __future__ import annotations

import io
from dataclasses import replace
from typing import Any
from xml.parsers.expat import ExpatError

from ..errors import InvalidText, UnsupportedSource
from .archive import DocumentArchive
from .blocks import blocks_of
from .extra import STUMBLES, extra
from .limits import MOST_BYTES
from .markup import html_tree
from .model import Block, Document, DocumentPlace

__all__ = ["read_docx"]

TEXT = "word/document.xml"
STYLES = """
p[style-name='Title'] => h1:fresh
p[style-name='Subtitle'] => h2:fresh
u => u
"""
_DECLARATIONS = (b"<!DOCTYPE", b"<!ENTITY")


def read_docx(data: bytes) -> Document:
    """A DOCX file; a place in it is the number of a block.

    Raises
    ------
    InvalidText
        When it is broken.
    UnsupportedSource
        When it is larger than documents are.
    DocumentsMissing
        When mammoth is not installed.
    """
    mammoth = extra("mammoth")
    archive = DocumentArchive(data)
    _check(archive)
    images = _Images()
    try:
        made = mammoth.convert_to_html(
            io.BytesIO(data), style_map=STYLES, convert_image=mammoth.images.img_element(images.take)
        )
    except UnsupportedSource:
        raise
    except (*STUMBLES, ExpatError) as error:
        raise InvalidText(f"not a whole DOCX file ({type(error).__name__}: {error}); save it again") from None
    root = html_tree(str(made.value).encode("utf-8", "replace"), "utf-8")
    blocks = [] if root is None else blocks_of(root, files=images.found)
    formulas = archive.read(TEXT).count(b"<m:oMath>") if TEXT in archive else 0
    notes = (
        (f"Its formulas ({formulas}) are left out: they are not MathML; save it as HTML or ODT.",) if formulas else ()
    )
    return Document(tuple(_placed(block, number) for number, block in enumerate(blocks, 1)), notes)


def _check(archive: DocumentArchive) -> None:
    """Refuse what a parser of XML could be led astray by, before one sees it."""
    for name in archive.names:
        if name.lower().endswith((".xml", ".rels")):
            data = archive.read(name).replace(b"\0", b"")
            if any(one in data for one in _DECLARATIONS):
                raise InvalidText(f"{name}: declares entities of its own, which are not read; save it without")


def _placed(block: Block, number: int) -> Block:
    place = DocumentPlace(f"block {number}")
    return replace(block, runs=tuple(replace(run, place=place) for run in block.runs))


class _Images:
    """The pictures of a document, by names made up for them."""

    def __init__(self) -> None:
        self._kept: dict[str, bytes] = {}
        self._size = 0

    def take(self, image: Any) -> dict[str, str]:
        """Keep a picture, and give the attributes it gets in HTML."""
        with image.open() as file:
            data = bytes(file.read(MOST_BYTES))
        self._size += len(data)
        if self._size > MOST_BYTES:
            raise UnsupportedSource(f"its pictures have more than {MOST_BYTES} bytes together; give it in parts")
        name = f"image {len(self._kept) + 1}"
        self._kept[name] = data
        return {"src": name}

    def found(self, name: str) -> Any:
        """What loads a picture."""
        data = self._kept.get(name)
        return None if data is None else lambda: data
