"""The studio in a real browser: by keyboard alone, without a fault that axe-core finds, narrow, quick."""

from __future__ import annotations

import importlib.util
import os
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[3]
CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
AXE = Path(os.environ.get("AXE_CORE", ROOT / "out/axe/node_modules/axe-core/axe.min.js"))
NEEDED = [name for name in ("playwright", "starlette", "uvicorn", "httpx2") if importlib.util.find_spec(name) is None]

pytestmark = [
    pytest.mark.skipif(CHROMIUM is None, reason="needs a browser: sudo apt-get install chromium"),
    pytest.mark.skipif(bool(NEEDED), reason=f"needs {', '.join(NEEDED)}: pip install"),
]
needs_axe = pytest.mark.skipif(not AXE.is_file(), reason="needs axe-core: npm install --prefix out/axe axe-core")

LOOKS: dict[str, dict[str, Any]] = {
    "light": {"color_scheme": "light"},
    "dark": {"color_scheme": "dark"},
    "forced": {"forced_colors": "active", "color_scheme": "dark"},
}


@pytest.fixture(scope="module")
def studio(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    from tests.support.studio import served

    with served(tmp_path_factory.mktemp("studio")) as running:
        yield running


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        started = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield started
        started.close()


@pytest.fixture(scope="module")
def page(browser: Any, studio: Any) -> Iterator[Any]:
    """A page that was let in."""
    context = browser.new_context(viewport={"width": 1280, "height": 900})
    opened = context.new_page()
    opened.goto(studio.keys.first_address)
    yield opened
    context.close()


@pytest.fixture(scope="module")
def written(page: Any, studio: Any) -> str:
    """The address of a text that was written by keyboard alone."""
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
    return ["/", *(f"/{one.name}" for one in studio.app.state.pages)]


def test_a_text_is_written_by_keyboard_alone(page: Any, written: str) -> None:
    page.goto(written)
    assert "all is felt as it should be" in page.inner_text("main")
    assert page.inner_text("#frames li:nth-child(1) .cells") == "⠠⠓⠑\n⠇⠇⠕"
    tab_to(page, "[data-on]")
    page.keyboard.press("Enter")
    assert page.inner_text("[data-where]") == "Frame 2 of 2: world"
    assert page.evaluate("document.activeElement.matches('[data-on]')")
    tab_to(page, "a[download]")
    with page.expect_download() as download:
        page.keyboard.press("Enter")
    assert download.value.suggested_filename.startswith("write-")


def test_a_setting_is_tried_by_keyboard_alone(page: Any, studio: Any) -> None:
    page.goto(f"{studio.keys.origin}/chain")
    before = page.inner_text("#answer [data-summary]")
    tab_to(page, "#omega-slider")
    page.keyboard.press("ArrowLeft")
    page.wait_for_function("old => document.querySelector('#answer [data-summary]').innerText !== old", arg=before)
    assert page.input_value("#omega") == "0.9995"
    assert page.evaluate("document.activeElement.id") == "omega-slider"
    tab_to(page, "#n")
    page.keyboard.type("x")
    page.wait_for_selector("#answer .error")
    assert "Oscillators: expected a whole number" in page.inner_text("#answer .error")


def test_stop_is_the_first_stop_of_the_tab_key(page: Any, studio: Any) -> None:
    for address in addresses(studio):
        page.goto(studio.keys.origin + address)
        page.keyboard.press("Tab")
        assert page.evaluate("document.activeElement.id") == "stop", address
        page.keyboard.press("Tab")
        page.keyboard.press("Enter")
        assert page.evaluate("document.activeElement.id") == "main", address


@needs_axe
@pytest.mark.parametrize("look", LOOKS)
def test_no_fault_on_any_page(browser: Any, page: Any, studio: Any, written: str, look: str) -> None:
    context = browser.new_context(storage_state=page.context.storage_state(), **LOOKS[look])
    other = context.new_page()
    found = []
    for address in (*addresses(studio), "/nothing", "/write?find=german", "/chain?omega=x", "/chain?omega=0.995"):
        other.goto(studio.keys.origin + address)
        found += [f"{address}: {fault}" for fault in faults(other)]
    other.goto(written)
    other.evaluate("document.querySelectorAll('details').forEach(one => one.open = true)")
    found += [f"written: {fault}" for fault in faults(other)]
    context.close()
    assert not found, "\n".join(found[:40])


@needs_axe
def test_a_planted_fault_is_found(page: Any, studio: Any) -> None:
    page.goto(f"{studio.keys.origin}/write")
    page.evaluate("document.querySelector('label[for=text]').remove()")
    page.evaluate("document.documentElement.removeAttribute('lang')")
    found = {fault.split(":")[0] for fault in faults(page)}
    assert {"label", "html-has-lang"} <= found


def test_nothing_is_wider_than_a_narrow_window(browser: Any, page: Any, studio: Any, written: str) -> None:
    context = browser.new_context(
        storage_state=page.context.storage_state(), viewport={"width": 320, "height": 640}, reduced_motion="reduce"
    )
    narrow = context.new_page()
    for address in [*(studio.keys.origin + one for one in addresses(studio)), written]:
        narrow.goto(address)
        assert narrow.evaluate("document.documentElement.scrollWidth") <= 320, address
    context.close()


def test_the_pages_work_without_scripts(browser: Any, page: Any, studio: Any, written: str) -> None:
    context = browser.new_context(storage_state=page.context.storage_state(), java_script_enabled=False)
    plain = context.new_page()
    plain.goto(f"{studio.keys.origin}/chain")
    plain.fill("#epsilon", "0")
    plain.click("main button")
    assert "epsilon=0" in plain.url
    plain.goto(written)
    assert plain.locator("#frames > li").count() == 2
    context.close()


def test_the_first_page_is_light(page: Any, studio: Any) -> None:
    sizes: list[int] = []
    page.on("response", lambda answer: sizes.append(len(answer.body())))
    page.goto(f"{studio.keys.origin}/")
    page.wait_for_load_state("networkidle")
    assert 3 <= len(sizes) <= 6
    assert sum(sizes) <= 60_000
