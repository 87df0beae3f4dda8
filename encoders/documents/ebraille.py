"""eBraille 1.0: pages of XHTML whose text is Braille already, in a zip with ``package.opf`` at its root."""

from __future__ import annotations

from .archive import DocumentArchive
from .epub import pages_of
from .model import Document

__all__ = ["read_ebraille"]

PACKAGE = "package.opf"


def read_ebraille(data: bytes) -> Document:
    """An eBraille file; cells are kept as they are.

    Raises
    ------
    InvalidText, UnsupportedSource
        As `read_epub` does.
    """
    return pages_of(DocumentArchive(data), PACKAGE)
