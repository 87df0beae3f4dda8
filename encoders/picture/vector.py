"""Drawing SVG: a tame copy of the document is made first, and only that is given to the renderer.

The renderer follows references to local files, and huge numbers, patterns, filters and deep nesting make it stop the
whole process. So only plain shapes, gradients, clips, masks and references inside the document are let through.
"""

from __future__ import annotations

import base64
import io
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING
from urllib.parse import unquote_to_bytes
from xml.etree.ElementTree import ParseError, XMLParser
from xml.sax.saxutils import escape, quoteattr

from .errors import EmptyPicture, PictureBroken, PictureError, PictureTooLarge, RendererMissing
from .limits import BROKEN, PictureLimits
from .vector_weight import BITMAP, DEEPEST, STYLES, Weight, Weights, weight_of_sheets

if TYPE_CHECKING:
    from PIL.Image import Image


__all__ = ["Drawing", "draw_svg", "tame_svg"]

SVG = "http://www.w3.org/2000/svg"
XLINK_HREF = "{http://www.w3.org/1999/xlink}href"
SHAPES = {"circle", "ellipse", "line", "path", "polygon", "polyline", "rect", "use", "image"}
KEPT = SHAPES | {
    "a", "clipPath", "defs", "g", "linearGradient", "mask", "radialGradient", "stop", "style", "svg", "switch",
    "symbol",
}  # fmt: skip
SILENT = {"title", "desc", "metadata"}
GEOMETRY = {
    "cx", "cy", "d", "fr", "fx", "fy", "gradientTransform", "height", "points", "r", "rx", "ry", "stroke-width",
    "style", "transform", "viewBox", "width", "x", "x1", "x2", "y", "y1", "y2",
}  # fmt: skip
PATHS = ("d", "points")
# Dashes are felt as lines, so they are drawn as such.
DROPPED = ("stroke-dash", "marker", "filter", "on")
LARGEST = 1e6
# What is told of a document with very many or very long names.
MOST_NOTES, LONGEST_NAME = 20, 40
# Of all embedded bitmaps together.
EMBEDDED_PIXELS = 4_000_000
EMBEDDED_LONGEST = 512

_SUSPECT = re.compile(r"\d{7}|\d\.?[eE][-+]?\d")
_NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")
_COLOUR = re.compile(r"#[0-9a-fA-F]+")
# None of these looks twice at what it has passed: a sheet of a megabyte takes no longer than it is long.
_URL = re.compile(r"url\(([^)]*+)(?:\)|\Z)")
_COMMENT = re.compile(r"/\*.*?(?:\*/|\Z)", re.DOTALL)
_CSS = re.compile(r"(?:stroke-dash(?:array|offset)|marker(?:-start|-mid|-end)?|filter)\s*+:[^;}\"]*+;?|@import[^;]*+;?")


@dataclass(frozen=True)
class Drawing:
    """A drawn SVG: an RGBA Pillow image, and what was left out."""

    image: Image
    notes: tuple[str, ...]


def draw_svg(name: str, data: bytes, longest_px: int, limits: PictureLimits) -> Drawing:
    """Draw an SVG document, without fonts and without reading anything outside of it.

    Raises
    ------
    PictureBroken
        When it is not XML, not SVG, or the renderer refuses it.
    PictureTooLarge
        When it has more shapes or points, or greater numbers, than the limits allow.
    RendererMissing
        When resvg-py is not installed.
    """
    text, notes = tame_svg(name, data, limits)
    try:
        import resvg_py
    except ImportError:
        raise RendererMissing(f"{name}: SVG needs resvg-py; install it by: pip install resvg-py") from None
    from PIL import Image

    try:
        png = resvg_py.svg_to_bytes(
            svg_string=text, width=longest_px, height=longest_px, skip_system_fonts=True, log_information=False
        )
    except (ValueError, OSError, RuntimeError) as error:
        raise PictureBroken(f"{name}: this SVG cannot be drawn: {' '.join(str(error).split())[:120]}") from None
    except BaseException as error:
        # A failed check inside the renderer; its class cannot be imported.
        if type(error).__name__ != "PanicException":
            raise
        raise PictureBroken(f"{name}: this SVG cannot be drawn: the renderer gave up; simplify the drawing") from None
    image = Image.open(io.BytesIO(png))
    image.load()
    return Drawing(image, notes)


def tame_svg(name: str, data: bytes, limits: PictureLimits) -> tuple[str, tuple[str, ...]]:
    """The document with what is safe and can be felt, and notes on what was left out.

    Text, patterns (drawn as grey), filters, markers, dashes, scripts and everything outside the document are
    left out; embedded bitmaps are decoded here and handed on as plain PNG.

    Raises
    ------
    PictureBroken, PictureTooLarge, EmptyPicture
        As `draw_svg` does; empty when no shape is left.
    """
    tamer = _Tamer(limits)
    parser = XMLParser(target=tamer)
    try:
        parser.feed(data)
        parser.close()
    except ParseError as error:
        line, column = error.position
        raise PictureBroken(f"{name}:{line}: not XML at column {column}: {str(error).split(':')[0]}") from None
    except (ValueError, LookupError) as error:
        if isinstance(error, PictureError):
            raise type(error)(f"{name}: {error}") from None
        raise PictureBroken(f"{name}: not XML: {' '.join(str(error).split())[:120]}") from None
    _check(name, tamer, limits)
    return "".join(tamer.out), tuple(tamer.notes)


def _check(name: str, tamer: _Tamer, limits: PictureLimits) -> None:
    try:
        drawn = tamer.drawn()
    except PictureTooLarge as error:
        raise PictureTooLarge(f"{name}: {error}") from None
    if drawn.elements > limits.svg_elements:
        raise PictureTooLarge(f"{name}: draws more than {limits.svg_elements} elements; simplify the drawing")
    if drawn.points > limits.svg_points:
        raise PictureTooLarge(
            f"{name}: it takes as long to draw as a path of {drawn.points} points; at most {limits.svg_points} are "
            "drawn, simplify the drawing"
        )
    if not drawn.elements:
        left_out = f" ({'; '.join(tamer.notes)})" if tamer.notes else ""
        raise EmptyPicture(f"{name}: the SVG draws no shape{left_out}; turn text into paths")


class _Tamer:
    """A target of the XML parser that writes the tame document while the given one is read."""

    def __init__(self, limits: PictureLimits) -> None:
        self.limits = limits
        self.out: list[str] = []
        self.notes: dict[str, None] = {}
        self._open: list[str] = []
        self._style: list[str] = []
        self._sheets: list[str] = []
        self._elements = self._deepest = 0
        self._weights = Weights()
        self._owners: list[str] = [""]
        self._draws = False
        self._skipping = self._embedded = 0
        self._length = 0

    def start(self, tag: str, attributes: dict[str, str]) -> None:
        """Write an element, or begin to skip it."""
        if self._skipping or self._open[-1:] == ["style"]:
            self._skipping += 1
            return
        space, _, name = tag.rpartition("}")
        if not self._open and name != "svg":
            raise PictureBroken(
                f"the outermost element is <{name[:LONGEST_NAME]}>, not <svg>; {'' if space else 'give an SVG'}"
            )
        known = space in {"", "{" + SVG}
        if known and name == "pattern" and "id" in attributes:
            self._note("patterns are drawn as grey")
            ident = quoteattr(attributes["id"])
            self._write(f'<linearGradient id={ident}><stop stop-color="#808080"/></linearGradient>')
        if not known or name not in KEPT:
            if known and name not in SILENT:
                self._note(f"<{name[:LONGEST_NAME]}> is left out")
            self._skipping = 1
            return
        if len(self._open) >= DEEPEST:
            raise PictureTooLarge(f"more than {DEEPEST} elements inside one another; flatten the drawing")
        kept = self._attributes(name, attributes)
        if name == "image" and not self._embed(kept):
            self._skipping = 1
            return
        self._open.append(name)
        self._elements += 1
        self._deepest = max(self._deepest, len(self._open))
        self._owners.append(attributes.get("id", "") or self._owners[-1])
        self._count(name, attributes)
        namespace = f' xmlns="{SVG}"' if len(self._open) == 1 else ""
        self._write(f"<{name}{namespace}{''.join(f' {key}={quoteattr(value)}' for key, value in kept.items())}>")

    def end(self, tag: str) -> None:
        """Close an element."""
        if self._skipping:
            self._skipping -= 1
            return
        self._owners.pop()
        self._end_style()
        self._write(f"</{self._open.pop()}>")

    def data(self, text: str) -> None:
        """Keep style sheets, which come in pieces; other text draws nothing."""
        if not self._skipping and self._open and self._open[-1] == "style":
            self._style.append(text)

    def _end_style(self) -> None:
        text = self._css("".join(self._style))
        self._style.clear()
        if text:
            self._sheets.append(text)
            self._weights.add(STYLES, Weight(), self._links(text))
            self._write(escape(text))

    def close(self) -> None:
        """End of the document."""

    def drawn(self) -> Weight:
        """What is drawn in all, references followed; nothing when there is no shape."""
        if not self._draws:
            return Weight()
        return self._weights.total() + weight_of_sheets("\n".join(self._sheets), self._elements, self._deepest)

    def _note(self, words: str) -> None:
        if len(self.notes) < MOST_NOTES:
            self.notes[words] = None

    def _write(self, text: str) -> None:
        self._length += len(text)
        if self._length > 2 * self.limits.svg_bytes:
            raise PictureTooLarge("its entities expand to too much text; simplify the drawing")
        self.out.append(text)

    def _count(self, name: str, attributes: dict[str, str]) -> None:
        owner, parent = self._owners[-1], self._owners[-2]
        self._draws |= name in SHAPES
        links = [target for value in attributes.values() for target in self._links(value)]
        link = attributes.get("href", attributes.get(XLINK_HREF, ""))
        if link.startswith("#"):
            links.append(link[1:])
        points = sum(len(_NUMBER.findall(attributes.get(key, ""))) for key in PATHS) // 2
        # Declarations of one element are each held against all before.
        declarations = attributes.get("style", "").count(";")
        itself = BITMAP if name == "image" else Weight(1, points**2 + declarations**2)
        self._weights.add(owner, itself, [*links, STYLES])
        if owner != parent:
            self._weights.add(parent, Weight(), [owner])

    @staticmethod
    def _links(text: str) -> list[str]:
        return [target[1:] for target in map(_target, _URL.findall(text)) if target.startswith("#")]

    def _attributes(self, name: str, given: dict[str, str]) -> dict[str, str]:
        kept: dict[str, str] = {}
        for key, value in given.items():
            if key in {"href", XLINK_HREF}:
                if value.startswith("#") or (name == "image" and value.lstrip()[:5].lower() == "data:"):
                    kept["href"] = value
                elif name in SHAPES:
                    self._note("references outside the document are not followed")
            elif "}" not in key and not key.startswith(DROPPED):
                kept[key] = self._css(value) if key == "style" or "url" in value else value
                if key in GEOMETRY:
                    self._bound(key, value)
        return kept

    def _css(self, text: str) -> str:
        """Style declarations without dashes, filters, markers and links that leave the document."""

        def inside(match: re.Match[str]) -> str:
            return match.group(0) if _target(match.group(1)).startswith("#") else "none"

        text = _URL.sub(inside, _CSS.sub("", _COMMENT.sub("", text)))
        self._bound("style", text)
        return text

    def _bound(self, key: str, value: str) -> None:
        if not _SUSPECT.search(value):
            return
        for number in _NUMBER.findall(_COLOUR.sub("", value)):
            if abs(float(number)) > LARGEST:
                raise PictureTooLarge(f"{key}: the number {number[:20]} is above {LARGEST:g}; scale the drawing")

    def _embed(self, kept: dict[str, str]) -> bool:
        """Replace an embedded bitmap by a plain PNG; False when there is none that can be read."""
        from PIL import Image

        head, _, body = kept.get("href", "").partition(",")
        try:
            raw = base64.b64decode(body) if head.endswith(";base64") else unquote_to_bytes(body)
            with Image.open(io.BytesIO(raw), formats=("PNG", "JPEG", "GIF", "WEBP")) as bitmap:
                self._embedded += bitmap.width * bitmap.height
                if self._embedded > EMBEDDED_PIXELS:
                    raise PictureTooLarge(f"embedded bitmaps of more than {EMBEDDED_PIXELS} pixels; scale them down")
                plain = bitmap.convert("RGBA")
        except PictureTooLarge:
            raise
        except (*BROKEN, Image.DecompressionBombError):
            self._note("<image> is left out")
            return False
        plain.thumbnail((EMBEDDED_LONGEST, EMBEDDED_LONGEST))
        buffer = io.BytesIO()
        plain.save(buffer, "PNG", compress_level=1)
        kept["href"] = "data:image/png;base64," + base64.b64encode(buffer.getvalue()).decode()
        return True


def _target(inside: str) -> str:
    """What stands between the brackets of ``url()``, without quotes."""
    return inside.strip().strip("'\"").strip()
