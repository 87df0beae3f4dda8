"""PEF: embossed pages as XML, row by row."""

from __future__ import annotations

from ..errors import InvalidText
from .markup import Element, local_name, text_of, xml_tree

__all__ = ["read_pef"]

PAGE_BREAK = "\f"


def read_pef(data: bytes) -> str:
    """Cells of a PEF file: rows end with a newline, pages with a form feed.

    Raises
    ------
    InvalidText
        With the line where it is not XML, or a row has something else than cells.
    """
    root = xml_tree(data)
    pages: list[list[str]] = []
    for element in root.iter():
        if not isinstance(element.tag, str):
            continue
        if local_name(element) == "page":
            pages.append([])
        elif local_name(element) == "row":
            if not pages:
                raise InvalidText(f"line {element.sourceline}: a row outside of a page; save it again")
            pages[-1].append(_row(element))
    if not pages:
        raise InvalidText("not PEF: it has no pages")
    return PAGE_BREAK.join("\n".join(rows).strip("\n") for rows in pages)


def _row(element: Element) -> str:
    cells = text_of(element).strip(" \t\r\n")
    for cell in cells:
        if not "\u2800" <= cell <= "\u28ff":
            raise InvalidText(f"line {element.sourceline}: {cell!r} is no cell of Braille (U+2800 to U+28FF)")
    # Blank cells at its end are the paper's.
    return cells.rstrip("\u2800")
