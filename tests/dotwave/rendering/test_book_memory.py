"""A book is planned in the memory of a chapter."""

from __future__ import annotations

import gc
import random
import tracemalloc
from itertools import islice

import pytest

from chainsim import load_device
from dotwave.reports.totals import Totals
from encoders import GridShape, TextOptions, encode_text
from planner import plan_scene

# Few words bring few pages, rows and cuts: what is remembered of them is full before it is measured.
WORDS = ["the", "quick", "brown", "fox", "12.50", "jumps", "over", "2", "lazy", "dogs,", "Anna"]
CHAPTER = 2000
MOST_BYTES = 600_000


@pytest.mark.slow
def test_memory_does_not_grow_with_a_book(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("encoders.braille.text.MOST_KEPT", 0)
    rng = random.Random(7)
    text = "\n\n".join(" ".join(rng.choices(WORDS, k=30)) for _ in range(270))
    device, totals = load_device("paper-6x6"), Totals()
    frames = iter(plan_scene(encode_text(text, GridShape(6, 6), TextOptions()), device).frames)
    sizes: list[int] = []
    tracemalloc.start()
    try:
        for _ in range(3):
            for frame in islice(frames, CHAPTER):
                totals.add(frame)
            gc.collect()
            sizes.append(tracemalloc.get_traced_memory()[0])
    finally:
        tracemalloc.stop()
    assert sum(totals.outcomes.values()) == 3 * CHAPTER
    # A plan of a frame that is kept takes more than half a kilobyte.
    assert sizes[2] - sizes[1] < MOST_BYTES
