"""ODT: the text of OpenDocument, from its content.xml."""

from __future__ import annotations

from functools import partial

from .archive import DocumentArchive, joined_name
from .blocks import BlockBuilder
from .epub import archive_files
from .markup import Element, attribute, children, events, local_name, text_of, xml_tree
from .model import Document, Emphasis

__all__ = ["read_odt"]

CONTENT, STYLES = "content.xml", "styles.xml"
NAMES = {
    "list": "ul",
    "list-item": "li",
    "list-header": "li",
    "table-row": "tr",
    "table-cell": "td",
    "line-break": "br",
}
TITLES = {"Title": "h1", "Subtitle": "h2"}
LEFT_OUT = {"tracked-changes", "annotation", "note-citation", "sequence-decls", "forms", "title", "desc", "object-ole"}
TAGS = {Emphasis.ITALIC: "i", Emphasis.BOLD: "b", Emphasis.UNDERLINE: "u"}


def read_odt(data: bytes) -> Document:
    """An ODT file.

    Raises
    ------
    InvalidText
        With the file and line where it is broken.
    UnsupportedSource
        When it is larger than documents are.
    """
    archive = DocumentArchive(data)
    content = xml_tree(archive.read(CONTENT), CONTENT)
    styles = _Styles()
    if STYLES in archive:
        styles.take(xml_tree(archive.read(STYLES), STYLES))
    styles.take(content)
    builder = BlockBuilder(CONTENT, partial(archive_files, archive, CONTENT))
    for body in content.iter("{*}text"):
        if local_name(body) == "text" and body.getparent() is not None and local_name(body.getparent()) == "body":
            _read(builder, body, styles, archive)
    builder.flush()
    return Document(tuple(builder.blocks))


class _Styles:
    """What styles mean for reading: emphasis of text, titles, numbered lists."""

    def __init__(self) -> None:
        self.emphases: dict[str, list[str]] = {}
        self.titles: dict[str, str] = {}
        self.numbered: set[str] = set()

    def take(self, root: Element) -> None:
        for element in root.iter("{*}style", "{*}list-style"):
            name = attribute(element, "name")
            if local_name(element) == "list-style":
                first = next((child for child in element if isinstance(child.tag, str)), None)
                if first is not None and local_name(first) == "list-level-style-number":
                    self.numbered.add(name)
                continue
            title = TITLES.get(name) or TITLES.get(attribute(element, "parent-style-name"))
            if title:
                self.titles[name] = title
            if attribute(element, "family") == "text":
                found = (_emphasis(one) for one in children(element, "text-properties"))
                self.emphases[name] = [TAGS[one] for whole in found for one in TAGS if one & whole]


def _emphasis(properties: Element) -> Emphasis:
    found = Emphasis.NONE
    if attribute(properties, "font-style") in ("italic", "oblique"):
        found |= Emphasis.ITALIC
    if attribute(properties, "font-weight") in ("bold", "600", "700", "800", "900"):
        found |= Emphasis.BOLD
    if attribute(properties, "text-underline-style") not in ("", "none"):
        found |= Emphasis.UNDERLINE
    return found


def _read(builder: BlockBuilder, body: Element, styles: _Styles, archive: DocumentArchive) -> None:
    left_out: Element | None = None
    for kind, element, text in events(body):
        line = element.sourceline or 0
        if left_out is not None:
            left_out = None if kind == "end" and element is left_out else left_out
        elif kind == "text":
            builder.text(text, line)
        elif kind == "start" and local_name(element) in LEFT_OUT:
            left_out = element
        elif kind == "start" and local_name(element) == "frame":
            _frame(builder, element, archive, line)
        elif kind == "start":
            _start(builder, element, styles, line)
        else:
            for name in reversed(_names(element, styles)):
                builder.end(name)


def _start(builder: BlockBuilder, element: Element, styles: _Styles, line: int) -> None:
    name = local_name(element)
    if name in ("s", "tab"):
        builder.text(" ", line)
    else:
        for tag in _names(element, styles):
            builder.start(tag, line)


def _frame(builder: BlockBuilder, frame: Element, archive: DocumentArchive, line: int) -> None:
    """A picture, or a formula, which is a document of its own in the archive."""
    for embedded in children(frame, "object"):
        name = joined_name(CONTENT, attribute(embedded, "href").rstrip("/") + "/" + CONTENT)
        root = xml_tree(archive.read(name), name) if name in archive else None
        if root is not None and local_name(root) == "math":
            builder.formula(root, line)
            return
    address = next((attribute(image, "href") for image in children(frame, "image")), "")
    said = [" ".join(text_of(one) for one in children(frame, kind)) for kind in ("desc", "title")]
    if address:
        given = {"src": address, "alt": next(filter(None, said), "")}
        builder.start("img", line, lambda key: given.get(key, ""))


def _names(element: Element, styles: _Styles) -> list[str]:
    """The elements of HTML that one of ODT stands for."""
    name, style = local_name(element), attribute(element, "style-name")
    if name == "h":
        level = attribute(element, "outline-level")
        return [f"h{min(int(level), 6)}" if level.isdecimal() and int(level[:4]) > 0 else "h1"]
    if name == "p":
        return [styles.titles.get(style) or TITLES.get(style, "p")]
    if name == "span":
        return styles.emphases.get(style, [])
    if name == "list" and style in styles.numbered:
        return ["ol"]
    return [NAMES[name]] if name in NAMES else []
