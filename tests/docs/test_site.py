"""The built site: it builds without a warning, its links and anchors resolve, and what is made stands in it."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest

from tests.support.docs_pages import DOCS, generator
from tests.support.docs_site import built, needs_mkdocs, pages

pytestmark = needs_mkdocs


class Page(HTMLParser):
    """Of one page: places, links, text, the language, and tables without header cells."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.ids: set[str] = set()
        self.links: list[str] = []
        self.words: list[str] = []
        self.language = ""
        self.levels: list[int] = []
        self.pictures_without_words = 0
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = dict(attrs)
        self.ids |= {value for name in ("id", "name") if (value := given.get(name))}
        self.links += [value for name in ("href", "src") if (value := given.get(name))]
        if tag == "html":
            self.language = given.get("lang") or ""
        if tag == "img" and "alt" not in given:
            self.pictures_without_words += 1
        if len(tag) == 2 and tag[0] == "h" and tag[1].isdigit():
            self.levels.append(int(tag[1]))

    def handle_data(self, data: str) -> None:
        self.words.append(data)


@pytest.fixture(scope="module")
def site() -> Iterator[Path]:
    folder = built()
    yield folder
    shutil.rmtree(folder, ignore_errors=True)
    built.cache_clear()


def read(site: Path) -> dict[str, Page]:
    return {name: Page((site / name).read_text(encoding="utf-8")) for name in pages(site)}


def test_every_link_and_anchor_resolves(site: Path) -> None:
    found = read(site)
    assert len(found) >= len(list(DOCS.glob("*.md")))
    for name, page in found.items():
        for link in page.links:
            parts = urlsplit(link)
            if parts.scheme or parts.netloc or name == "404.html":
                continue
            to = (site / name).parent / unquote(parts.path) if parts.path else site / name
            assert to.exists(), f"{name}: {link}"
            target = str(to.resolve().relative_to(site.resolve()))
            if parts.fragment and target in found:
                assert unquote(parts.fragment) in found[target].ids, f"{name}: {link}"


def test_nothing_is_fetched_from_elsewhere(site: Path) -> None:
    for name in pages(site):
        text = (site / name).read_text(encoding="utf-8")
        assert 'src="http' not in text, name
        assert "fonts.googleapis" not in text, name


def test_the_pages_are_for_everybody(site: Path) -> None:
    for name, page in read(site).items():
        assert page.language, name
        assert not page.pictures_without_words, name
        assert page.levels.count(1) == 1, name


def test_every_option_and_public_name_is_on_its_page(site: Path) -> None:
    commands = generator("commands").commands()
    words = "\n".join(read(site)["cli.html"].words)
    for name, command in commands.items():
        assert f"dotwave {name}" in words
        for parameter in command.params:
            assert parameter.param_type_name == "argument" or parameter.opts[0] in words, f"{name}: {parameter.opts}"
    words = "\n".join(read(site)["python.html"].words)
    for package in generator("api").PACKAGES:
        assert all(one in words for one in __import__(package).__all__), package
    assert "<!-- made" not in "".join((site / name).read_text(encoding="utf-8") for name in pages(site))


def test_the_protocol_is_included(site: Path) -> None:
    assert {"kinds", "silence"} <= read(site)["firmware.html"].ids
