"""What the tests of the documentation have in common: the pages, their code blocks, headings and links."""

from __future__ import annotations

import importlib.util
import re
import sys
from pathlib import Path
from types import ModuleType
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
README = ROOT / "README.md"
PAGES = sorted(DOCS.glob("*.md"))
EVERY = [README, *PAGES, ROOT / "drivers" / "PROTOCOL.md"]
FENCE = re.compile(r"^```(\w*)\n(.*?)^```$", flags=re.MULTILINE | re.DOTALL)


class Block(NamedTuple):
    """A fenced block: where it is, its language and its text."""

    page: Path
    language: str
    text: str

    @property
    def name(self) -> str:
        return f"{self.page.name}: {self.text.splitlines()[0][:50]}"


def read(page: Path) -> str:
    return page.read_text(encoding="utf-8")


def prose(page: Path) -> str:
    """The page without its code blocks."""
    return FENCE.sub("", read(page))


def blocks(language: str, pages: list[Path] | None = None) -> list[Block]:
    found = ((page, match) for page in pages or EVERY for match in FENCE.finditer(read(page)))
    return [Block(page, match[1], match[2]) for page, match in found if match[1] == language]


def headings(page: Path) -> list[tuple[int, str]]:
    return [(len(signs), words) for signs, words in re.findall(r"^(#+) (.*)$", prose(page), flags=re.MULTILINE)]


def anchor_of(heading: str) -> str:
    """The anchor that mkdocs, and a host of the repository, make of a heading."""
    words = re.sub(r"[`*]", "", heading).lower()
    return re.sub(r"[-\s]+", "-", re.sub(r"[^\w\s-]", "", words)).strip("-")


def generator(name: str) -> ModuleType:
    """A module of docs/generators."""
    spec = importlib.util.spec_from_file_location(f"docs_{name}", DOCS / "generators" / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module
