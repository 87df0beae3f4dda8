"""All icons of a set as a page that needs neither eyes nor a mouse: headings, words, Braille, links."""

from __future__ import annotations

import base64
import io
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ..plain import html_words
from .contact_sheet import figure_picture
from .report import IconsReport
from .set import Icon
from .words import in_braille, in_words

__all__ = ["icon_page"]

STYLE = """
:root { color-scheme: light dark; --ink: #14213d; --muted: #4a5468; --paper: #fff; --panel: #f1f4f7; --flat: #a9b3c1; }
@media (prefers-color-scheme: dark) {
  :root { --ink: #e8edf5; --muted: #b4bfd0; --paper: #10151f; --panel: #1b2331; --flat: #5c6980; }
}
* { box-sizing: border-box; }
body { margin: 0 auto; max-width: 90rem; padding: 1rem; background: var(--paper); color: var(--ink);
  font: 1rem/1.5 system-ui, sans-serif; }
a { color: inherit; }
a:focus-visible, summary:focus-visible { outline: 3px solid #c2410c; outline-offset: 2px; }
.skip { position: absolute; left: -99rem; }
.skip:focus { position: static; }
.set { list-style: none; margin: 0; padding: 0; display: grid; gap: 1rem;
  grid-template-columns: repeat(auto-fill, minmax(15rem, 1fr)); }
.set > li { background: var(--panel); border-radius: .5rem; padding: .75rem; }
.set > li:target { outline: 3px solid var(--ink); }
h2 { font-size: 1.25rem; } h3 { font-size: 1rem; margin: 0 0 .5rem; overflow-wrap: anywhere; }
.pair { display: flex; gap: .75rem; align-items: center; }
.pair > * { width: 6rem; height: 6rem; flex: none; object-fit: contain; }
.pair > img { border-radius: .25rem; image-rendering: auto; }
.full, .half, .flat { stroke: currentColor; stroke-linecap: round; }
.full { stroke-width: .8; } .half { stroke-width: .42; } .flat { stroke: var(--flat); stroke-width: .16; }
.braille { font-size: 1.5rem; line-height: 1.15; margin: .5rem 0; white-space: pre; }
p { margin: .25rem 0; } .muted { color: var(--muted); }
"""


def icon_page(report: IconsReport) -> str:
    """A page (HTML) with every icon: what it looks like, what is felt of it, and both in words.

    It can be read from top to bottom, by headings, or by following the links from an icon to the one it is most
    easily taken for. Nothing is said by colour or by a picture alone, and there is no script.
    """
    return "\n".join(_page(report)) + "\n"


def _page(report: IconsReport) -> Iterator[str]:
    count = len(report.icons)
    title = f"{count} icons on {html_words(report.device)}"
    yield '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">'
    yield '<meta name="viewport" content="width=device-width, initial-scale=1">'
    yield f"<title>{title}</title>\n<style>{STYLE}</style>\n</head>\n<body>"
    yield '<a class="skip" href="#icons">Skip to the icons</a>'
    yield f"<header><h1>{title}</h1>"
    yield f"<p>Mean similarity with the pictures: {report.similarity:.2f} of 1. "
    yield f"Icons with another one nearer than {report.closer_than} dots: {report.neighbours}.</p></header>\n<main>"
    places = {icon.name: place for place, icon in enumerate(report.icons)}
    yield from _close(report, places)
    yield '<h2 id="icons">Icons</h2>\n<ul class="set">'
    for icon in report.icons:
        yield from _card(icon, places)
    yield "</ul>"
    if report.failed:
        yield "<h2>Files that could not be used</h2>\n<ul>"
        yield from (
            f"<li><bdi>{html_words(name)}</bdi>: {html_words(error)}</li>" for name, error in report.failed.items()
        )
        yield "</ul>"
    yield "</main>\n</body>\n</html>"


def _close(report: IconsReport, places: dict[str, int]) -> Iterator[str]:
    if not report.close:
        return
    yield "<h2>Pairs that feel alike</h2>\n<ul>"
    for one, other, distance in report.close:
        links = (f'<a dir="auto" href="#icon-{places[name]}">{html_words(name)}</a>' for name in (one, other))
        yield f"<li>{' and '.join(links)}: {_dots(distance)}</li>"
    yield "</ul>"


def _dots(distance: int) -> str:
    return "equal" if distance == 0 else "1 dot differs" if distance == 1 else f"{distance} dots differ"


def _card(icon: Icon, places: dict[str, int]) -> Iterator[str]:
    words = html_words(in_words(icon.pattern.amplitude))
    yield f'<li id="icon-{places[icon.name]}"><h3 dir="auto">{html_words(icon.name)}</h3>'
    yield f'<div class="pair"><img alt="" src="{_embedded(icon.figure)}">{_drawn(icon.pattern.amplitude, words)}</div>'
    yield f'<p class="braille">{in_braille(icon.pattern.amplitude)}</p>'
    yield f"<details><summary>Pattern in words</summary><p>{words}</p></details>"
    plan = "can be made" if icon.outcome == "ok" else f"{icon.outcome}: {icon.note}"
    yield f'<p class="muted">Similarity {icon.pattern.similarity:.2f}; {html_words(plan)}.</p>'
    if icon.distance is not None:
        near = f'<a dir="auto" href="#icon-{places[icon.nearest]}">{html_words(icon.nearest)}</a>'
        yield f'<p class="muted">Nearest: {near}, {_dots(icon.distance)}.</p>'
    yield "</li>"


def _embedded(figure: NDArray[np.uint8]) -> str:
    file = io.BytesIO()
    Image.fromarray(figure_picture(figure)).save(file, "PNG")
    return "data:image/png;base64," + base64.b64encode(file.getvalue()).decode()


def _drawn(amplitude: NDArray[np.float64], words: str) -> str:
    """The pattern as an SVG of one path for each strength."""
    rows, cols = amplitude.shape
    paths = []
    for strength, name in ((0.0, "flat"), (0.5, "half"), (1.0, "full")):
        places = np.argwhere(amplitude == strength).tolist()
        if places:
            line = "".join(f"M{col + 0.5} {row + 0.5}h0" for row, col in places)
            paths.append(f'<path class="{name}" d="{line}"/>')
    return f'<svg role="img" aria-label="{words}" viewBox="0 0 {cols} {rows}">{"".join(paths)}</svg>'
