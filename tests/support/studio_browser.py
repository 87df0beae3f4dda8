"""A real browser for the pages of the studio, and what tests do in it."""

from __future__ import annotations

import importlib.util
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

__all__ = [
    "LOOKS", "ROOT", "TRANSFERRED", "addresses", "faults", "faults_of", "looked_at", "needs_axe", "needs_browser",
    "opened", "tab_to", "wider_than_narrow", "written",
]  # fmt: skip

ROOT = Path(__file__).resolve().parents[2]
CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
AXE = Path(os.environ.get("AXE_CORE", ROOT / "out/axe/node_modules/axe-core/axe.min.js"))
NEEDED = [name for name in ("playwright", "starlette", "uvicorn", "httpx2") if importlib.util.find_spec(name) is None]

needs_browser = pytest.mark.skipif(
    CHROMIUM is None or bool(NEEDED),
    reason=f"needs a browser ({CHROMIUM or 'sudo apt-get install chromium'}) and pip install {' '.join(NEEDED)}",
)
needs_axe = pytest.mark.skipif(not AXE.is_file(), reason="needs axe-core: npm install --prefix out/axe axe-core")

LOOKS: dict[str, dict[str, Any]] = {
    "light": {"color_scheme": "light"},
    "dark": {"color_scheme": "dark"},
    "forced": {"forced_colors": "active", "color_scheme": "dark"},
}
NARROW: dict[str, Any] = {"viewport": {"width": 320, "height": 640}, "reduced_motion": "reduce"}


# Bytes that came over the wire for the page as it stands.
TRANSFERRED = """() => [...performance.getEntriesByType("navigation"), ...performance.getEntriesByType("resource")]
  .reduce((sum, one) => sum + one.transferSize, 0)"""


@contextmanager
def opened(studio: Any) -> Iterator[Any]:
    """A page in a browser that was let in."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        page = browser.new_context(viewport={"width": 1280, "height": 900}).new_page()
        page.goto(studio.keys.first_address)
        yield page
        browser.close()


@contextmanager
def looked_at(page: Any, **how: Any) -> Iterator[Any]:
    """Another page of the same browser, in other colours, of another size, or without scripts."""
    context = page.context.browser.new_context(storage_state=page.context.storage_state(), **how)
    yield context.new_page()
    context.close()


def tab_to(page: Any, selector: str, most: int = 60) -> None:
    """Press Tab until that element has the focus."""
    for _ in range(most):
        page.keyboard.press("Tab")
        if page.evaluate("wanted => document.activeElement.matches(wanted)", selector):
            return
    raise AssertionError(f"{selector} is not reached by Tab")


def faults(page: Any) -> list[str]:
    """What axe-core finds, a line for each element."""
    if not page.evaluate("() => 'axe' in window"):
        # Not by a script tag: the pages allow scripts of their own alone.
        page.evaluate(AXE.read_text(encoding="utf-8"))
    found = page.evaluate("async () => (await axe.run(document)).violations")
    return [f"{one['id']}: {node['html'][:160]}" for one in found for node in one["nodes"]]


def addresses(studio: Any) -> list[str]:
    """The address of every page."""
    return [studio.keys.origin + one for one in ("/", *(f"/{page.name}" for page in studio.app.state.pages))]


def written(page: Any, studio: Any) -> str:
    """The address of a text that is written by keyboard alone."""
    page.goto(f"{studio.keys.origin}/write")
    tab_to(page, "#text")
    page.keyboard.type("Hello world")
    tab_to(page, "#find")
    page.keyboard.type("german contr")
    page.wait_for_selector("#table-1")
    tab_to(page, "main button.main")
    page.keyboard.press("Enter")
    page.wait_for_selector("#frames", timeout=120_000)
    return str(page.url)


def faults_of(page: Any, wanted: list[str], look: str) -> list[str]:
    """What axe-core finds on pages, with all that is folded opened."""
    found = []
    with looked_at(page, **LOOKS[look]) as other:
        for address in wanted:
            other.goto(address)
            other.evaluate("document.querySelectorAll('details').forEach(one => one.open = true)")
            found += [f"{address}: {fault}" for fault in faults(other)]
    return found


def wider_than_narrow(page: Any, wanted: list[str]) -> list[str]:
    """Pages that a window of 320 pixels does not hold without scrolling sideways."""
    with looked_at(page, **NARROW) as other:
        return [
            one for one in wanted if other.goto(one) and other.evaluate("document.documentElement.scrollWidth") > 320
        ]
