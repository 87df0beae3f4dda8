"""Jets against derivatives known in closed form, against the algebra they must obey, and in exact fractions."""

from __future__ import annotations

from fractions import Fraction
from math import comb, factorial

import numpy as np
import pytest
from hypothesis import given, strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from planner.transitions import jets

LENGTH = 10
X = np.linspace(-1.0, 1.0, 9)
K = np.arange(LENGTH)[:, None]

small = st.floats(-1.0, 1.0).map(lambda x: round(x, 6))
real_jets = arrays(np.float64, (LENGTH, 3), elements=small)


def factorials(length: int) -> NDArray[np.float64]:
    return np.array([float(factorial(k)) for k in range(length)])[:, None]


def exponential(rate: complex) -> NDArray[np.complex128]:
    jet: NDArray[np.complex128] = rate**K * np.exp(rate * X) / factorials(LENGTH)
    return jet


def complexed(real: NDArray[np.float64], imag: NDArray[np.float64]) -> NDArray[np.complex128]:
    return real + 1j * imag


def away_from_zero(jet: NDArray[np.float64]) -> NDArray[np.float64]:
    """The jet with its value in 1.5 .. 3.5, so that its reciprocal and its root are tame."""
    out = jet.copy()
    out[0] += 2.5
    return out


@pytest.mark.parametrize(("a", "b"), [(0.3, -1.2), (1j, 0.7), (-0.4 + 2j, 1.1 - 0.5j)])
def test_product_and_quotient_of_exponentials(a: complex, b: complex) -> None:
    np.testing.assert_allclose(
        jets.multiply(exponential(a), exponential(b)), exponential(a + b), rtol=1e-12, atol=1e-13
    )
    np.testing.assert_allclose(jets.divide(exponential(a), exponential(b)), exponential(a - b), rtol=1e-12, atol=1e-13)


def test_root_of_an_exponential() -> None:
    np.testing.assert_allclose(jets.square_root(exponential(1.4).real), exponential(0.7).real, rtol=1e-12)


def test_square_root_of_one_plus_x_is_the_binomial_series() -> None:
    jet = np.zeros((LENGTH, 1))
    jet[:2] = 1.0
    wanted = [1.0]
    for k in range(1, LENGTH):
        wanted.append(wanted[-1] * (0.5 - (k - 1)) / k)
    np.testing.assert_allclose(jets.square_root(jet)[:, 0], wanted, rtol=1e-14)


def test_modulus_of_a_turning_phasor_is_constant() -> None:
    squared = jets.norm2(3.0 * exponential(2j))
    np.testing.assert_allclose(squared[0], 9.0, rtol=1e-14)
    np.testing.assert_allclose(squared[1:], 0.0, atol=1e-13)
    assert squared.dtype == np.float64


def test_derivative_of_an_exponential_is_the_rate_times_it() -> None:
    rate = 0.3 - 1.7j
    np.testing.assert_allclose(jets.derivative(exponential(rate)), (rate * exponential(rate))[:-1], rtol=1e-13)


def test_derivative_of_a_jet_over_two_axes() -> None:
    jet = np.arange(24.0).reshape(4, 2, 3)
    np.testing.assert_array_equal(jets.derivative(jet), np.stack([jet[1], 2 * jet[2], 3 * jet[3]]))


def test_the_shorter_jet_decides_the_length() -> None:
    one, other = exponential(0.5), exponential(0.5)[:4]
    for combined in (jets.multiply(one, other), jets.multiply(other, one), jets.divide(one, other)):
        assert combined.shape == (4, len(X))
    np.testing.assert_allclose(jets.multiply(one, other), exponential(1.0)[:4], rtol=1e-13)


@given(real_jets, real_jets)
def test_product_divided_gives_back_the_factor(a: NDArray[np.float64], b: NDArray[np.float64]) -> None:
    b = away_from_zero(b)
    np.testing.assert_allclose(jets.multiply(jets.divide(a, b), b), a, atol=1e-10)


@given(real_jets)
def test_root_squared(a: NDArray[np.float64]) -> None:
    root = jets.square_root(away_from_zero(a))
    np.testing.assert_allclose(jets.multiply(root, root), away_from_zero(a), atol=1e-10)


@given(real_jets, real_jets, real_jets, real_jets)
def test_modulus_and_real_part(
    a: NDArray[np.float64], b: NDArray[np.float64], c: NDArray[np.float64], d: NDArray[np.float64]
) -> None:
    one, other = complexed(a, b), complexed(c, d)
    np.testing.assert_allclose(jets.product_real(one, other), jets.multiply(one, other.conj()).real, atol=1e-12)
    np.testing.assert_allclose(jets.norm2(one), jets.multiply(one, one.conj()).real, atol=1e-12)


@given(real_jets, real_jets)
def test_product_rule(a: NDArray[np.float64], b: NDArray[np.float64]) -> None:
    whole = jets.derivative(jets.multiply(a, b))
    parts = jets.multiply(jets.derivative(a), b) + jets.multiply(a, jets.derivative(b))
    np.testing.assert_allclose(whole, parts, atol=1e-11)


def exact_smoothstep(order: int, length: int, x: Fraction) -> list[Fraction]:
    """Taylor coefficients at x of the integral of (t (1 - t))^order over its whole, in fractions."""
    whole = Fraction(factorial(order) ** 2, factorial(2 * order + 1))
    # (t (1 - t))^order = sum_k C(order, k) (-1)^k t^(order + k), integrated term by term.
    powers = {order + k + 1: Fraction((-1) ** k * comb(order, k), order + k + 1) / whole for k in range(order + 1)}
    return [
        sum((c * comb(p, k) * x ** (p - k) for p, c in powers.items() if p >= k), Fraction(0)) for k in range(length)
    ]


@pytest.mark.parametrize("order", [1, 5, 9, 11])
def test_smoothstep_in_fractions(order: int) -> None:
    nodes, length = 9, 14
    jet = jets.smoothstep(order, nodes, length)
    wanted = np.array(
        [[float(c) for c in exact_smoothstep(order, length, Fraction(i, nodes - 1))] for i in range(nodes)]
    )
    for k in range(length):
        # Round-off relative to the coefficient's largest value over the nodes.
        np.testing.assert_allclose(jet[k], wanted[:, k], rtol=0, atol=1e-10 * max(1e-3, np.abs(wanted[:, k]).max()))


@pytest.mark.parametrize("order", [5, 9, 11])
def test_smoothstep_joins_constants_at_both_ends(order: int) -> None:
    jet = jets.smoothstep(order, 33, order + 3)
    np.testing.assert_array_equal(jet[0, [0, -1]], [0.0, 1.0])
    np.testing.assert_array_equal(jet[1 : order + 1, [0, -1]], 0.0)
    assert np.all(jet[order + 1, [0, -1]] != 0)


@pytest.mark.parametrize("nodes", [2, 33, 176])
def test_smoothstep_is_odd_about_its_middle(nodes: int) -> None:
    jet = jets.smoothstep(9, nodes, 12)
    np.testing.assert_allclose(jet[0] + jet[0, ::-1], 1.0, atol=1e-14)
    for k in range(1, 12):
        sign = (-1.0) ** (k + 1)
        # Relative, down to the smallest values beside the ends: neither end is the worse one.
        half = nodes // 2
        np.testing.assert_allclose(jet[k, :half], sign * jet[k, ::-1][:half], rtol=1e-9)


def test_smoothstep_never_falls_and_is_shared() -> None:
    jet = jets.smoothstep(9, 176, 2)
    assert np.all(np.diff(jet[0]) >= 0)
    assert np.all(jet[1] >= 0)
    assert jet is jets.smoothstep(9, 176, 2)
    with pytest.raises(ValueError, match="read-only"):
        jet[0, 0] = 1.0
