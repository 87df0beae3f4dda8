"""What the package of an icon font says of its icons: label, code point, category."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path, PurePosixPath
from typing import Any

from .archives import ARCHIVES, BROKEN, members
from .sources import IconPlace

__all__ = ["told_of"]

Told = dict[str, str]

# Files as packages of icon fonts have them, by the end of their names; what else is JSON is not opened.
FILES = ("codepoints.json", "icons.json", "icon-families.json", "metadata.json", "glyph.json", "bootstrap-icons.json")
MOST_BYTES = 1 << 26
LONGEST = 80
HIGHEST = 0x10FFFF


def told_of(places: Sequence[IconPlace]) -> dict[str, Told]:
    """Of each icon that a package tells of, by its name: ``label``, ``code_point`` (U+...), ``category``.

    The package is the archive or the folder in which the icon is; its JSON files name icons by the stems of their
    files. A file that cannot be read tells nothing.
    """
    known = {container: _known(container) for container in {place.container for place in places if place.member}}
    found = {}
    for place in places:
        path = PurePosixPath(place.member)
        told = known.get(place.container, {}).get(path.stem)
        if told is not None:
            found[place.name] = _row(told, path.parent.name)
    return {name: row for name, row in found.items() if row}


def _known(container: Path) -> dict[str, list[Any]]:
    """Of each stem what the files say, one entry a file."""
    known: dict[str, list[Any]] = {}
    for read in _files(container):
        try:
            data = json.loads(read(MOST_BYTES))
        except (*BROKEN, RecursionError):
            continue
        if isinstance(data, dict):
            for stem, told in data.items():
                known.setdefault(stem, []).append(told)
    return known


def _files(container: Path) -> Iterator[Callable[[int], bytes]]:
    if container.is_dir():
        for path in sorted(container.rglob("*.json")):
            if path.name.endswith(FILES) and path.is_file():
                yield partial(_first, path)
    elif container.name.lower().endswith(ARCHIVES):
        try:
            for name, first in members(container):
                if name.endswith(FILES):
                    yield first
        except BROKEN:
            return


def _first(path: Path, most: int) -> bytes:
    with path.open("rb") as file:
        return file.read(most)


def _row(told: Sequence[Any], folder: str) -> Told:
    row: Told = {}
    for one in told:
        if not isinstance(one, dict):
            found = {"code_point": _code_point(one, base=10)}
        else:
            styles = one.get("styles")
            style = styles.get(folder) if isinstance(styles, dict) else None
            parts = [part for part in (one, style) if isinstance(part, dict)]
            codes = [_code_point(_first_of(part, "unicode", "codepoint", "code"), base=16) for part in parts]
            found = {
                "label": _words(_first_of(one, "label", "title")),
                "code_point": next(filter(None, codes), ""),
                "category": _words(_first_of(one, "category", "categories")),
            }
        row |= {key: value for key, value in found.items() if value}
    return row


def _first_of(told: Mapping[str, Any], *keys: str) -> Any:
    return next((told[key] for key in keys if key in told), None)


def _code_point(value: Any, base: int) -> str:
    """A number, or its digits in hex."""
    try:
        code = value if isinstance(value, int) else int(str(value).removeprefix("U+"), base)
    except ValueError:
        return ""
    return f"U+{code:04X}" if 0 < code <= HIGHEST and not isinstance(value, bool) else ""


def _words(value: Any) -> str:
    parts = value if isinstance(value, list) else [value]
    return ", ".join(part for part in parts if isinstance(part, str))[:LONGEST]
