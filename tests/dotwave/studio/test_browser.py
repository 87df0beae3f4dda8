"""The studio in a real browser: by keyboard alone, without a fault that axe-core finds, narrow, light."""

from __future__ import annotations

from typing import Any

import pytest

from tests.support.studio_browser import (
    LOOKS,
    TRANSFERRED,
    addresses,
    faults,
    faults_of,
    looked_at,
    needs_axe,
    needs_browser,
    tab_to,
    wider_than_narrow,
)

pytestmark = needs_browser


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
        page.goto(address)
        page.keyboard.press("Tab")
        assert page.evaluate("document.activeElement.id") == "stop", address
        page.keyboard.press("Tab")
        page.keyboard.press("Enter")
        assert page.evaluate("document.activeElement.id") == "main", address


@needs_axe
def test_a_planted_fault_is_found(page: Any, studio: Any) -> None:
    page.goto(f"{studio.keys.origin}/write")
    page.evaluate("document.querySelector('label[for=text]').remove()")
    page.evaluate("document.documentElement.removeAttribute('lang')")
    found = {fault.split(":")[0] for fault in faults(page)}
    assert {"label", "html-has-lang"} <= found


def test_the_first_page_is_light(page: Any, studio: Any) -> None:
    page.goto(f"{studio.keys.origin}/")
    page.wait_for_load_state("networkidle")
    assert 3_000 < page.evaluate(TRANSFERRED) <= 60_000


def test_the_pages_work_without_scripts(page: Any, studio: Any, written: str) -> None:
    with looked_at(page, java_script_enabled=False) as plain:
        plain.goto(f"{studio.keys.origin}/chain")
        plain.fill("#epsilon", "0")
        plain.click("main button")
        assert "epsilon=0" in plain.url
        plain.goto(written)
        assert plain.locator("#frames > li").count() == 2


@needs_axe
@pytest.mark.parametrize("look", LOOKS)
def test_no_fault_on_any_page(page: Any, studio: Any, written: str, look: str) -> None:
    states = ("/nothing", "/write?find=german", "/chain?omega=x", "/chain?omega=0.995")
    found = faults_of(page, [*addresses(studio), *(studio.keys.origin + one for one in states), written], look)
    assert not found, "\n".join(found[:40])


def test_nothing_is_wider_than_a_narrow_window(page: Any, studio: Any, written: str) -> None:
    assert not wider_than_narrow(page, [*addresses(studio), written])
