"""PDF: the text of its pages, by pypdf; what belongs together is a guess, and that is said."""

from __future__ import annotations

import io
import logging
import re
import warnings

from ..errors import InvalidText, UnsupportedSource
from .extra import STUMBLES, extra
from .limits import MOST_TEXT
from .model import Block, BlockKind, Document, DocumentPlace, TextRun

__all__ = ["read_pdf"]

MOST_PAGES = 20_000
NOTE = (
    "A PDF says where letters stand, not what belongs together: order, paragraphs and headings are a guess; "
    "a DOCX, EPUB or HTML of the same text is read better."
)
_EMPTY_LINE = re.compile(r"\n[ \t]*\n\s*")
_ODD = re.compile("[\0\ud800-\udfff]")


def read_pdf(data: bytes) -> Document:
    """The text of a PDF, page by page.

    Raises
    ------
    InvalidText
        When it is broken, or has no text.
    UnsupportedSource
        When it is locked, or too long.
    DocumentsMissing
        When pypdf is not installed.
    """
    pypdf = extra("pypdf")
    # It speaks of what it mends on the way.
    logging.getLogger("pypdf").setLevel(logging.CRITICAL)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            pages = _pages(pypdf.PdfReader(io.BytesIO(data)))
    except UnsupportedSource:
        raise
    except (*STUMBLES, pypdf.errors.PyPdfError) as error:
        raise InvalidText(f"not a whole PDF ({type(error).__name__}); save it again") from None
    blocks = [block for number, text in enumerate(pages, 1) for block in _blocks(text, number)]
    if not blocks:
        raise InvalidText("a PDF without text, such as pictures of pages; recognise its letters (OCR) first")
    return Document(tuple(blocks), (NOTE,))


def _pages(reader: object) -> list[str]:
    if getattr(reader, "is_encrypted", False) and not reader.decrypt(""):  # type: ignore[attr-defined]
        raise UnsupportedSource("a PDF that is locked by a password; save it without")
    pages = reader.pages  # type: ignore[attr-defined]
    if len(pages) > MOST_PAGES:
        raise UnsupportedSource(f"more than {MOST_PAGES} pages; give it in parts")
    texts: list[str] = []
    size = 0
    for page in pages:
        texts.append(_ODD.sub("", str(page.extract_text())))
        size += len(texts[-1])
        if size > MOST_TEXT:
            raise UnsupportedSource(f"more than {MOST_TEXT} characters; give it in parts")
    return texts


def _blocks(text: str, page: int) -> list[Block]:
    """What stands between empty lines of a page."""
    place = DocumentPlace(f"page {page}")
    plain = text.replace("\r", "\n").replace("\f", "\n").replace("\ufeff", "")
    parts = (part.strip() for part in _EMPTY_LINE.split(plain))
    return [Block(BlockKind.PARAGRAPH, (TextRun(part, place=place),)) for part in parts if part]
