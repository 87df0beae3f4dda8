"""What elements of HTML, XHTML and DTBook mean for reading, by their local names."""

from __future__ import annotations

from .model import Emphasis

__all__ = ["BLOCKS", "CELLS", "EMPHASES", "HEADINGS", "KEPT_LINES", "LISTS", "SKIPPED", "SKIPPED_ROLES"]

HEADINGS = {f"h{level}": level for level in range(1, 7)} | {"doctitle": 1, "bridgehead": 3, "hd": 3}
EMPHASES = {
    "i": Emphasis.ITALIC, "em": Emphasis.ITALIC, "cite": Emphasis.ITALIC, "dfn": Emphasis.ITALIC,
    "var": Emphasis.ITALIC, "b": Emphasis.BOLD, "strong": Emphasis.BOLD, "u": Emphasis.UNDERLINE,
    "ins": Emphasis.UNDERLINE,
}  # fmt: skip
LISTS = {"ul", "ol", "menu", "list"}
CELLS = {"td", "th"}
KEPT_LINES = {"pre", "listing", "xmp"}
BLOCKS = {
    "address", "article", "aside", "author", "blockquote", "body", "bodymatter", "book", "caption", "center", "dd",
    "details", "dialog", "div", "dl", "docauthor", "dt", "epigraph", "fieldset", "figcaption", "figure", "footer",
    "form", "frontmatter", "header", "hgroup", "hr", "html", "imggroup", "legend", "level", "level1", "level2",
    "level3", "level4", "level5", "level6", "li", "linegroup", "main", "nav", "note", "p", "poem", "prodnote",
    "rearmatter", "search", "section", "sidebar", "summary", "table", "tbody", "tfoot", "thead", "tr",
    *HEADINGS, *LISTS, *KEPT_LINES,
}  # fmt: skip
SKIPPED = {
    "audio", "button", "canvas", "colgroup", "datalist", "embed", "iframe", "input", "object", "pagenum", "rp", "rt",
    "script", "select", "style", "svg", "template", "textarea", "title", "video", "annotation", "annotation-xml",
}  # fmt: skip
SKIPPED_ROLES = {"pagebreak", "doc-pagebreak"}
