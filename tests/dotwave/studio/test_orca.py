"""A task of the studio done with Orca in Chromium, without a screen: its Braille comes by our own bridge."""

from __future__ import annotations

from pathlib import Path

import pytest

from dotwave.bridges.brlapi_port import BrlapiPort
from dotwave.bridges.grid_fold import GridFold
from tests.support.bridge_bytes import server
from tests.support.bridge_clients import running, until
from tests.support.desktop import needs_orca, session_of
from tests.support.studio_browser import CHROMIUM, needs_browser, tab_to

COLUMNS = 40
# The session says where its bus is, and stays.
SAY_BUS = 'echo "$DBUS_SESSION_BUS_ADDRESS" > bus; echo ready; exec cat'


@pytest.mark.slow
@needs_orca
@needs_browser
def test_a_setting_is_changed_by_what_orca_shows(tmp_path: Path) -> None:
    from playwright.sync_api import sync_playwright

    from tests.support.studio import served

    port = BrlapiPort(server(COLUMNS))
    with (
        running(port, GridFold(1, COLUMNS)),
        session_of(tmp_path, port.number, SAY_BUS) as (_, environment),
        served(tmp_path / "studio") as studio,
        sync_playwright() as playwright,
    ):

        def felt(words: str) -> None:
            until(lambda: words in text(), words)

        def text() -> str:
            return "" if port.window is None else port.window.text or ""

        bus = {"DBUS_SESSION_BUS_ADDRESS": (tmp_path / "bus").read_text().strip()}
        # Without an address bar, which would have the focus.
        browser = playwright.chromium.launch_persistent_context(
            tmp_path / "profile", executable_path=CHROMIUM, headless=False, env={**environment, **bus},
            args=["--no-sandbox", "--force-renderer-accessibility", f"--app={studio.keys.first_address}"],
        )  # fmt: skip
        page = browser.pages[0]
        page.wait_for_selector("#stop")
        tab_to(page, "#stop")
        felt("STOP push button")
        tab_to(page, "nav a[href='/chain']")
        felt("Chain")
        page.keyboard.press("Enter")
        page.wait_for_url("**/chain")
        tab_to(page, "#omega-slider")
        felt("omega, slider")
        page.keyboard.press("ArrowLeft")
        # The answer is told without being looked for, then what has the focus again: the slider's new value.
        felt("Solved. Largest amplitude")
        felt("omega, slider 0.9995")
        browser.close()
