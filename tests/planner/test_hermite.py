"""The broken line nearest to a curve: exact where it can be, orthogonal where it cannot."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, strategies as st
from numpy.polynomial import Polynomial
from numpy.typing import NDArray

from planner.transitions.hermite import broken_line

NODES = 41
T = np.linspace(0.0, 1.0, NODES)
Floats = NDArray[np.float64]


def curve(*functions: Polynomial) -> tuple[Floats, Floats]:
    """Values and slopes of shape (1, NODES, C)."""
    values = np.stack([f(T) for f in functions], axis=1)[None]
    slopes = np.stack([f.deriv()(T) for f in functions], axis=1)[None]
    return values, slopes


def inner_product(f: Polynomial, g: Polynomial, low: float, high: float) -> float:
    whole = (f * g).integ()
    return float(whole(high) - whole(low))


def pieces_of(line: Floats) -> list[tuple[float, float, Polynomial]]:
    """(low, high, straight line) of every piece."""
    ends = np.linspace(0.0, 1.0, len(line))
    return [
        (low, high, Polynomial([a - (b - a) / (high - low) * low, (b - a) / (high - low)]))
        for low, high, a, b in zip(ends[:-1], ends[1:], line[:-1], line[1:], strict=True)
    ]


def square_error(f: Polynomial, line: Floats) -> float:
    return sum(inner_product(f - part, f - part, low, high) for low, high, part in pieces_of(line))


@given(st.floats(-5, 5), st.floats(-5, 5), st.integers(2, 40))
def test_a_straight_line_is_its_own(offset: float, slope: float, pieces: int) -> None:
    made = broken_line(*curve(Polynomial([offset, slope])), pieces)
    assert made.shape == (1, pieces + 1, 1)
    np.testing.assert_allclose(made[0, :, 0], offset + slope * np.linspace(0, 1, pieces + 1), atol=1e-12)


CUBICS = [Polynomial([0.3, -1.0, 2.0, 1.5]), Polynomial([1.0, 4.0, -9.0, 5.0])]


@pytest.mark.parametrize("pieces", [2, 5, 8, 20, 40])
def test_the_ends_are_exact(pieces: int) -> None:
    values, slopes = curve(*CUBICS)
    made = broken_line(values, slopes, pieces)
    np.testing.assert_array_equal(made[:, 0], values[:, 0])
    np.testing.assert_array_equal(made[:, -1], values[:, -1])


@pytest.mark.parametrize("pieces", [2, 5, 8, 20])
def test_the_error_is_orthogonal_to_every_hat(pieces: int) -> None:
    """Hermite interpolation of a cubic is the cubic, so the error can be integrated exactly."""
    made = broken_line(*curve(*CUBICS), pieces)
    for channel, cubic in enumerate(CUBICS):
        parts = pieces_of(made[0, :, channel])
        for k in range(1, pieces):
            (low, knot, before), (_, high, after) = parts[k - 1], parts[k]
            up = Polynomial([-low * pieces, pieces])
            down = Polynomial([high * pieces, -pieces])
            along = inner_product(cubic - before, up, low, knot) + inner_product(cubic - after, down, knot, high)
            assert abs(along) < 1e-14


@pytest.mark.parametrize("pieces", [4, 8, 20])
def test_it_is_nearer_than_the_line_through_points(pieces: int) -> None:
    made = broken_line(*curve(*CUBICS), pieces)
    for channel, cubic in enumerate(CUBICS):
        through = square_error(cubic, cubic(np.linspace(0.0, 1.0, pieces + 1)))
        assert square_error(cubic, made[0, :, channel]) < 0.5 * through


def test_no_knot_can_be_moved_to_come_nearer() -> None:
    cubic = CUBICS[0]
    best = broken_line(*curve(cubic), 6)[0, :, 0]
    least = square_error(cubic, best)
    for knot in range(1, 6):
        for shift in (-1e-4, 1e-4):
            other = best.copy()
            other[knot] += shift
            assert square_error(cubic, other) > least


def test_curves_do_not_mix() -> None:
    one, other = curve(CUBICS[0]), curve(CUBICS[1])
    both = broken_line(np.concatenate([one[0], other[0]]), np.concatenate([one[1], other[1]]), 7)
    np.testing.assert_allclose(both[0], broken_line(*one, 7)[0], atol=1e-14)
    np.testing.assert_allclose(both[1], broken_line(*other, 7)[0], atol=1e-14)


def test_no_channels() -> None:
    assert broken_line(np.zeros((2, NODES, 0)), np.zeros((2, NODES, 0)), 5).shape == (2, 6, 0)
