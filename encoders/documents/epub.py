"""EPUB: pages of XHTML in a zip, in the order of its spine."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

from ..errors import InvalidText
from .archive import DocumentArchive, joined_name
from .html import html_document
from .markup import Element, attribute, children, local_name, xml_tree
from .model import Block, Document

__all__ = ["PackageItem", "archive_files", "package_items", "pages_of", "read_epub"]

CONTAINER = "META-INF/container.xml"
PAGES = ("application/xhtml+xml", "text/html")


class PackageItem(NamedTuple):
    """A file of a package: its name in the archive, its kind, and whether it is read in order."""

    name: str
    media_type: str
    linear: bool


def read_epub(data: bytes) -> Document:
    """An EPUB file.

    Raises
    ------
    InvalidText
        With the file of the archive, and the line, where it is broken.
    UnsupportedSource
        When it is larger than books are, or encrypted.
    """
    return pages_of(DocumentArchive(data))


def pages_of(archive: DocumentArchive, default: str = "") -> Document:
    """All pages of an archive, in the order of its spine.

    Parameters
    ----------
    archive : the archive.
    default : its package where no container names one.
    """
    package = _package(archive, default)
    blocks: list[Block] = []
    files = partial(archive_files, archive)
    for item in package_items(archive, package):
        if item.linear and item.media_type in PAGES:
            page = html_document(archive.read(item.name), None, item.name, partial(files, item.name))
            blocks += page.blocks
    return Document(tuple(blocks))


def _package(archive: DocumentArchive, default: str) -> str:
    if CONTAINER in archive:
        root = xml_tree(archive.read(CONTAINER), CONTAINER)
        for element in root.iter():
            if isinstance(element.tag, str) and local_name(element) == "rootfile":
                name = attribute(element, "full-path")
                if name in archive:
                    return name
    if default in archive:
        return default
    raise InvalidText(f"{CONTAINER} names no package that is in the archive; save it again")


def package_items(archive: DocumentArchive, package: str) -> list[PackageItem]:
    """The files in the spine of a package.

    Raises
    ------
    InvalidText
        When the spine names what is not there, or one file twice.
    """
    root = xml_tree(archive.read(package), package)
    items: dict[str, Element] = {}
    for manifest in children(root, "manifest"):
        items |= {attribute(item, "id"): item for item in children(manifest, "item")}
    found: list[PackageItem] = []
    for spine in children(root, "spine"):
        for reference in children(spine, "itemref"):
            wanted = attribute(reference, "idref")
            if wanted not in items:
                raise InvalidText(
                    f"{package}, line {reference.sourceline}: no item has the id {wanted!r}; save it again"
                )
            name = joined_name(package, attribute(items[wanted], "href"))
            linear = (
                attribute(reference, "linear") != "no" and "nav" not in attribute(items[wanted], "properties").split()
            )
            found.append(PackageItem(name, attribute(items[wanted], "media-type"), linear))
    if len({item.name for item in found}) < len(found):
        raise InvalidText(f"{package}: its spine has one file twice; save it again")
    return found


def archive_files(archive: DocumentArchive, page: str, address: str) -> Callable[[], bytes] | None:
    """What loads the picture that a page of an archive calls `address`, None where there is none."""
    name = joined_name(page, address)
    return partial(archive.read, name) if name in archive else None
