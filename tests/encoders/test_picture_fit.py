"""The similarity measure and the search: independent references, invariants, and better than plain thresholding."""

from __future__ import annotations

from dataclasses import astuple
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray
from PIL import Image

from encoders.picture.climb import climbed, neighbours, swept
from encoders.picture.fit import Window, best_patterns, choose_window, sampled
from encoders.picture.held import sure_dots, tied_dots
from encoders.picture.options import Fit, PictureOptions, Style
from encoders.picture.pictures import encode_picture, explain_picture
from encoders.picture.similarity import DENSE_DOTS, agreement, matrices, pulls, squares, target_of
from encoders.picture.steps import otsu
from encoders.scene import GridShape

SAMPLES = Path(__file__).resolve().parents[2] / "samples"
ICONS = sorted((SAMPLES / "icons").glob("*.svg"))
PICTURES = [*ICONS, *sorted((SAMPLES / "textures").glob("*.png")), *sorted((SAMPLES / "photos").glob("*.jpg"))]
SIX = GridShape(6, 6)
TINY = GridShape(2, 3)

patterns = arrays(np.float64, (6, 6), elements=st.sampled_from([0.0, 1.0]))
figures = arrays(np.float64, (1, 24, 24), elements=st.floats(0, 1))


def reference(figure: np.ndarray, dots: np.ndarray) -> float:
    """The formula of the module's docstring, point by point."""

    def blurred(values: np.ndarray, sigma: float) -> NDArray[np.float64]:
        ways = []
        for size in values.shape:
            apart = (np.arange(size)[:, None] - np.arange(size)) / 4
            bell = np.exp(-(apart**2) / (2 * sigma**2))
            ways.append(bell / bell.sum(axis=1, keepdims=True))
        soft: NDArray[np.float64] = ways[0] @ values @ ways[1].T
        return soft

    def correlation(a: np.ndarray, b: np.ndarray) -> float:
        return float(np.corrcoef(a.ravel(), b.ravel())[0, 1])

    up, figure = blurred(np.kron(dots, np.ones((4, 4))), 0.5), blurred(figure, 0.5)
    return 0.5 * correlation(up, figure) + 0.5 * correlation(up - blurred(up, 2), figure - blurred(figure, 2))


def test_the_measure_is_the_stated_formula() -> None:
    chance = np.random.default_rng(2)
    for shape in (GridShape(3, 4), SIX):
        figure = chance.random((shape.rows * 4, shape.cols * 4))
        dots = chance.integers(0, 2, (shape.rows, shape.cols)).astype(float)
        found = agreement(target_of(figure[None], shape), dots[None, None])[0, 0]
        assert found == pytest.approx(reference(figure, dots), abs=1e-9)


def test_a_figure_drawn_by_the_pattern_itself_has_similarity_one() -> None:
    dots = np.random.default_rng(4).integers(0, 2, (6, 6)).astype(float)
    figure = np.kron(dots, np.ones((4, 4)))
    assert agreement(target_of(figure[None], SIX), dots[None, None])[0, 0] == pytest.approx(1, abs=1e-9)


@given(figures, patterns, st.floats(0.2, 1))
def test_invariants_of_the_measure(figure: np.ndarray, dots: np.ndarray, faint: float) -> None:
    target = target_of(figure, SIX)
    value = float(agreement(target, dots[None, None])[0, 0])
    assert -1 - 1e-9 <= value <= 1 + 1e-9
    flipped = target_of(figure[:, :, ::-1], SIX)
    assert agreement(flipped, dots[None, None, :, ::-1])[0, 0] == pytest.approx(value, abs=1e-6)
    if not target.flat[0] and figure.std() > 0.2 and dots.any():
        assert agreement(target_of(faint * figure, SIX), dots[None, None])[0, 0] == pytest.approx(value, abs=1e-6)


@given(arrays(np.float64, (3, 13 * 12), elements=st.sampled_from([0.0, 1.0])))
def test_large_grids_work_with_the_same_matrix_unseen(dots: np.ndarray) -> None:
    shape = GridShape(13, 12)
    assert shape.rows * shape.cols > DENSE_DOTS
    for pull, matrix, diagonal in zip(pulls(shape, dots), matrices(shape), squares(shape), strict=True):
        np.testing.assert_allclose(pull, dots @ matrix, atol=1e-12)
        np.testing.assert_allclose(diagonal, np.diag(matrix), atol=1e-15)


def all_patterns(shape: GridShape) -> np.ndarray:
    size = shape.rows * shape.cols
    bits = np.arange(2**size)[:, None] >> np.arange(size) & 1
    return bits.reshape(-1, shape.rows, shape.cols).astype(float)


def with_sure(dots: np.ndarray, figure: np.ndarray, shape: GridShape) -> np.ndarray:
    """Patterns in which what the figure decides is as it decides."""
    sure = sure_dots(figure, shape).along(tied_dots(figure, shape))
    kept = np.where(sure.free, dots.reshape(len(dots), -1), sure.raised).reshape(dots.shape)
    return kept.astype(float)


@pytest.mark.parametrize("seed", range(20))
def test_the_search_finds_the_best_of_all_patterns_of_a_small_grid(seed: int) -> None:
    chance = np.random.default_rng(seed)
    figure = np.kron(chance.random((5, 7)) > 0.5, np.ones((6, 6))).astype(np.float32)
    window = Window(0, 30, 0, 42)
    windowed = sampled(figure, [window], TINY)
    allowed = with_sure(all_patterns(TINY), windowed[0], TINY)
    best = float(agreement(target_of(windowed, TINY), allowed)[0].max())
    found = best_patterns(figure, window, TINY, 1).candidates[0]
    assert found.similarity == pytest.approx(best, abs=0.02)
    assert found.similarity <= best + 1e-9


def test_no_flip_of_one_or_two_dots_helps_after_the_climb() -> None:
    figure = np.kron(np.random.default_rng(9).random((1, 8, 8)) > 0.6, np.ones((3, 3))).astype(float)
    target = target_of(figure, SIX)
    (dots,), (reached,) = climbed(target, np.zeros((1, 36), bool), np.eye(36), np.ones(36, bool))
    value = float(agreement(target, dots.reshape(1, 1, 6, 6).astype(float))[0, 0])
    assert value == pytest.approx(reached, abs=1e-9)
    near = neighbours(target, dots, np.ones(36, bool), 667)
    assert len(near) == 1 + 36 + 36 * 35 // 2
    assert near[0][0] == pytest.approx(value, abs=1e-9)
    assert max(score for score, _ in near[1:]) <= value + 1e-9
    for score, other in near[1:40]:
        assert agreement(target, other.reshape(1, 1, 6, 6).astype(float))[0, 0] == pytest.approx(score, abs=1e-9)
        assert 1 <= (other != dots).sum() <= 2


def test_the_sweep_of_large_grids_rises_and_ends_where_no_dot_helps() -> None:
    figure = np.kron(np.random.default_rng(9).random((1, 16, 16)) > 0.6, np.ones((3, 3))).astype(float)
    shape = GridShape(12, 12)
    target = target_of(figure, shape)
    start = np.zeros((12, 12))
    start[::2] = 1
    dots = swept(target, start)
    value = float(agreement(target, dots[None, None])[0, 0])
    assert value > float(agreement(target, start[None, None])[0, 0]) + 0.3
    for place in np.ndindex(12, 12):
        other = dots.copy()
        other[place] = 1 - other[place]
        assert agreement(target, other[None, None])[0, 0] <= value + 1e-9


def test_samples_are_exact_means() -> None:
    figure = np.random.default_rng(6).random((48, 72)).astype(np.float32)
    lattice = sampled(figure, [Window(0, 48, 0, 72), Window(-48, 48, 0, 72)], SIX)
    np.testing.assert_allclose(lattice[0], figure.reshape(24, 2, 24, 3).mean(axis=(1, 3)), atol=1e-6)
    np.testing.assert_allclose(lattice[1][:12], 0, atol=1e-7)
    half = sampled(figure, [Window(0.5, 24.5, 0, 72)], GridShape(6, 6))[0]
    expected = (figure[:-1] + figure[1:])[:24] / 2
    np.testing.assert_allclose(half, expected.reshape(24, 24, 3).mean(axis=2), atol=1e-6)


@pytest.mark.parametrize(
    ("fit", "pitch_m", "crop", "edges"),
    [
        (Fit.STRETCH, (8e-3, 8e-3), True, (20, 40, 10, 70)),
        (Fit.COVER, (8e-3, 8e-3), False, (0, 60, 20, 80)),
        (Fit.COVER, (16e-3, 8e-3), False, (0, 60, 35, 65)),
        (Fit.CONTAIN, (8e-3, 8e-3), False, (-20, 80, 0, 100)),
        (Fit.CONTAIN, (8e-3, 8e-3), True, (0, 60, 10, 70)),
    ],
)
def test_the_window_of_each_fit(
    fit: Fit, pitch_m: tuple[float, float], crop: bool, edges: tuple[float, float, float, float]
) -> None:
    figure = np.zeros((60, 100), np.float32)
    figure[20:40, 10:70] = 1
    assert astuple(choose_window(figure, SIX, fit, pitch_m, crop)) == pytest.approx(edges, abs=1e-9)


def figure_of(path: Path, options: PictureOptions | None = None) -> np.ndarray:
    steps = explain_picture(path, SIX, options)
    return next(step.image for step in reversed(steps) if step.name in {"minimum stroke", "invert"})


@pytest.mark.parametrize("path", PICTURES, ids=lambda path: path.stem)
def test_what_a_box_filter_gives_is_among_what_is_tried(path: Path) -> None:
    options = PictureOptions(style=Style.PHOTO if path.suffix == ".jpg" else Style.AUTO)
    best = encode_picture(path, SIX, options).report.frames[0].candidates[0]
    windowed = sampled(figure_of(path, options), [best.window], SIX)
    means = windowed.reshape(6, 4, 6, 4).mean(axis=(1, 3))
    boxes = with_sure(np.stack([means > 0.5, means > otsu(means.astype(np.float32))[0]]), windowed[0], SIX)
    assert best.similarity >= agreement(target_of(windowed, SIX), boxes.astype(float)).max() - 1e-9


def test_a_mark_on_one_side_stays() -> None:
    """A drop of ink to the right of an otherwise symmetric ring is not mirrored away, nor lost."""
    ring = np.zeros((72, 72), np.uint8)
    ring[6:66, 6:66] = 255
    ring[18:54, 18:54] = 0
    marked = ring.copy()
    marked[24:36, 38:50] = 255
    plain, other = (
        encode_picture(Image.fromarray(255 - one), SIX).frames[0].pattern.amplitude for one in (ring, marked)
    )
    np.testing.assert_array_equal(plain, plain[:, ::-1])
    assert not np.array_equal(other, other[:, ::-1])


def test_the_twenty_icons_are_twenty_patterns_and_reach_a_mean() -> None:
    scenes = [encode_picture(path, SIX) for path in ICONS]
    assert len(ICONS) == 20
    assert len({scene.frames[0].pattern.amplitude.tobytes() for scene in scenes}) == 20
    assert np.mean([scene.report.similarity for scene in scenes]) > 0.75


@pytest.mark.parametrize("name", ["heart", "home", "wifi", "pause", "user", "warning", "sun"])
def test_a_symmetric_icon_gives_a_symmetric_pattern(name: str) -> None:
    dots = encode_picture(SAMPLES / "icons" / f"{name}.svg", SIX).frames[0].pattern.amplitude
    np.testing.assert_array_equal(dots, dots[:, ::-1])


def test_candidates_are_different_sorted_and_true() -> None:
    path = SAMPLES / "icons" / "cart.svg"
    report = encode_picture(path, SIX, PictureOptions(candidates=60)).report.frames[0]
    candidates = report.candidates
    assert len(candidates) == 60 == len({candidate.dots.tobytes() for candidate in candidates})
    assert [c.similarity for c in candidates] == sorted((c.similarity for c in candidates), reverse=True)
    np.testing.assert_array_equal(candidates[0].dots, encode_picture(path, SIX).report.frames[0].candidates[0].dots)
    figure = figure_of(path)
    for candidate in candidates[::7]:
        target = target_of(sampled(figure, [candidate.window], SIX), SIX)
        value = float(agreement(target, candidate.dots[None, None].astype(float))[0, 0])
        assert value == pytest.approx(candidate.similarity, abs=1e-9)


@pytest.mark.parametrize("shape", [GridShape(1, 1), GridShape(1, 6), GridShape(2, 9), GridShape(20, 20)])
def test_other_grids(shape: GridShape) -> None:
    scene = encode_picture(SAMPLES / "icons" / "heart.svg", shape)
    assert scene.frames[0].pattern.amplitude.shape == (shape.rows, shape.cols)


def test_a_large_grid_shows_more() -> None:
    small = encode_picture(SAMPLES / "icons" / "alarm.svg", SIX).report.similarity
    large = encode_picture(SAMPLES / "icons" / "alarm.svg", GridShape(24, 24)).report.similarity
    assert large > small + 0.15
