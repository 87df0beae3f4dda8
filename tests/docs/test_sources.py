"""The pages as they are written: headings, pictures, tables, links, and what they cite."""

from __future__ import annotations

import ast
import re
from itertools import pairwise
from pathlib import Path

import pytest

from tests.support.docs_pages import DOCS, EVERY, FENCE, PAGES, ROOT, anchor_of, generator, headings, prose, read

PACKAGES = ("chainsim", "encoders", "planner", "drivers", "dotwave")
CODE = [path for package in PACKAGES for path in (ROOT / package).rglob("*.py")]
PATH = re.compile(rf"`((?:samples|benchmarks|{'|'.join(PACKAGES)})/[\w./-]+)`")
SCHEMA = re.compile(r"dotwave/\w+/\d")

each_page = pytest.mark.parametrize("page", EVERY, ids=lambda page: page.name)


@each_page
def test_one_title_and_no_level_is_skipped(page: Path) -> None:
    levels = [level for level, _ in headings(page)]
    assert levels[0] == 1
    assert levels.count(1) == 1
    for before, after in pairwise(levels):
        assert after <= before + 1, f"{page.name}: a heading of level {after} below one of level {before}"


@each_page
def test_pictures_have_words(page: Path) -> None:
    for words, target in re.findall(r"!\[([^\]]*)\]\(([^)]+)\)", prose(page)):
        assert len(words) > 40, f"{target}: say what the picture shows"
    assert "<img" not in prose(page)


@each_page
def test_tables_have_a_name_for_every_column(page: Path) -> None:
    lines = prose(page).splitlines()
    for above, line in pairwise(lines):
        if re.fullmatch(r"\|(-+\|)+", line):
            cells = [cell.strip() for cell in above.strip().strip("|").split("|")]
            assert len(cells) == line.count("|") - 1
            assert all(cells), f"{page.name}: {above}"


@each_page
def test_links_and_anchors_resolve(page: Path) -> None:
    for target in re.findall(r"\]\(([^)]+)\)", prose(page)):
        if target.startswith(("http://", "https://")):
            continue
        file, _, anchor = target.partition("#")
        to = (page.parent / file).resolve() if file else page
        assert to.exists(), f"{page.name}: {target}"
        if anchor:
            assert anchor in anchors(to), f"{page.name}: {target}"


def anchors(page: Path) -> set[str]:
    """Of the headings that are written, and of those that are made of the commands."""
    written = {anchor_of(words) for _, words in headings(page)}
    if page.name == "cli.md":
        written |= {f"dotwave-{name}" for name in generator("commands").command_names()}
    return written


def test_every_page_is_in_the_navigation() -> None:
    listed = re.findall(r"^ +- (?:[\w ]+: )?(\w+\.md)$", read(ROOT / "mkdocs.yml"), flags=re.MULTILINE)
    assert sorted(listed) == [page.name for page in PAGES]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_tests_and_files_that_are_cited_exist(page: Path) -> None:
    for cited, name in re.findall(r"(tests/\w+\.py)(?:::(\w+))?", read(page)):
        source = ROOT / cited
        assert source.is_file(), f"{page.name}: {cited}"
        assert not name or f"def {name}(" in read(source), f"{page.name}: {cited}::{name}"
    for cited in PATH.findall(read(page)):
        assert (ROOT / cited).exists() or "NAME" in cited or SCHEMA.fullmatch(cited), f"{page.name}: {cited}"


def test_sections_that_docstrings_cite_exist() -> None:
    sections = {words.split()[0].rstrip(".") for _, words in headings(DOCS / "theory.md") if words[0].isdigit()}
    cited = [
        (path, section)
        for path in CODE
        for section in re.findall(r"theory\.md\s+section\s+([\d.]*\d)", " ".join(read(path).split()))
    ]
    assert len(cited) >= 8
    for path, section in cited:
        assert section in sections, f"{path}: section {section}"


def test_no_docstring_cites_a_page_that_is_not_there() -> None:
    for path in CODE:
        for page in re.findall(r"\b(\w+\.md)\b", _docstrings(path)):
            assert (DOCS / page).is_file() or list(ROOT.rglob(page)), f"{path}: {page}"


def _docstrings(path: Path) -> str:
    nodes = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
    return "\n".join(ast.get_docstring(one) or "" for one in ast.walk(ast.parse(read(path))) if isinstance(one, nodes))


def test_names_of_the_glossary_are_names_of_the_program_in_order() -> None:
    rows = re.findall(r"^\| ([^|]+) \| ([^|]*?) ?\| [^|]+ \|$", read(DOCS / "glossary.md"), flags=re.MULTILINE)[1:]
    words = [word.lower() for word, _ in rows]
    assert words == sorted(words)
    assert len(words) == len(set(words))
    source = "\n".join(map(read, CODE)) + "\n".join(str(path.relative_to(ROOT)) for path in CODE)
    known = set(re.findall(r"\w+", source))
    for word, code in rows:
        for name in re.findall(r"`([\w.]+)`", code):
            assert set(name.split(".")) <= known, f"{word}: {name}"


@each_page
def test_fences_are_closed_and_say_their_language(page: Path) -> None:
    text = read(page)
    assert "```" not in FENCE.sub("", text), f"{page.name}: a fence without an end"
    assert all(match[1] for match in FENCE.finditer(text)), f"{page.name}: a fence without a language"
