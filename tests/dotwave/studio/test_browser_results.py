"""The main task of every other page of the studio in a real browser, by keyboard alone, and what they show then."""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import Any

import pytest

from tests.support.studio_browser import (
    LOOKS,
    ROOT,
    faults_of,
    needs_axe,
    needs_browser,
    tab_to,
    wider_than_narrow,
)

pytestmark = [needs_browser, pytest.mark.slow]


@pytest.fixture(scope="module")
def saved(page: Any, studio: Any) -> str:
    """The address of a device that was saved."""
    page.goto(f"{studio.keys.origin}/device")
    tab_to(page, "#name")
    page.keyboard.press("Control+A")
    page.keyboard.type("mine")
    page.keyboard.press("Enter")
    page.wait_for_selector("h2:has-text('Patterns')", timeout=120_000)
    return str(page.url)


@pytest.fixture(scope="module")
def traded(page: Any, studio: Any) -> str:
    """The address of what accuracy costs."""
    page.goto(f"{studio.keys.origin}/tradeoff")
    tab_to(page, "#text")
    page.keyboard.press("Control+A")
    page.keyboard.type("a")
    tab_to(page, "main button.main")
    page.keyboard.press("Enter")
    page.wait_for_selector("main table", timeout=180_000)
    return str(page.url)


@pytest.fixture(scope="module")
def icons(page: Any, studio: Any, tmp_path_factory: pytest.TempPathFactory) -> str:
    """The address of a set of icons."""
    archive = tmp_path_factory.mktemp("icons") / "icons.zip"
    with zipfile.ZipFile(archive, "w") as files:
        for name in ("heart", "home", "lock", "cart"):
            files.write(ROOT / f"samples/icons/{name}.svg", f"{name}.svg")
    return sent(page, studio, archive, ".sheet")


@pytest.fixture(scope="module")
def picture(page: Any, studio: Any) -> str:
    """The address of a picture."""
    return sent(page, studio, ROOT / "samples/icons/heart.svg", ".step")


@pytest.fixture(scope="module")
def made(written: str, saved: str, traded: str, icons: str, picture: str) -> list[str]:
    """The addresses of a result of every kind, and of a blind test."""
    return [written, saved, traded, icons, f"{icons}/test", picture]


def sent(page: Any, studio: Any, path: Path, until: str) -> str:
    page.goto(f"{studio.keys.origin}/pictures")
    # The browser's own window for files is the system's: a test hands the file over.
    page.set_input_files("#file", path)
    tab_to(page, "main button.main")
    page.keyboard.press("Enter")
    page.wait_for_selector(until, timeout=120_000)
    return str(page.url)


def test_a_device_is_changed_and_saved_by_keyboard_alone(page: Any, studio: Any, saved: str) -> None:
    page.goto(saved)
    assert page.inner_text("h1") == "mine"
    assert page.locator("main svg").count() == 1
    page.goto(f"{studio.keys.origin}/device")
    tab_to(page, "#delta")
    page.keyboard.press("Control+A")
    page.keyboard.type("7")
    page.keyboard.press("Enter")
    page.wait_for_selector("[role=alert]")
    assert "delta: expected a number < 1" in page.inner_text("[role=alert]")
    # What is wrong is read first, and nothing that was typed is lost.
    assert page.evaluate("document.activeElement.matches('[role=alert]')")
    assert page.input_value("#delta") == "7"


def test_a_text_is_played_to_the_stand_in_by_keyboard_alone(page: Any, studio: Any, written: str) -> None:
    page.goto(f"{studio.keys.origin}/play")
    tab_to(page, "button[value=emulator]")
    page.keyboard.press("Enter")
    page.wait_for_selector("[data-mirror] svg", timeout=60_000)
    stand_in = page.url
    port = next(one.shown["port"] for one in studio.app.state.studio.tasks.going_on().values() if "port" in one.shown)
    page.goto(f"{studio.keys.origin}/play")
    tab_to(page, "#play-sink")
    page.keyboard.type(f"controller:{port}")
    tab_to(page, "#play-live")
    page.keyboard.press("Space")
    tab_to(page, "button[value=play]")
    page.keyboard.press("Enter")
    page.wait_for_selector("body[data-playing]")
    page.keyboard.press("Tab")
    assert page.evaluate("document.activeElement.id") == "stop"
    page.keyboard.press("Enter")
    page.wait_for_url("**/play?stopped")
    page.goto(stand_in)
    tab_to(page, ".working button")
    page.keyboard.press("Enter")
    page.wait_for_selector("[role=alert]:has-text('Cancelled')")


def test_accuracy_is_measured_by_keyboard_alone(page: Any, traded: str) -> None:
    page.goto(traded)
    assert "harmonic_balance" in page.inner_text("main table >> nth=0")
    assert "nonlinearity" in page.inner_text("main table >> nth=1")


def test_icons_are_told_apart_by_keyboard_alone(page: Any, icons: str) -> None:
    page.goto(icons)
    assert page.locator(".icons > li").count() == 4
    tab_to(page, "#find")
    page.keyboard.type("hea")
    page.wait_for_function("() => document.querySelectorAll('.icons > li').length === 1")
    page.goto(f"{icons}/test")
    tab_to(page, "#icon-1")
    page.keyboard.press("Space")
    page.keyboard.press("Enter")
    page.wait_for_selector("main table")
    assert "of 1 right" in page.inner_text("[data-focus]")


def test_a_parameter_of_a_picture_acts_at_once(page: Any, picture: str) -> None:
    page.goto(picture)
    before = page.inner_text("#steps [data-summary]")
    tab_to(page, "#edges")
    page.keyboard.type("y")
    page.wait_for_function("old => document.querySelector('#steps [data-summary]').innerText !== old", arg=before)
    assert page.evaluate("document.activeElement.id") == "edges"


@needs_axe
@pytest.mark.parametrize("look", LOOKS)
def test_no_fault_on_any_result(page: Any, made: list[str], look: str) -> None:
    found = faults_of(page, made, look)
    assert not found, "\n".join(found[:40])


def test_no_result_is_wider_than_a_narrow_window(page: Any, made: list[str]) -> None:
    assert not wider_than_narrow(page, made)
