"""Taylor jets: a function's value and derivatives at many instants, kept exact through arithmetic.

A jet is an array of shape (K, ...): ``jet[k]`` is the k-th derivative over k!. Differentiating interpolants a
dozen times would drown in round-off; jets do not interpolate.
"""

from __future__ import annotations

from functools import cache
from math import comb
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "derivative", "divide", "multiply", "norm2", "product_real", "smoothstep", "smoothstep_at", "square", "square_root",
]  # fmt: skip

Jet = NDArray[Any]
Floats = NDArray[np.float64]


def multiply(a: Jet, b: Jet) -> Jet:
    """Product of two jets, as long as the shorter one."""
    length = min(len(a), len(b))
    out = np.empty((length, *np.broadcast_shapes(a.shape[1:], b.shape[1:])), dtype=np.result_type(a, b))
    for k in range(length):
        _dot(a[: k + 1], b[k::-1], out[k])
    return out


def square(a: Jet) -> Jet:
    """``multiply(a, a)`` of a real jet, for half of the work."""
    out = np.empty_like(a)
    np.multiply(a[0], a[0], out=out[0])
    for k in range(1, len(a)):
        half = (k + 1) // 2
        _dot(a[:half], a[k : k - half : -1], out[k])
        out[k] *= 2
        if k % 2 == 0:
            out[k] += a[k // 2] ** 2
    return out


def _dot(a: Jet, b: Jet, out: Jet) -> None:
    """Sum over the first axis of ``a * b``, in one pass and without a copy of the products."""
    np.einsum("k...,k...->...", a, b, out=out)


def product_real(a: Jet, b: Jet) -> Jet:
    """Re(a conj(b)) of two complex jets."""
    return multiply(a.real, b.real) + multiply(a.imag, b.imag)


def norm2(a: Jet) -> Jet:
    """|a|^2 of a complex jet."""
    return product_real(a, a)


def derivative(a: Jet) -> Jet:
    """Jet of the derivative, one shorter."""
    orders = np.arange(1, len(a)).reshape((-1,) + (1,) * (a.ndim - 1))
    return a[1:] * orders


def divide(a: Jet, b: Jet) -> Jet:
    """Quotient of two jets; b[0] must not vanish."""
    length = min(len(a), len(b))
    out = np.empty((length, *np.broadcast_shapes(a.shape[1:], b.shape[1:])), dtype=np.result_type(a, b))
    inverse = 1 / b[0]
    out[0] = a[0] * inverse
    for k in range(1, length):
        _dot(out[:k], b[k:0:-1], out[k])
        np.subtract(a[k], out[k], out=out[k])
        out[k] *= inverse
    return out


def square_root(a: Jet) -> Jet:
    """Square root of a jet with a[0] > 0."""
    out = np.empty_like(a)
    out[0] = np.sqrt(a[0])
    inverse = 0.5 / out[0]
    for k in range(1, len(a)):
        half = (k - 1) // 2
        _dot(out[1 : half + 1], out[k - 1 : k - 1 - half : -1], out[k])
        out[k] *= -2
        out[k] += a[k] if k % 2 else a[k] - out[k // 2] ** 2
        out[k] *= inverse
    return out


@cache
def _smoothstep_polynomial(order: int) -> Floats:
    """Coefficients of the C^order smoothstep, lowest power first."""
    coefficients = np.zeros(2 * order + 2)
    for k in range(order + 1):
        coefficients[order + 1 + k] = (-1) ** k * comb(order + k, k) * comb(2 * order + 1, order - k)
    return coefficients


@cache
def smoothstep(order: int, nodes: int, length: int) -> Floats:
    """Jet of the C^order smoothstep on [0, 1], in its own argument.

    Parameters
    ----------
    order : derivatives that vanish at both ends.
    nodes : how many equally spaced instants, both ends included.
    length : how many Taylor coefficients.

    Returns
    -------
    float64, shape (length, nodes), read-only.
    """
    return smoothstep_at(order, np.linspace(0.0, 1.0, nodes), length)


def smoothstep_at(order: int, x: Floats, length: int) -> Floats:
    """As `smoothstep`, at instants `x`, float64, shape (nodes,), in [0, 1]."""
    # Evaluated from the nearer end, s(x) = 1 - s(1 - x): the polynomial cancels badly near 1.
    near = np.minimum(x, 1.0 - x)
    late = x > 0.5
    polynomial = _smoothstep_polynomial(order)
    out = np.empty((length, len(x)))
    for k in range(length):
        value = np.polynomial.polynomial.polyval(near, polynomial)
        mirrored = 1.0 - value if k == 0 else value * (-1.0) ** (k + 1)
        out[k] = np.where(late, mirrored, value)
        polynomial = np.polynomial.polynomial.polyder(polynomial) / (k + 1)
    out.flags.writeable = False
    return out
