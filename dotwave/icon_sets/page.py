"""All icons of a set as a page that needs neither eyes nor a mouse: headings, words, Braille, links."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from ..plain import html_words
from .page_parts import FORM, SCRIPT, STYLE
from .report import IconsReport
from .set import Icon
from .sprites import Sprites
from .words import in_braille, in_words

__all__ = ["icon_page"]


def icon_page(report: IconsReport) -> str:
    """A page (HTML) with every icon: what it looks like, what is felt of it, and both in words.

    Icons that feel equal stand together. It can be read from top to bottom, by headings, or by following the links
    from an icon to the one it is most easily taken for; a search field and two filters work by keyboard. Nothing is
    said by colour or by a picture alone, and without scripts only the filters are missing.
    """
    return "\n".join(_page(report)) + "\n"


def _page(report: IconsReport) -> Iterator[str]:
    title = f"{len(report.icons)} icons on {html_words(report.device)}"
    yield '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">'
    yield '<meta name="viewport" content="width=device-width, initial-scale=1">'
    sprites = Sprites([icon.figure for icon in report.icons]) if report.icons else None
    yield f"<title>{title}</title>\n<style>{STYLE}{sprites.style if sprites else ''}</style>\n</head>\n<body>"
    yield '<a class="skip" href="#icons">Skip to the icons</a>'
    yield f"<header><h1>{title}</h1>"
    yield f"<p>Mean similarity with the pictures: {report.similarity:.2f} of 1. In doubt: {report.doubted}. "
    yield f"Icons with another one nearer than {report.closer_than} dots: {report.neighbours}.</p></header>\n<main>"
    yield f'<h2 id="icons">Icons</h2>\n{FORM}\n<ul class="set">'
    places = {icon.name: place for place, icon in enumerate(report.icons)}
    if sprites:
        for group in _equal(report.icons):
            yield "".join(_card(group, places, sprites))
    yield "</ul>"
    yield from _close(report, places)
    if report.failed:
        yield "<h2>Files that could not be used</h2>\n<ul>"
        yield from (
            f"<li><bdi>{html_words(name)}</bdi>: {html_words(error)}</li>" for name, error in report.failed.items()
        )
        yield "</ul>"
    yield f"</main>\n{SCRIPT}\n</body>\n</html>"


def _equal(icons: Sequence[Icon]) -> Iterator[list[Icon]]:
    """Icons with equal patterns together, where the first of them stands."""
    groups: dict[bytes, list[Icon]] = {}
    for icon in icons:
        groups.setdefault(icon.pattern.amplitude.tobytes(), []).append(icon)
    yield from groups.values()


def _close(report: IconsReport, places: dict[str, int]) -> Iterator[str]:
    if not report.close:
        return
    yield f"<h2>Pairs that feel alike</h2>\n<details><summary>{len(report.close)} pairs</summary>\n<ul>"
    for one, other, distance in report.close:
        links = (f'<a dir="auto" href="#icon-{places[name]}">{html_words(name)}</a>' for name in (one, other))
        yield f"<li>{' and '.join(links)}: {_dots(distance)}</li>"
    yield "</ul>\n</details>"


def _dots(distance: int) -> str:
    return "equal" if distance == 0 else "1 dot differs" if distance == 1 else f"{distance} dots differ"


def _card(group: Sequence[Icon], places: dict[str, int], sprites: Sprites) -> Iterator[str]:
    amplitude = group[0].pattern.amplitude
    words = html_words(in_words(amplitude))
    find = html_words(" ".join(f"{icon.name} {icon.label} {icon.category}" for icon in group).lower())
    doubt = " ".join(sorted({"yes" if icon.doubt else "no" for icon in group}))
    least = min(icon.pattern.similarity for icon in group)
    yield f'<li data-find="{find}" data-doubt="{doubt}" data-least="{least:.3f}" data-count="{len(group)}">'
    yield f'<div class="row">{_drawn(amplitude, words)}<p class="braille">{in_braille(amplitude)}</p>'
    for icon in group:
        yield f'<div class="one" id="icon-{places[icon.name]}">{sprites.drawn(places[icon.name])}<div>'
        yield f'<h3 dir="auto">{html_words(icon.name)}</h3>{_facts(icon, places)}</div></div>'
    yield f"</div><details><summary>Pattern in words</summary><p>{words}</p></details></li>"


def _facts(icon: Icon, places: dict[str, int]) -> str:
    plan = "can be made" if icon.outcome == "ok" else f"{icon.outcome}: {icon.note}"
    facts = [f"Similarity {icon.pattern.similarity:.2f}; {html_words(plan)}."]
    told = ", ".join(part for part in (icon.label, icon.code_point, icon.category) if part)
    if told:
        facts.append(f"<bdi>{html_words(told)}</bdi>.")
    if icon.same_as:
        facts.append(f"The same file as <bdi>{html_words(icon.same_as)}</bdi>.")
    if icon.distance:
        near = f'<a dir="auto" href="#icon-{places[icon.nearest]}">{html_words(icon.nearest)}</a>'
        facts.append(f"Nearest: {near}, {_dots(icon.distance)}.")
    doubt = f"<p><strong>Doubt:</strong> {html_words(icon.doubt)}</p>" if icon.doubt else ""
    return f'{doubt}<p class="muted">{" ".join(facts)}</p>'


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
