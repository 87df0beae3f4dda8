"""Patterns as Braille and in words: read back, they are the pattern."""

from __future__ import annotations

import re

import numpy as np
from hypothesis import given, strategies as st
from hypothesis.extra.numpy import arrays

from dotwave.icon_sets.words import in_braille, in_words

patterns = st.tuples(st.integers(1, 9), st.integers(1, 9)).flatmap(
    lambda shape: arrays(np.float64, shape, elements=st.sampled_from([0.0, 0.5, 1.0]))
)
DOTS = {0: (0, 0), 1: (1, 0), 2: (2, 0), 3: (0, 1), 4: (1, 1), 5: (2, 1), 6: (3, 0), 7: (3, 1)}


@given(patterns)
def test_braille_shows_the_raised_dots(amplitude: np.ndarray) -> None:
    found = np.zeros(amplitude.shape, bool)
    for down, line in enumerate(in_braille(amplitude).split("\n")):
        for across, cell in enumerate(line):
            for bit, (row, col) in DOTS.items():
                if (ord(cell) - 0x2800) >> bit & 1:
                    found[4 * down + row, 2 * across + col] = True
    assert np.array_equal(found, amplitude > 0)


@given(patterns)
def test_words_say_every_dot_and_its_strength(amplitude: np.ndarray) -> None:
    words = in_words(amplitude)
    found = np.zeros(amplitude.shape)
    for number, row in re.findall(r"Row (\d+): ([^.]*)\.", words):
        for part in row.split("; "):
            level = 0.5 if part.endswith("at half strength") else 1.0
            for first, last in re.findall(r"(\d+)(?: to (\d+))?", part):
                found[int(number) - 1, int(first) - 1 : int(last or first)] = level
    assert np.array_equal(found, amplitude)
    assert words.startswith(f"{int((amplitude > 0).sum())} of {amplitude.size} dots raised")


def test_mirror_images_are_named() -> None:
    heart = np.array([[0, 1, 0], [1, 1, 1], [0, 1, 0]], float)
    assert "left and right and top and bottom alike" in in_words(heart)
    assert in_words(np.zeros((2, 2))) == "0 of 4 dots raised."
