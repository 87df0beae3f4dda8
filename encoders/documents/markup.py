"""XML and HTML to trees, by lxml: no entity is expanded, nothing is fetched, depth and size have bounds."""

from __future__ import annotations

import re
from collections.abc import Iterator
from html import unescape
from typing import TYPE_CHECKING, Any, NamedTuple

from ..errors import InvalidText, UnsupportedSource
from .extra import extra
from .limits import MOST_PART_BYTES

if TYPE_CHECKING:
    from lxml.etree import _Element as Element
else:
    Element = Any

__all__ = ["Element", "Event", "attribute", "children", "events", "html_tree", "local_name", "text_of", "xml_tree"]

_ENTITY = re.compile(rb"<!\s*ENTITY", re.IGNORECASE)
DEEPEST = "nested more than 255 deep"


def xml_tree(data: bytes, part: str = "") -> Element:
    """The root of an XML file.

    Parameters
    ----------
    data : its bytes.
    part : how it is called in messages.

    Raises
    ------
    InvalidText
        With the line where it is broken, or when it declares entities.
    UnsupportedSource
        When it is too long.
    DocumentsMissing
        When lxml is not installed.
    """
    etree = extra("lxml.etree")
    _check(data, part)
    parser = etree.XMLParser(
        resolve_entities=False, no_network=True, load_dtd=False, dtd_validation=False, huge_tree=False,
        remove_comments=True, remove_pis=True,
    )  # fmt: skip
    try:
        root: Element = etree.fromstring(data, parser)
    except (etree.LxmlError, ValueError, LookupError) as error:
        said = DEEPEST if "Excessive depth" in str(error) else _plain(str(error))
        raise InvalidText(f"{_at(part)}not XML: {said}") from None
    return root


def html_tree(data: bytes, encoding: str, part: str = "") -> Element | None:
    """The root of a page or a fragment of HTML, None when there is nothing in it.

    Parameters
    ----------
    data : its bytes.
    encoding : in which they are.
    part : how it is called in messages.

    Raises
    ------
    InvalidText, UnsupportedSource, DocumentsMissing
        As `xml_tree` does.
    """
    html = extra("lxml.html")
    etree = extra("lxml.etree")
    _check(data, part)
    parser = html.HTMLParser(encoding=encoding, no_network=True, remove_comments=True, remove_pis=True)
    try:
        root: Element = html.document_fromstring(data, parser=parser)
    except (etree.LxmlError, ValueError, LookupError) as error:
        if "empty" in str(error):
            return None
        raise InvalidText(f"{_at(part)}not HTML: {_plain(str(error))}") from None
    if any("Excessive depth" in entry.message for entry in parser.error_log):
        raise InvalidText(f"{_at(part)}not HTML: {DEEPEST}")
    return root


def _check(data: bytes, part: str) -> None:
    if len(data) > MOST_PART_BYTES:
        raise UnsupportedSource(f"{_at(part)}more than {MOST_PART_BYTES} bytes; give it in parts")
    if _ENTITY.search(data.replace(b"\0", b"")):
        raise InvalidText(f"{_at(part)}declares entities of its own, which are not read; save it without")


def _at(part: str) -> str:
    return f"{part}: " if part else ""


def _plain(message: str) -> str:
    return message.replace(" (<string>, line", " (line").splitlines()[0][:200] if message else "broken"


class Event(NamedTuple):
    """What a walk through a tree meets: an element that starts or ends, or text.

    Attributes
    ----------
    kind : ``start``, ``end`` or ``text``.
    element : the element, of text the one it stands in or behind.
    text : the characters, of text.
    """

    kind: str
    element: Element
    text: str = ""


def events(root: Element) -> Iterator[Event]:
    """All of a tree in reading order, without recursion."""
    stack = [(root, iter(root))]
    yield Event("start", root)
    if root.text:
        yield Event("text", root, root.text)
    while stack:
        element, below = stack[-1]
        child = next(below, None)
        if child is None:
            stack.pop()
            yield Event("end", element)
        elif not isinstance(child.tag, str):
            # An entity: of the names that HTML has, its character.
            word = unescape(child.text or "")
            yield Event("text", element, word if not word.startswith("&") else "")
        else:
            yield Event("start", child)
            if child.text:
                yield Event("text", child, child.text)
            stack.append((child, iter(child)))
            continue
        passed = element if child is None else child
        if passed.tail and passed is not root:
            yield Event("text", passed, passed.tail)


def local_name(element: Element) -> str:
    """The name of an element without its namespace or prefix, in lower case."""
    return str(element.tag).rpartition("}")[2].rpartition(":")[2].lower()


def attribute(element: Element, name: str) -> str:
    """An attribute by its name without namespace or prefix; empty when there is none."""
    return next((str(value) for key, value in element.attrib.items() if _bare(str(key)) == name), "")


def _bare(key: str) -> str:
    return key.rpartition("}")[2].rpartition(":")[2].lower()


def children(element: Element, *names: str) -> Iterator[Element]:
    """Elements directly in it that have one of these names."""
    return (child for child in element if isinstance(child.tag, str) and local_name(child) in names)


def text_of(element: Element) -> str:
    """All characters in an element."""
    return "".join(event.text for event in events(element) if event.kind == "text")
