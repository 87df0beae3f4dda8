"""The steps from a picture to its figure, each with exact answers."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given, strategies as st
from hypothesis.extra.numpy import arrays

from encoders.picture.errors import PictureError
from encoders.picture.figure import figure_steps, style_of
from encoders.picture.options import Fit, Invert, PictureOptions, Style, Threshold
from encoders.picture.regions import TEXTURES, dot_regions, textured
from encoders.picture.sign import framed_sign
from encoders.picture.steps import (
    adaptive_figure,
    background_light,
    composite,
    content_box,
    dilated,
    edges,
    even_contrast,
    inverted,
    luminance,
    otsu,
    smoothed,
    soft_figure,
    thickened,
    widened,
)
from encoders.picture.views import views
from encoders.scene import PatternKind

masks = arrays(np.bool_, st.tuples(st.integers(3, 24), st.integers(3, 24)))


def light(grey: np.ndarray, alpha: np.ndarray | float = 1.0) -> np.ndarray:
    out = np.empty((*grey.shape, 4), np.float32)
    out[..., :3] = (grey * alpha)[..., None]
    out[..., 3] = alpha
    return out


def square(size: int = 24, low: int = 8, high: int = 16) -> np.ndarray:
    figure = np.zeros((size, size), np.float32)
    figure[low:high, low:high] = 1
    return figure


def test_composite_by_hand() -> None:
    alpha, ground = np.array([[1.0, 0.25]], np.float32), np.array([0, 1, 0.5], np.float32)
    over = composite(light(np.full((1, 2), 0.8, np.float32), alpha), ground)
    np.testing.assert_allclose(over, [[[0.8, 0.8, 0.8], [0.2, 0.95, 0.575]]], atol=1e-6)


def test_background_is_what_the_picture_shows_on() -> None:
    alpha = square()
    assert (background_light(light(np.zeros_like(alpha), alpha), "auto") == 1).all()
    assert (background_light(light(np.ones_like(alpha), alpha), "auto") == 0).all()
    np.testing.assert_allclose(background_light(light(alpha), "#ff0080"), [1, 0, 0.2158605], atol=1e-6)
    for bad in ("red", "#12345", "#12345g", ""):
        with pytest.raises(PictureError, match="background: expected auto or a colour"):
            background_light(light(alpha), bad)


def test_luminance_weights() -> None:
    np.testing.assert_allclose(luminance(np.eye(3, dtype=np.float32)[None]), [[0.2126, 0.7152, 0.0722]])


def test_smoothed_is_the_mean_of_the_square_around() -> None:
    values = np.random.default_rng(3).random((9, 13)).astype(np.float32)
    wide = np.pad(values, 2, mode="edge")
    expected = [[wide[i : i + 5, j : j + 5].mean() for j in range(13)] for i in range(9)]
    np.testing.assert_allclose(smoothed(values, 2), expected, atol=1e-6)


def test_otsu_against_every_threshold() -> None:
    values = np.random.default_rng(5).beta(0.5, 0.8, (40, 40)).astype(np.float32)
    levels = np.round(values * 255) / 255
    between = {}
    for cut in np.unique(levels)[:-1]:
        low, high = levels[levels <= cut], levels[levels > cut]
        between[float(cut)] = low.size * high.size * (high.mean() - low.mean()) ** 2 / levels.size**2
    threshold, share = otsu(values)
    best = max(between, key=between.__getitem__)
    assert best < threshold < best + 2 / 255
    assert share == pytest.approx(between[best] / levels.var(), rel=1e-9)
    assert otsu(np.full((4, 4), 0.5, np.float32))[1] == 0


def test_soft_figure_keeps_the_share_of_an_edge() -> None:
    values = np.array([[0.2] * 500 + [0.5] + [0.8] * 500], np.float32)
    figure = soft_figure(values, 0.55)
    assert figure[0, 500] == pytest.approx(0.5, abs=1e-2)
    np.testing.assert_allclose(figure[0, 501:], 1, atol=1e-6)
    np.testing.assert_allclose(figure[0, :500], 0, atol=1e-3)
    assert (soft_figure(values, 2.0) == 0).all()
    assert (soft_figure(values, -1.0) == 1).all()


def test_adaptive_threshold_sees_strokes_on_a_slope() -> None:
    slope = np.broadcast_to(np.linspace(0, 1, 64, dtype=np.float32), (64, 64)).copy()
    stroke = (np.arange(64) % 16 < 4)[:, None] & np.ones(64, bool)
    figure = adaptive_figure(slope + 0.2 * stroke, 8)
    assert ((figure > 0.5) == stroke)[:, 10:-10].all()
    assert not ((soft_figure(slope + 0.2 * stroke, otsu(slope)[0]) > 0.5) == stroke)[:, 10:-10].all()


def test_local_contrast_evens_a_slope() -> None:
    slope = np.broadcast_to(np.linspace(0.05, 1, 64, dtype=np.float32), (64, 64))
    assert np.ptp(even_contrast(slope, 8)[:, 8:-8]) < 0.5 * np.ptp(slope)
    assert (even_contrast(np.full((9, 9), 0.3, np.float32), 3) == 0.5).all()


def test_edges_are_at_the_edges() -> None:
    found = edges(square())
    assert found[12, 12] == 0 == found[0, 0]
    assert found[8, 12] > 0.5


@pytest.mark.parametrize("turned", [False, True])
def test_the_figure_is_raised_on_either_ground(turned: bool) -> None:
    figure = square()
    np.testing.assert_array_equal(inverted(1 - figure if turned else figure), figure)


def test_what_is_transparent_is_ground() -> None:
    figure = np.ones((24, 24), np.float32)
    figure[0, 0] = figure[0, -1] = 0
    clear = figure < 0.5
    np.testing.assert_array_equal(inverted(1 - figure, clear), figure)
    np.testing.assert_array_equal(inverted(figure, clear), figure)


def test_a_sign_in_a_tile_and_in_a_ring_is_known() -> None:
    tile = square(48, 4, 44)
    tile[16:32, 22:26] = 0
    sign = np.pad(np.ones((16, 4), np.float32), ((16, 16), (22, 22)))
    ring = square(48, 4, 44) - square(48, 8, 40)
    for framed in (tile, ring + sign):
        found = framed_sign(framed)
        assert found is not None
        np.testing.assert_array_equal(found.sign, sign)
        np.testing.assert_array_equal(found.inside, sign > 0)
    notched, house = tile.copy(), tile.copy()
    notched[4:32, 22:26] = 0
    house[4:24] *= np.abs(np.arange(48) - 23.5) < np.arange(20)[:, None]
    for other in (ring, square(48, 4, 44), notched, house, np.zeros((48, 48), np.float32)):
        assert framed_sign(other) is None


def test_content_box() -> None:
    figure = np.zeros((10, 20), np.float32)
    figure[2:5, 7:19] = 0.6
    assert content_box(figure) == (2, 5, 7, 19)
    assert content_box(np.zeros((10, 20), np.float32)) == (0, 10, 0, 20)


@given(masks, st.floats(0, 4))
def test_dilated_against_distances(mask: np.ndarray, radius: float) -> None:
    places = np.argwhere(mask)
    grown = dilated(mask, radius)
    for place in np.ndindex(mask.shape):
        near = len(places) > 0 and ((places - place) ** 2).sum(axis=1).min() <= radius * radius
        assert grown[place] == near


@given(masks, st.floats(1, 7))
def test_widened_only_adds(mask: np.ndarray, width: float) -> None:
    assert (widened(mask, width) | ~mask).all()


def test_widened_brings_thin_strokes_to_the_width_and_leaves_others() -> None:
    thin, thick = np.zeros((30, 30), bool), np.zeros((30, 30), bool)
    thin[:, 15] = True
    thick[:, 8:20] = True
    assert widened(thin, 7)[15].sum() == 7
    np.testing.assert_array_equal(widened(thick, 7), thick)
    gap = ~widened(thin, 7, outside=True)
    assert (~gap)[15].sum() == 7


def test_thickened() -> None:
    assert thickened(square(), 2)[12].sum() == 12
    np.testing.assert_array_equal(thickened(square(), 0.5), square())


def test_the_steps_have_names_and_the_last_is_the_figure() -> None:
    drawing = light(np.zeros((24, 24), np.float32), square())
    names = [step.name for step in figure_steps(drawing, PictureOptions().resolved(Style.ICON))]
    assert names == ["composite", "luminance", "threshold (otsu)", "invert"]
    everything = PictureOptions(edges=True, threshold=Threshold.ADAPTIVE).resolved(Style.PHOTO)
    names = [step.name for step in figure_steps(drawing, everything)]
    assert names == ["composite", "luminance", "local contrast", "edges", "threshold (adaptive)", "invert"]
    for invert, raised in ((Invert.AUTO, True), (Invert.NO, False), (Invert.YES, True)):
        figure = figure_steps(drawing, PictureOptions(invert=invert).resolved(Style.ICON))[-1].image
        assert bool(figure[12, 12] > 0.5) is raised


def test_two_tones_are_an_icon_and_a_slope_is_a_photograph() -> None:
    assert style_of(square()) is Style.ICON
    assert style_of(np.linspace(0, 1, 400, dtype=np.float32).reshape(20, 20) ** 2) is Style.PHOTO


def test_options_name_the_field_and_the_value() -> None:
    wrong: dict[str, Any] = {"zoom": 0, "levels": 9, "level_step_db": 2.9, "overlap": float("nan"), "dwell_s": 0}
    for field, value in wrong.items():
        with pytest.raises(PictureError, match=rf"picture\.{field}: expected a number from .* got {value}"):
            PictureOptions(**{field: value})
    with pytest.raises(PictureError, match=r"picture\.fit: expected one of contain, cover, stretch, got 'tile'"):
        PictureOptions(fit="tile")  # type: ignore[arg-type]
    assert PictureOptions(fit=Fit.STRETCH).resolved(Style.PHOTO).fit is Fit.STRETCH


@given(st.integers(1, 300), st.integers(1, 300), st.floats(0.2, 5), st.integers(1, 6), st.floats(0, 0.9))
def test_views_cover_the_picture_in_reading_order(
    height: int, width: int, aspect: float, zoom: int, lap: float
) -> None:
    whole, *parts = views(height, width, aspect, zoom, lap)
    assert (whole.top, whole.bottom, whole.left, whole.right, whole.name) == (0, height, 0, width, "overview")
    assert (not parts) == (zoom == 1)
    if parts:
        seen = np.zeros((height, width), bool)
        for part in parts:
            seen[part.top : part.bottom, part.left : part.right] = True
        assert seen.all()
        assert [(p.top, p.left) for p in parts] == sorted((p.top, p.left) for p in parts)


def test_views_overlap() -> None:
    parts = views(100, 100, 1.0, 2, 0.5)[1:]
    assert [(p.left, p.right) for p in parts[:3]] == [(0, 50), (25, 75), (50, 100)]
    assert parts[4].name == "row 2 of 3, column 2 of 3"


def test_regions_by_colour_and_by_luminance() -> None:
    colour = np.zeros((4, 6, 3))
    colour[:, :3] = (0.5, 0, 0)
    colour[:, 3:] = (0, 0.5 * 0.2126 / 0.7152, 0)
    figure = np.ones((4, 6))
    figure[0] = 0
    labels = dot_regions(colour, figure, 3, True)
    assert (labels[0] == 0).all()
    assert set(labels[1:, :3].ravel()) | set(labels[1:, 3:].ravel()) == {1, 2}
    assert len(set(labels[1:, :3].ravel())) == 1
    assert (dot_regions(colour, figure, 3, False)[1:] == 1).all()
    assert (dot_regions(colour, np.zeros((4, 6)), 3, True) == 0).all()


def test_textures() -> None:
    labels = np.repeat(np.arange(6)[:, None], 6, axis=1)
    amplitude = textured(labels)
    assert (amplitude[0] == 0).all()
    for index, texture in enumerate(TEXTURES, start=1):
        row = amplitude[index]
        if texture.kind is PatternKind.SINE:
            np.testing.assert_allclose(np.abs(row), texture.level)
            if texture.direction == "along":
                steps = np.angle(row[1:] / row[:-1])
                np.testing.assert_allclose(steps, -texture.lag_rad, atol=1e-12)
    assert np.abs(amplitude[5]).tolist() == [0.7, 0.7, 0, 0, 0.7, 0.7]
    ratios = sorted({texture.level for texture in TEXTURES})
    assert all(20 * np.log10(b / a) >= 2.9 for a, b in pairwise(ratios))
