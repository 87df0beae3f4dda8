"""The wish of a frame judged on many devices: dots, contrast, levels, and what does not matter."""

from __future__ import annotations

import numpy as np
import pytest

from encoders import Frame, TargetPattern
from planner import FrameWish

DOTS = np.array([[1.0, 0.0, 1.0], [0.0, 0.0, 1.0]])


def test_devices_are_judged_each_by_dots_and_contrast() -> None:
    felt = np.stack([DOTS * 0.9 + 0.1, DOTS * 0.7 + 0.2, DOTS, np.where(DOTS > 0, 0.4, 0.0), DOTS * np.nan])
    verdict = FrameWish(DOTS, braille=True).verdict(felt)
    np.testing.assert_array_equal(verdict.wrong_dots, [0, 0, 0, 3, 6])
    assert verdict.contrast_db is not None
    np.testing.assert_allclose(verdict.contrast_db[:2], [20, 20 * np.log10(4.5)])
    assert np.isinf(verdict.contrast_db[2])
    # The second has 13.06 dB.
    np.testing.assert_array_equal(verdict.ok, [True, True, True, False, False])
    assert verdict.share == 0.6
    assert verdict.worst_dot == (0, 0)
    np.testing.assert_array_equal(FrameWish(DOTS, 14.0).verdict(felt).ok, [True, False, True, False, False])


def test_raised_flat_dots_are_no_levels_in_braille() -> None:
    """0.66 over 0.46 of full scale is read as dots, not taken for levels that have no contrast."""
    felt = DOTS * 0.2 + 0.46
    assert FrameWish(DOTS).verdict(felt).contrast_db == pytest.approx(20 * np.log10(0.66 / 0.46))
    assert not FrameWish(DOTS).verdict(felt).ok
    # So it is where an old manifest knows nothing but the aim.
    assert not FrameWish(felt, braille=True).verdict(felt).ok
    assert FrameWish(felt).verdict(felt).ok


@pytest.mark.parametrize("contrast_db", [6.0, 8.0, 12.0, 20.0])
def test_contrast_is_judged_as_asked(contrast_db: float) -> None:
    wish, floor = FrameWish(DOTS, contrast_db), 10 ** (-contrast_db / 20)
    verdict = wish.verdict(np.maximum(DOTS, floor))
    assert verdict.ok
    assert wish.least_db == contrast_db
    assert not wish.verdict(np.maximum(DOTS, floor * 1.05)).ok
    # A flat dot is felt as flat, whatever contrast was asked.
    np.testing.assert_array_equal(np.maximum(DOTS, floor) >= wish.threshold, DOTS > 0)


def test_levels_have_no_contrast_and_the_threshold_itself_is_no_dot() -> None:
    wish = FrameWish(np.array([[1.0, 0.5, 0.0]]))
    assert wish.least_db is None
    assert wish.verdict(np.array([[[0.9, 0.45, 0.1]], [[0.9, 0.55, 0.1]]])).ok.all()
    assert not wish.verdict(np.array([[0.4, 0.5, 0.1]])).ok
    # Levels that are wished nearer to each other than 12 dB need no more.
    assert FrameWish(np.array([[1.0, 0.3]])).least_db is None
    assert FrameWish(np.array([[1.0, 0.3]]), braille=True).least_db == 12


def test_what_does_not_matter_is_not_judged() -> None:
    pattern = TargetPattern(DOTS.astype(complex), weight=np.array([[1.0, 1.0, 1.0], [0.0, 1.0, 1.0]]))
    wish = FrameWish.of(Frame(pattern, 1.0))
    assert np.isnan(wish.level[1, 0])
    felt = DOTS.copy()
    felt[1, 0] = 0.9
    assert wish.verdict(felt).ok
    assert not FrameWish(DOTS).verdict(felt).ok


def test_a_frame_of_one_kind_of_dots_has_no_contrast() -> None:
    for level in (0.0, 1.0):
        wish = FrameWish(np.full((2, 2), level), braille=True)
        verdict = wish.verdict(np.full((3, 2, 2), level))
        assert verdict.contrast_db is None
        assert verdict.ok.all()
        assert wish.least_db is None
