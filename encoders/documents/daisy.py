"""DAISY: a DTBook file, or the zip of a DAISY 3 or 2.02 book with its text."""

from __future__ import annotations

from functools import partial

from ..errors import InvalidText
from .archive import DocumentArchive, joined_name
from .blocks import Files, blocks_of
from .epub import archive_files
from .html import html_document
from .markup import attribute, html_tree, local_name, xml_tree
from .model import Block, Document

__all__ = ["read_daisy"]

NAMES = {"levelhd": "h2"}
"""DTBook's names for what HTML calls otherwise."""
DTBOOK = "application/x-dtbook+xml"
CONTENTS = "ncc.html"


def read_daisy(data: bytes) -> Document:
    """A DTBook file or a zipped book.

    Raises
    ------
    InvalidText
        With the file and line where it is broken, or when it holds no text.
    UnsupportedSource
        When it is larger than books are.
    """
    if not data.startswith(b"PK"):
        return Document(tuple(_dtbook(data, "")))
    archive = DocumentArchive(data)
    blocks: list[Block] = []
    for name in _texts(archive):
        files = partial(archive_files, archive, name)
        if name.lower().endswith((".html", ".htm", ".xhtml")):
            blocks += html_document(archive.read(name), None, name, files).blocks
        else:
            blocks += _dtbook(archive.read(name), name, files)
    return Document(tuple(blocks))


def _dtbook(data: bytes, part: str, files: Files | None = None) -> list[Block]:
    root = xml_tree(data, part)
    if local_name(root) != "dtbook":
        raise InvalidText(f"{part}{': ' if part else ''}not DTBook: its root is {local_name(root)!r}")
    return blocks_of(root, part, files, NAMES) if files else blocks_of(root, part, names=NAMES)


def _texts(archive: DocumentArchive) -> list[str]:
    """Names of the files with the text, in the order they are read."""
    found: list[str] = []
    for package in (name for name in archive.names if name.lower().endswith(".opf")):
        for element in xml_tree(archive.read(package), package).iter():
            if isinstance(element.tag, str) and attribute(element, "media-type") == DTBOOK:
                found.append(joined_name(package, attribute(element, "href")))
    for contents in (name for name in archive.names if name.lower().rpartition("/")[2] == CONTENTS):
        root = html_tree(archive.read(contents), "utf-8", contents)
        links = (element for element in (root.iter() if root is not None else ()) if isinstance(element.tag, str))
        named = (joined_name(contents, attribute(link, "href")) for link in links if local_name(link) == "a")
        found += [name for name in named if name.lower().endswith((".html", ".htm", ".xhtml"))]
    if not found:
        raise InvalidText("no DAISY book with a text is in the archive; give the text itself")
    return list(dict.fromkeys(found))
