"""Pictures of every page of the studio, and how quick its first page and the page *Chain* are, in Chromium.

``python -m benchmarks.studio`` from the root of a clone, with what `tests/support/studio_browser.py` needs. It writes
`out/studio/PAGE-WIDTH.png` at 1280 and 320 pixels.
"""

from __future__ import annotations

import statistics
import sys
import tempfile
from pathlib import Path
from typing import Any

from tests.support import studio_browser
from tests.support.studio import served

ROOT = Path(__file__).resolve().parents[1]
OUT = ROOT / "out" / "studio"
WIDTHS = (1280, 320)
FIRST_PAGE_MS, ANSWER_MS, FIRST_PAGE_BYTES = 150, 50, 60_000
TIMES = 15

# From a key press to the new answer in the page.
WATCH = """() => {
  window.took = []; let pressed = 0;
  addEventListener("keydown", () => { pressed = performance.now(); }, true);
  new MutationObserver(() => window.took.push(performance.now() - pressed))
    .observe(document.querySelector("#answer"), { childList: true });
}"""


def pictures(page: Any, addresses: dict[str, str]) -> None:
    OUT.mkdir(parents=True, exist_ok=True)
    for width in WIDTHS:
        for colours in ("light", "dark") if width == WIDTHS[0] else ("light",):
            how = {"viewport": {"width": width, "height": 900}, "color_scheme": colours}
            with studio_browser.looked_at(page, **how) as other:
                for name, address in addresses.items():
                    other.goto(address)
                    other.wait_for_timeout(100)
                    path = OUT / f"{name}-{width}{'' if colours == 'light' else '-dark'}.png"
                    other.screenshot(path=path, full_page=True)
                    print(path.relative_to(ROOT))


def measured(page: Any, studio: Any) -> bool:
    opened, size = [], 0
    for _ in range(TIMES):
        page.goto(f"{studio.keys.origin}/")
        page.wait_for_load_state("networkidle")
        opened.append(page.evaluate("performance.getEntriesByType('navigation')[0].loadEventEnd"))
        size = max(size, page.evaluate(studio_browser.TRANSFERRED))
    first = statistics.median(opened)
    page.goto(f"{studio.keys.origin}/chain")
    page.evaluate(WATCH)
    studio_browser.tab_to(page, "#omega-slider")
    for number in range(TIMES):
        page.keyboard.press("ArrowLeft")
        page.wait_for_function("n => window.took.length > n", arg=number)
    answer = statistics.median(page.evaluate("window.took"))
    print(f"first page: {first:.0f} ms (at most {FIRST_PAGE_MS}), {size / 1000:.1f} kB (at most 60)")
    print(f"key press to answer on Chain: {answer:.0f} ms (at most {ANSWER_MS}), median of {TIMES}")
    return first <= FIRST_PAGE_MS and answer <= ANSWER_MS and size <= FIRST_PAGE_BYTES


def main() -> int:
    with tempfile.TemporaryDirectory() as folder, served(Path(folder)) as studio, studio_browser.opened(studio) as page:
        met = measured(page, studio)
        addresses = {"start": f"{studio.keys.origin}/"}
        addresses |= {one.name: f"{studio.keys.origin}/{one.name}" for one in studio.app.state.pages}
        addresses["written"] = studio_browser.written(page, studio)
        pictures(page, addresses)
    return 0 if met else 1


if __name__ == "__main__":
    sys.exit(main())
