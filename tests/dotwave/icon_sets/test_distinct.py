"""Distances between patterns against a plain loop; the choice of patterns against exhaustive search."""

from __future__ import annotations

import tracemalloc
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from hypothesis.extra.numpy import arrays

from encoders import Choice, GridShape, TargetPattern, choose_distinct, distinctness, felt_codes, plane_wave, weakened
from encoders.sets import EQUAL, NEAR

code_sets = st.integers(1, 9).flatmap(
    lambda count: arrays(np.uint8, (count, 70), elements=st.sampled_from([0, 0, 0, 1, 3, 97]))
)


def apart(one: np.ndarray, other: np.ndarray) -> int:
    return sum(bool(a != b) for a, b in zip(one, other, strict=True))


@given(code_sets)
def test_distances_are_the_number_of_actuators_that_differ(codes: np.ndarray) -> None:
    found = distinctness(codes, closer_than=40)
    count = len(codes)
    table = [[apart(a, b) for b in codes] for a in codes]
    listed = [(table[i][j], i, j) for i in range(count) for j in range(i + 1, count)]
    assert [(d, i, j) for i, j, d in found.close] == sorted(entry for entry in listed if entry[0] < 40)
    assert found.pairs.sum() == len(listed)
    assert all(found.pairs[d] == sum(entry[0] == d for entry in listed) for d in range(71))
    for i in range(count):
        others = [(table[i][j], j) for j in range(count) if j != i]
        assert (found.distance[i], found.nearest[i]) == (min(others) if others else (-1, -1))


def test_levels_count_in_steps_of_three_decibels_and_faint_is_flat() -> None:
    level = np.array([[0.0, 0.01, 1.0, 0.72, 0.5, 10 ** (-9 / 20)]])
    assert felt_codes(TargetPattern(level.astype(complex))).tolist() == [0, 0, 1, 2, 3, 4]


@given(st.floats(0, 6.28))
def test_a_common_phase_is_not_felt_and_a_lag_is(phase: float) -> None:
    wave = plane_wave(GridShape(6, 6), lag_deg=60)
    turned = TargetPattern(wave.amplitude * np.exp(1j * phase), wave.kind, phase_matters=True)
    other = plane_wave(GridShape(6, 6), lag_deg=120)
    assert np.array_equal(felt_codes(wave), felt_codes(turned))
    # Lags of 60 and 120 degrees agree where both are a multiple of 360 apart: in the first column only.
    assert apart(felt_codes(wave), felt_codes(other)) == 30


def choices(seed: int, icons: int, dots: int, options: int) -> list[Choice]:
    chance = np.random.default_rng(seed)
    made = []
    for _ in range(icons):
        codes = {tuple(chance.integers(0, 2, dots).tolist()) for _ in range(options)}
        made.append(Choice(np.array(sorted(codes), np.uint8), np.sort(chance.random(len(codes)))[::-1]))
    return made


def price(made: list[Choice], picked: tuple[int, ...]) -> float:
    codes = [choice.codes[k] for choice, k in zip(made, picked, strict=True)]
    total = sum(float(choice.similarity.max() - choice.similarity[k]) for choice, k in zip(made, picked, strict=True))
    for i in range(len(codes)):
        for j in range(i):
            total += {0: EQUAL, 1: NEAR}.get(apart(codes[i], codes[j]), 0.0)
    return total


@pytest.mark.parametrize("seed", range(12))
def test_the_choice_is_as_good_as_the_best_of_all(seed: int) -> None:
    made = choices(seed, icons=4, dots=4, options=5)
    best = min(price(made, picked) for picked in product(*(range(len(choice.similarity)) for choice in made)))
    found = price(made, tuple(choose_distinct(made).tolist()))
    # Conflicts must be as few as they can be; of the similarity a little may be left on the table.
    assert round(found / NEAR) == round(best / NEAR)
    assert found <= best + 0.25


@settings(max_examples=25)
@given(st.integers(0, 10**6))
def test_no_picture_gains_by_moving_alone(seed: int) -> None:
    made = choices(seed, icons=12, dots=6, options=8)
    picked = choose_distinct(made).tolist()
    now = price(made, tuple(picked))
    for index, choice in enumerate(made):
        for option in range(len(choice.similarity)):
            moved = [*picked[:index], option, *picked[index + 1 :]]
            assert price(made, tuple(moved)) >= now - 1e-9


def test_without_conflict_everyone_keeps_the_best() -> None:
    codes = np.eye(8, dtype=np.uint8) * 1
    made = [Choice(np.stack([np.roll(row, 0), 1 - row]), np.array([0.9, 0.5])) for row in codes]
    assert choose_distinct(made).tolist() == [0] * 8


def test_fifty_copies_of_one_picture_are_told_apart() -> None:
    base = np.random.default_rng(1).integers(0, 2, 36).astype(np.uint8)
    flips = [(i, j) for i in range(36) for j in range(i, 36)]
    codes = np.stack([base, *(base ^ np.bincount([i, j], minlength=36).clip(0, 1).astype(np.uint8) for i, j in flips)])
    copies = [Choice(codes, 1 - np.arange(len(codes)) / 1000)] * 50
    picked = choose_distinct(copies)
    assert distinctness(codes[picked]).close == ()


def test_empty_and_single_sets() -> None:
    assert choose_distinct([]).tolist() == []
    alone = distinctness(np.ones((1, 36), np.uint8))
    assert alone.nearest.tolist() == [-1]
    assert alone.close == ()


def test_weakened_keeps_the_dots_and_changes_what_is_felt() -> None:
    dots = np.random.default_rng(2).integers(0, 2, (6, 6)).astype(bool)
    for amplitude in weakened(dots):
        assert np.array_equal(amplitude > 0, dots)
        assert set(np.unique(amplitude)) <= {0.0, 0.5, 1.0}
    assert (weakened(dots)[2][dots] == 0.5).all()


def test_a_set_of_equal_patterns_takes_little_memory() -> None:
    tracemalloc.start()
    found = distinctness(np.zeros((2500, 36), np.uint8))
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert found.pairs[0] == 2500 * 2499 / 2
    assert found.close == tuple((i, j, 0) for i in range(5) for j in range(i + 1, 2500))[:10_000]
    assert peak < 200e6
