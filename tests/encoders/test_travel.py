"""What travels: exact between its places, steady in sum, and read from what passes."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from scipy.special import betainc

from encoders import (
    SMOOTHNESS,
    STANDS_FROM,
    ArrowDirection,
    EncodeError,
    Frame,
    GridShape,
    LayoutError,
    PageNumbering,
    Presentation,
    Scene,
    TargetPattern,
    TextOptions,
    TextureError,
    arrow,
    circle,
    crossing,
    encode_text,
    levels_at,
    moving_dot,
    path,
    read_page,
    scrolled_bars,
)

GRID = GridShape(6, 6)


def scrolled(text: str, shape: GridShape = GRID, **options: Any) -> list[Frame]:
    return list(encode_text(text, shape, TextOptions(presentation=Presentation.SCROLL, **options)).frames)


def raised(frame: Frame) -> np.ndarray:
    return np.abs(frame.pattern.amplitude) > 0.5


def test_the_way_is_the_smooth_step_of_its_order() -> None:
    share = np.linspace(-0.2, 1.2, 141)
    known = betainc(SMOOTHNESS + 1, SMOOTHNESS + 1, np.clip(share, 0, 1))
    np.testing.assert_allclose(crossing(share), known, atol=1e-13)
    np.testing.assert_allclose(crossing(share) + crossing(1 - share), 1.0, atol=1e-13)
    assert 1 - crossing(STANDS_FROM) < 0.002


def test_a_dot_on_its_way_is_in_two_places_and_never_below_half() -> None:
    scene = Scene(GRID, moving_dot(GRID, path(GRID, [(1, 4), (1, 0)]), per_s=2.0, lasting_s=2.0))
    start_s = next(iter(scene.frames)).dwell_s
    for time_s in np.linspace(start_s, start_s + 1.99, 200):
        levels = levels_at(scene, float(time_s))
        assert levels.sum() == pytest.approx(1.0)
        assert levels.max() >= 0.5 - 1e-12
        assert np.count_nonzero(levels) <= 2
    half = levels_at(scene, start_s + 0.25)
    np.testing.assert_allclose(half[1], [0, 0, 0, 0.5, 0.5, 0])


def test_levels_are_those_of_the_frame_outside_of_ways() -> None:
    pattern = np.zeros((6, 6), dtype=np.complex128)
    pattern[2, 3] = 1j
    scene = Scene(GRID, (Frame(TargetPattern(pattern), 1.0), Frame(TargetPattern(0 * pattern), 1.0, travels=True)))
    assert levels_at(scene, 0.01)[2, 3] == 1.0
    assert levels_at(scene, 1.5)[2, 3] == pytest.approx(0.5)
    assert not levels_at(scene, -0.1).any()
    assert not levels_at(scene, 2.5).any()


def test_every_column_of_the_grid_feels_the_same_text_later() -> None:
    frames = scrolled("Hello")
    assert frames[0].leads
    assert not raised(frames[0]).any()
    assert [frame.travels for frame in frames] == [False] + [True] * (len(frames) - 1)
    for one, other in pairwise(frames):
        np.testing.assert_array_equal(raised(other)[:, :-1], raised(one)[:, 1:])
    assert not raised(frames[-1]).any()
    # Six cells (a capital and five letters), a blank one, a free column each, and the way out.
    assert len(frames) == 1 + 3 * 7 + 6
    assert frames[1].dwell_s == pytest.approx(1 / 3)


def test_text_is_read_from_what_passes() -> None:
    scene = encode_text("Hello, dear world", GRID, TextOptions(presentation=Presentation.SCROLL))
    check = scene.text_frames.check()
    assert check.text_equal
    assert check.cells_equal
    passed = [raised(frame) for frame in scene.frames if frame.travels]
    cells = next(iter(scene.frames)).cells
    assert read_page(passed, scene.encoding).rstrip("\u2800") == cells.rstrip("\u2800")
    # One column too late every cell is another.
    assert read_page(passed[1:], scene.encoding).rstrip("\u2800") != cells.rstrip("\u2800")


def test_long_texts_pass_line_by_line_with_every_word_whole() -> None:
    words = " ".join(f"word{number}" for number in range(60))
    scene = encode_text(words, GRID, TextOptions(presentation=Presentation.SCROLL))
    assert scene.text_frames.check().text_equal
    assert {frame.page for frame in scene.frames} == set(range(max(frame.page for frame in scene.frames) + 1))
    assert max(frame.page for frame in scene.frames) > 3
    assert not scene.text_frames.report.splits


def test_the_rate_is_in_cells() -> None:
    assert scrolled("Hi", rate=2.0, cell_gap=2)[1].dwell_s == pytest.approx(1 / 8)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"dwell_s": 1.0}, "dwell: a text that scrolls does not stand"),
        ({"rate": 50.0}, "rate: a text scrolls by 0.0333 to 33.3 cells a second, got 50"),
        ({"page_numbers": PageNumbering.CORNER}, "page-numbers: a text that scrolls has no pages"),
    ],
)
def test_what_a_scroll_has_not_is_refused(options: dict[str, Any], said: str) -> None:
    with pytest.raises(LayoutError, match=said):
        scrolled("Hi", **options)


def test_a_grid_too_low_for_a_cell_is_refused() -> None:
    with pytest.raises(LayoutError, match="no room for a cell"):
        scrolled("Hi", GridShape(2, 6))


def test_bars_move_to_the_left_column_by_column() -> None:
    frames = list(scrolled_bars(GRID, width=2, gap=1, columns_per_s=4.0, lasting_s=2.0))
    assert len(frames) == 9
    for one, other in pairwise(frames):
        np.testing.assert_array_equal(raised(other)[:, :-1], raised(one)[:, 1:])
    assert raised(frames[0])[0].tolist() == [True, True, False, True, True, False]


@pytest.mark.parametrize("radius", [0.5, 1.0, 2.0, 2.5])
def test_a_circle_closes_clockwise_without_a_gap(radius: float) -> None:
    places = circle(GRID, radius)
    assert len(set(places)) == len(places)
    for (row, col), (next_row, next_col) in pairwise([*places, places[0]]):
        assert max(abs(next_row - row), abs(next_col - col)) == 1
    rows, cols = {row for row, _ in places}, {col for _, col in places}
    assert rows == cols == {5 - row for row in rows}
    # From the top it goes to the right.
    top = min(places)[0]
    assert places[0][0] == top
    assert places[0][1] >= 3


def test_a_path_goes_from_neighbour_to_neighbour() -> None:
    places = path(GRID, [(0, 0), (5, 2), (5, 5)])
    assert (places[0], places[-1]) == ((0, 0), (5, 5))
    for (row, col), (next_row, next_col) in pairwise(places):
        assert max(abs(next_row - row), abs(next_col - col)) == 1


@pytest.mark.parametrize(
    ("direction", "step"), [("right", (0, 1)), ("left", (0, -1)), ("down", (1, 0)), ("up", (-1, 0))]
)
def test_an_arrow_goes_where_it_says(direction: str, step: tuple[int, int]) -> None:
    places = arrow(GRID, ArrowDirection(direction))
    assert len(places) == 6
    assert {(b[0] - a[0], b[1] - a[1]) for a, b in pairwise(places)} == {step}


def test_an_open_way_goes_out_before_it_begins_anew() -> None:
    frames = list(moving_dot(GRID, arrow(GRID, ArrowDirection.RIGHT), per_s=6.0, lasting_s=2.0))
    assert [int(raised(frame).sum()) for frame in frames] == [1, 1, 1, 1, 1, 1, 0, 1, 1, 1, 1, 1, 1]


@pytest.mark.parametrize(
    "ask",
    [
        lambda: circle(GRID, 3.0), lambda: circle(GRID, 0.2), lambda: path(GRID, [(0, 0)]),
        lambda: path(GRID, [(0, 0), (0, 6)]), lambda: path(GRID, [(1, 1), (1, 1)]),
        lambda: moving_dot(GRID, [(0, 0)], per_s=0.01, lasting_s=1.0),
        lambda: scrolled_bars(GRID, width=0, gap=1, columns_per_s=1.0, lasting_s=1.0),
        lambda: scrolled_bars(GRID, width=1, gap=1, columns_per_s=1000.0, lasting_s=1.0),
    ],
)  # fmt: skip
def test_what_cannot_be_is_refused(ask: object) -> None:
    assert callable(ask)
    with pytest.raises(TextureError) as found:
        ask()
    assert isinstance(found.value, EncodeError)
    assert "\n" not in str(found.value)
