"""Textures: what a wave, a bar and a region are, in numbers."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from encoders import (
    GridShape,
    PatternKind,
    Region,
    TextureError,
    bars,
    levels,
    plane_wave,
    regions,
    rings,
    slanted_bars,
    walking_bars,
)  # fmt: skip
from tests.support.known import known

GRID = GridShape(6, 8)


@given(st.floats(-180, 180), st.floats(-180, 180), st.floats(0.01, 1))
def test_a_plane_wave_has_one_amplitude_and_two_lags(lag, row_lag, level):
    wave = plane_wave(GRID, lag_deg=lag, row_lag_deg=row_lag, level=level)
    assert wave.kind is PatternKind.SINE
    assert wave.phase_matters
    np.testing.assert_allclose(np.abs(wave.amplitude), level)
    np.testing.assert_allclose(wave.amplitude[:, 1:], wave.amplitude[:, :-1] * np.exp(-1j * np.deg2rad(lag)))
    np.testing.assert_allclose(wave.amplitude[1:], wave.amplitude[:-1] * np.exp(-1j * np.deg2rad(row_lag)))
    assert wave.amplitude[0, 0] == pytest.approx(level)


def test_bars_stand_upright_or_lie():
    upright = bars(GRID, vertical=True, width=2, gap=1)
    np.testing.assert_array_equal(upright.amplitude[0].real, [1, 1, 0, 1, 1, 0, 1, 1])
    assert (upright.amplitude == upright.amplitude[0]).all()
    lying = bars(GRID, vertical=False, width=1, gap=2, first=1, level=0.5)
    np.testing.assert_array_equal(lying.amplitude[:, 3].real, [0, 0.5, 0, 0, 0.5, 0])


def test_numbers_however_large_make_a_texture():
    assert (bars(GRID, vertical=True, width=10**30, gap=1, first=-(10**40)).amplitude.imag == 0).all()
    assert bars(GRID, vertical=True, width=10**30, gap=1).amplitude.all()
    assert np.isfinite(plane_wave(GRID, lag_deg=1e308, row_lag_deg=-1e308).amplitude).all()
    np.testing.assert_allclose(plane_wave(GRID, lag_deg=780).amplitude, plane_wave(GRID, lag_deg=60).amplitude)


def test_slanted_bars_are_bars_where_they_stand_or_lie():
    for angle, vertical in ((90, True), (0, False), (450, True)):
        slanted = slanted_bars(GRID, angle_deg=angle, width=2, gap=1, level=0.5)
        assert np.array_equal(slanted.amplitude, bars(GRID, vertical=vertical, width=2, gap=1, level=0.5).amplitude)


def test_slanted_bars_rise_to_the_right():
    raised = slanted_bars(GRID, angle_deg=45, width=1, gap=1.1).amplitude.real > 0
    for row, col in np.argwhere(raised):
        if row and col + 1 < GRID.cols:
            assert raised[row - 1, col + 1]


def test_rings_go_round_their_point():
    found = rings(GRID, row=2, col=2, width=1, gap=1).amplitude.real
    row, col = np.mgrid[: GRID.rows, : GRID.cols]
    far = np.hypot(row - 2, col - 2)
    assert np.array_equal(found > 0, far % 2 < 1)
    assert found[2, 2] == 1
    assert rings(GRID, row=2, col=2, width=1, gap=1, first=1).amplitude[2, 2] == 0


def test_walking_bars_fill_the_grid():
    walking = walking_bars(GRID, width=3)
    assert known(walking.walking).width == 3
    assert (walking.amplitude == 1).all()


def test_regions_show_their_part_of_a_texture():
    wave, dots = plane_wave(GRID, lag_deg=60), bars(GRID, vertical=True, width=1, gap=1)
    both = regions(GRID, [Region(0, 3, 0, 8, wave), Region(4, 6, 2, 6, dots)])
    np.testing.assert_array_equal(both.amplitude[:3], wave.amplitude[:3])
    np.testing.assert_array_equal(both.amplitude[4:, 2:6], dots.amplitude[4:, 2:6])
    assert not both.amplitude[3].any()
    assert both.phase_matters
    assert both.any_phase is not None
    assert not both.any_phase[:3].any()
    assert both.any_phase[3:].all()
    assert not regions(GRID, [Region(0, 1, 0, 1, dots)]).phase_matters


def test_what_leaves_the_core_is_read_only():
    for target in (plane_wave(GRID, lag_deg=90), bars(GRID, vertical=True, width=1, gap=1), levels(np.eye(3))):
        with pytest.raises(ValueError, match="read-only"):
            target.amplitude[0, 0] = 0


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: plane_wave(GRID, lag_deg=float("nan")), "finite"),
        (lambda: plane_wave(GRID, lag_deg=60, level=1.5), "1.5"),
        (lambda: bars(GRID, vertical=True, width=0, gap=1), "width"),
        (lambda: walking_bars(GRID, width=1), "1.2"),
        (lambda: slanted_bars(GRID, angle_deg=float("nan"), width=1, gap=1), "finite angle"),
        (lambda: slanted_bars(GRID, angle_deg=30, width=0.5, gap=1), "slanted bars: expected width"),
        (lambda: rings(GRID, row=2, col=float("inf"), width=1, gap=1), "finite row, col"),
        (lambda: rings(GRID, row=2, col=2, width=1, gap=0), "rings: expected width"),
        (lambda: levels([[0.5, 2.0]]), "2.0"),
        (lambda: levels([[float("nan")]]), "nan"),
        (lambda: levels([1.0, 2.0]), "rows"),
        (lambda: levels([[0.5, 1.0], [0.5]]), "rows of as many numbers each"),
        (lambda: levels([["high"]]), "rows of as many numbers each"),
        (lambda: regions(GRID, [Region(0, 7, 0, 1, levels(np.zeros((6, 8))))]), "region 0"),
        (lambda: regions(GRID, [Region(0, 2, 0, 2, walking_bars(GRID, width=3))]), "walking"),
        (lambda: regions(GRID, [Region(0, 2, 0, 2, levels(np.zeros((6, 8))))] * 2), "region 1: overlaps"),
    ],
)
def test_impossible_textures_are_refused(make, says):
    with pytest.raises(TextureError, match=says):
        make()
