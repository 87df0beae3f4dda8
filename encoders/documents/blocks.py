"""Blocks from the elements of a page, by the vocabulary of HTML; readers of other formats speak it too."""

from __future__ import annotations

import base64
import binascii
import re
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from urllib.parse import unquote_to_bytes
from xml.sax.saxutils import escape, quoteattr

from ..errors import UnsupportedSource
from .limits import MOST_TEXT
from .markup import Element, attribute, events, local_name, text_of
from .model import Block, BlockKind, DocumentPlace, EmbeddedImage, Emphasis, TextRun
from .vocabulary import BLOCKS, CELLS, EMPHASES, HEADINGS, KEPT_LINES, LISTS, SKIPPED, SKIPPED_ROLES

__all__ = ["BlockBuilder", "Files", "blocks_of", "feed"]

Files = Callable[[str], "Callable[[], bytes] | None"]
"""Gives, for the address of a picture, what loads it; None where it is not in the document."""

_SPACE = re.compile("[ \t\r\n\f]+")
_DATA = re.compile(r"data:image/[\w.+-]+(;[\w=-]+)*?(?P<base64>;base64)?,", re.IGNORECASE)
CELL_BREAK = "; "


def _no_files(_: str) -> None:
    return None


@dataclass
class _List:
    """A list that is open: the number of its next item, None where they are not numbered."""

    number: int | None = None


class BlockBuilder:
    """Takes elements and text in reading order, and gives the blocks they make.

    Parameters
    ----------
    part : the part of the document they stand in, for places.
    files : finds pictures.
    """

    def __init__(self, part: str = "", files: Files = _no_files) -> None:
        self.blocks: list[Block] = []
        self._part = part
        self._files = files
        self._runs: list[TextRun] = []
        self._emphasis = Counter[Emphasis]()
        self._lists: list[_List] = []
        self._kept = self._rows = self._cells = self._characters = 0
        self._next: tuple[BlockKind, int] = (BlockKind.PARAGRAPH, 0)
        self._prefix = ""

    def start(self, name: str, line: int = 0, attributes: Callable[[str], str] = lambda _: "") -> None:
        """An element begins; `attributes` gives its attributes by name, empty where there are none."""
        if name in EMPHASES:
            self._emphasis[EMPHASES[name]] += 1
        elif name == "br":
            self._break(line)
        elif name == "img":
            self._image(attributes, line)
        elif name in CELLS:
            self._strip_end()
            if self._cells:
                self._add(CELL_BREAK, line)
            self._cells += 1
        elif name in BLOCKS:
            self._start_block(name, attributes)

    def _start_block(self, name: str, attributes: Callable[[str], str]) -> None:
        if self._rows and name != "tr":
            # In a row blocks are parted by a blank.
            self._add(" ", 0)
            return
        self.flush()
        if name in HEADINGS:
            self._next = BlockKind.HEADING, HEADINGS[name]
        elif name in LISTS:
            numbered = name == "ol" or attributes("type") == "ol"
            start = attributes("start")
            self._lists.append(_List((int(start) if start.isdecimal() and len(start) < 9 else 1) if numbered else None))
        elif name == "li":
            self._item()
        elif name == "tr":
            self._rows += 1
            self._cells = 0
            self._next = BlockKind.TABLE_ROW, 0
        elif name in KEPT_LINES:
            self._kept += 1

    def _item(self) -> None:
        self._next = BlockKind.LIST_ITEM, max(1, len(self._lists))
        self._prefix = ""
        inner = self._lists[-1] if self._lists else _List()
        if inner.number is not None:
            self._prefix = f"{inner.number}. "
            inner.number += 1

    def end(self, name: str) -> None:
        """An element ends."""
        if name in EMPHASES:
            self._emphasis[EMPHASES[name]] = max(0, self._emphasis[EMPHASES[name]] - 1)
        elif name in ("line", "lic") and self._runs:
            self._add("\n" if name == "line" else " ", 0)
        elif name in BLOCKS and (not self._rows or name == "tr"):
            self.flush()
            if name == "li" or name in HEADINGS:
                self._next, self._prefix = (BlockKind.PARAGRAPH, 0), ""
            elif name in LISTS and self._lists:
                self._lists.pop()
            elif name == "tr":
                self._rows = max(0, self._rows - 1)
                self._next = BlockKind.PARAGRAPH, 0
            elif name in KEPT_LINES:
                self._kept = max(0, self._kept - 1)

    def text(self, characters: str, line: int = 0) -> None:
        """Characters as they stand in the source, white space of any length for a blank."""
        self._add(characters if self._kept else _SPACE.sub(" ", characters), line)

    def _add(self, characters: str, line: int) -> None:
        characters = characters.replace("\r", "").replace("\ufeff", "")
        if self._ends_blank() and not self._kept:
            characters = characters.lstrip(" ")
        if not characters:
            return
        self._characters += len(characters)
        if self._characters > MOST_TEXT:
            raise UnsupportedSource(f"more than {MOST_TEXT} characters; give it in parts")
        emphasis = Emphasis.NONE
        for one, depth in self._emphasis.items():
            emphasis |= one if depth else Emphasis.NONE
        self._runs.append(TextRun(characters, emphasis, DocumentPlace(self._part, line)))

    def _ends_blank(self) -> bool:
        last = next((run.text for run in reversed(self._runs) if run.text), " ")
        return last[-1] in " \n"

    def _break(self, line: int) -> None:
        self._strip_end()
        if self._runs:
            self._runs.append(TextRun("\n", place=DocumentPlace(self._part, line)))

    def _image(self, attributes: Callable[[str], str], line: int) -> None:
        source = attributes("src")
        name = source if not source.startswith("data:") else "a picture in the page"
        load = _from_address(source) or self._files(source)
        alternative = _SPACE.sub(" ", attributes("alt")).strip()
        image = EmbeddedImage(name, load)
        self._runs.append(TextRun(alternative, place=DocumentPlace(self._part, line), image=image))

    def formula(self, element: Element, line: int = 0) -> None:
        """A formula in MathML."""
        words = _words_of(element) or "?"
        place = DocumentPlace(self._part, line)
        self._runs.append(TextRun(words, place=place, mathml=_serialized(element)))

    def _strip_end(self) -> None:
        while self._runs and self._runs[-1].image is None:
            stripped = self._runs[-1].text.rstrip(" \n")
            if stripped:
                self._runs[-1] = replace(self._runs[-1], text=stripped)
                break
            self._runs.pop()

    def flush(self) -> None:
        """End the block at hand; without text or a picture it makes none."""
        self._strip_end()
        runs, self._runs = self._runs, []
        if not runs:
            return
        kind, level = self._next
        if kind is BlockKind.PARAGRAPH:
            kind = _kind_of(runs)
        if self._prefix:
            runs.insert(0, TextRun(self._prefix, place=runs[0].place))
            self._prefix = ""
        self.blocks.append(Block(kind, tuple(runs), level))
        if kind is BlockKind.LIST_ITEM:
            self._next = BlockKind.PARAGRAPH, 0


def _kind_of(runs: Iterable[TextRun]) -> BlockKind:
    said = [run for run in runs if run.text.strip() or run.image]
    if all(run.image for run in said):
        return BlockKind.IMAGE
    if all(run.mathml for run in said):
        return BlockKind.MATH
    return BlockKind.VERSE if any("\n" in run.text for run in said + list(runs)) else BlockKind.PARAGRAPH


def _from_address(source: str) -> Callable[[], bytes] | None:
    """What loads a picture that stands in its own address (``data:``)."""
    found = _DATA.match(source)
    if found is None:
        return None

    def load() -> bytes:
        words = source[found.end() :]
        if not found["base64"]:
            return unquote_to_bytes(words)
        try:
            return base64.b64decode(words, validate=False)
        except (binascii.Error, ValueError):
            raise UnsupportedSource("a picture in the page is broken; save the page again") from None

    return load


def blocks_of(
    root: Element, part: str = "", files: Files = _no_files, names: Mapping[str, str] | None = None
) -> list[Block]:
    """The blocks of a tree.

    Parameters
    ----------
    root : of HTML, or of a vocabulary close to it.
    part : as for `BlockBuilder`.
    files : as for `BlockBuilder`.
    names : elements that are called otherwise in HTML.
    """
    builder = BlockBuilder(part, files)
    feed(builder, root, names or {})
    builder.flush()
    return builder.blocks


def feed(builder: BlockBuilder, root: Element, names: Mapping[str, str]) -> None:
    """Give a builder all of a tree; `names` are elements that are called otherwise in HTML."""
    left_out: Element | None = None
    for kind, element, text in events(root):
        line = element.sourceline or 0
        if left_out is not None:
            left_out = None if kind == "end" and element is left_out else left_out
        elif kind == "text":
            builder.text(text, line)
        else:
            name = names.get(local_name(element), local_name(element))
            if kind == "end":
                builder.end(name)
            elif name == "math":
                builder.formula(element, line)
                left_out = element
            elif name in SKIPPED or {attribute(element, "type"), attribute(element, "role")} & SKIPPED_ROLES:
                left_out = element
            else:
                builder.start(name, line, partial(attribute, element))


def _words_of(element: Element) -> str:
    """What a formula says without a converter: its alternative text, else its letters and signs."""
    words = attribute(element, "alttext") or "".join(
        text_of(child) for child in element.iter() if isinstance(child.tag, str) and local_name(child) in _LEAVES
    )
    return _SPACE.sub(" ", words).strip()


_LEAVES = {"mi", "mn", "mo", "mtext", "ms"}


def _serialized(root: Element) -> str:
    """MathML with bare names, whatever prefix the source has, and nothing but elements, attributes and text."""
    parts: list[str] = []
    for kind, element, text in events(root):
        name = local_name(element)
        if kind == "text":
            parts.append(escape(text))
        elif kind == "end":
            parts.append(f"</{name}>")
        else:
            plain = ((key, str(value)) for key, value in element.attrib.items() if str(key).isalpha())
            parts.append(f"<{name}{''.join(f' {key}={quoteattr(value)}' for key, value in plain)}>")
    return "".join(parts)
