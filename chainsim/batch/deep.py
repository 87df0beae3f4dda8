"""Settings the block kernel could not answer, one by one: more harmonics, full Newton with pivoting."""

from __future__ import annotations

import math
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..compiled import compiled
from ..equations.basis import basis_for
from ..inlined import inlined
from .balance import BRANCH, FORCE, OM2, RATE, ROWS, STIFF, WIDTH, X, start
from .chains import Found, Given, larger, write_multipliers
from .multipliers import MOST, trace_of

__all__ = ["ORDERS", "Tables", "march_deep", "tables_for"]

Floats = NDArray[np.float64]

ORDERS = (9, 17, 33)
"""Highest harmonics tried, one after the other."""

# Newton's steps square: after one this small, relative to the answer, rounding is what is left.
_SMALL = 1e-9
_ROUNDING = 4e-16
_MOST_STEPS = 25
_SAFETY = 2.0


class Tables(NamedTuple):
    """Time-frequency tables of an odd series of H harmonics.

    values : float64, shape (S, 2H), z at the points. project : float64, shape (2H + 2, S), back, with the first
    harmonic left out as the last two. even : float64, shape (4, S), harmonics 2 and 4 of the square.
    fine : float64, shape (MOST, 2H), z at even points of half a turn.
    """

    values: Floats
    project: Floats
    even: Floats
    fine: Floats


@cache
def tables_for(order: int) -> Tables:
    """The tables with odd harmonics up to `order`."""
    basis = basis_for(order, False)
    points = len(basis.values)
    theta = np.arange(points) * (np.pi / points)

    def waves(harmonic: int) -> Floats:
        return np.stack([np.cos(harmonic * theta), -np.sin(harmonic * theta)]) * (2 / points)

    project = np.concatenate([basis.project, waves(order + 2)])
    even = np.concatenate([waves(2), waves(4)])
    fine = np.arange(MOST, dtype=np.float64) * (np.pi / MOST)
    return Tables(basis.values, project, even, basis.evaluate_at(fine))


@inlined
def _solve(matrix: Floats, right: Floats) -> None:
    """Gaussian elimination with row exchange, in place; NaN or infinity where singular."""
    size = len(right)
    for k in range(size):
        best = k
        for i in range(k + 1, size):
            if abs(matrix[i, k]) > abs(matrix[best, k]):
                best = i
        if best != k:
            for j in range(k, size):
                matrix[k, j], matrix[best, j] = matrix[best, j], matrix[k, j]
            right[k], right[best] = right[best], right[k]
        for i in range(k + 1, size):
            factor = matrix[i, k] / matrix[k, k]
            if factor != 0.0:
                for j in range(k + 1, size):
                    matrix[i, j] -= factor * matrix[k, j]
                right[i] -= factor * right[k]
    for k in range(size - 1, -1, -1):
        for j in range(k + 1, size):
            right[k] -= matrix[k, j] * right[j]
        right[k] /= matrix[k, k]


@inlined
def _newton(x: Floats, force: Floats, block: Floats, sign: float, tables: Tables) -> bool:
    """Solve one oscillator from the guess x, in place; whether the corrections died out."""
    size, om2, g, k = len(x), block[OM2], block[RATE], block[STIFF]
    z, matrix, rest = np.empty(len(tables.values)), np.empty((size, size)), np.empty(size)
    for _ in range(_MOST_STEPS):
        for s in range(len(z)):
            z[s] = np.sum(tables.values[s] * x)
        for i in range(size):
            harmonic = i // 2 * 2 + 1
            turn = harmonic * g if i % 2 else -harmonic * g
            linear = k - harmonic * harmonic * om2
            rest[i] = force[i] - linear * x[i] - turn * x[i ^ 1]
            for j in range(size):
                matrix[i, j] = 0.0
            for s in range(len(z)):
                weight = sign * tables.project[i, s] * z[s] * z[s]
                rest[i] -= weight * z[s]
                for j in range(size):
                    matrix[i, j] += 3 * weight * tables.values[s, j]
            matrix[i, i] += linear
            matrix[i, i ^ 1] += turn
        _solve(matrix, rest)
        step, largest = 0.0, 0.0
        for i in range(size):
            x[i] += rest[i]
            step, largest = max(step, abs(rest[i])), max(largest, abs(x[i]))
        if not math.isfinite(step + largest):
            return False
        if step <= _SMALL * largest:
            return True
    return False


@inlined
def _bound(x: Floats, block: Floats, sign: float, tables: Tables, lam: float, errors: Floats) -> None:
    """Error bounds of harmonics 1, 3, .. K + 2 of this oscillator from those of the one before, in place."""
    size, om2, g, k = len(x), block[OM2], block[RATE], block[STIFF]
    left_out, even, mean = np.zeros(2), np.zeros(4), 0.0
    for s in range(len(tables.values)):
        z = np.sum(tables.values[s] * x)
        mean += z * z / len(tables.values)
        for row in range(2):
            left_out[row] += tables.project[size + row, s] * z * z * z
        for row in range(4):
            even[row] += tables.even[row, s] * z * z
    stiff, weight = k + 3 * sign * mean, 1.5 * abs(sign)
    p, q = weight * math.hypot(even[0], even[1]), weight * math.hypot(even[2], even[3])
    errors *= abs(lam)
    last = len(errors) - 1
    errors[last] += abs(sign) * math.hypot(left_out[0], left_out[1])
    for row in range(last, 0, -1):
        harmonic = 2 * row + 1
        if row < last:
            errors[row] += p * errors[row + 1]
        if row < last - 1:
            errors[row] += q * errors[row + 2]
        errors[row] /= math.hypot(stiff - harmonic * harmonic * om2, harmonic * g)
    amplitude = math.hypot(x[0], x[1])
    errors[0] += (p + q) * errors[1] + 2 * q * errors[2] + _ROUNDING * (abs(k) + om2) * amplitude
    if errors[0] > 0:
        errors[0] /= abs(math.hypot(stiff - om2, g) - p)
    errors[1] += (p + q) / math.hypot(stiff - 9 * om2, 3 * g) * errors[0]


@inlined
def _begin(x: Floats, force: Floats, block: Floats, sign: float) -> None:
    for w in range(WIDTH):
        block[OM2 + w], block[RATE + w], block[STIFF + w] = block[OM2], block[RATE], block[STIFF]
        for row in range(6):
            block[FORCE + row * WIDTH + w] = force[row]
    start(block, sign)
    x[:] = 0.0
    for row in range(6):
        x[row] = block[X + row * WIDTH]


@inlined
def _rank(v: float, block: Floats, dip: float) -> int:
    several = block[BRANCH + WIDTH] > 1 and v >= block[BRANCH]
    return (2 if v > dip else 1) if several else 0


@compiled
def march_deep(given: Given, found: Found, lanes: NDArray[np.int64], tables: Tables) -> None:
    """Solve the settings `lanes` on the lower branch; `Found` as by `march_blocks`."""
    size = tables.values.shape[1]
    block = np.zeros(ROWS)
    x, force = np.zeros(size), np.zeros(size)
    back = 1.0 / given.length
    for i in lanes:
        omega, strength = given.omega[i], given.epsilon[i] * given.length
        decay = math.exp(-math.pi * given.delta / omega)
        block[OM2], block[RATE] = omega * omega, given.delta * omega
        force[:] = 0.0
        force[0], force[1] = strength * math.cos(given.phase[i]), strength * math.sin(given.phase[i])
        errors, worst, largest = np.zeros(size // 2 + 1), 0.0, 0.0
        found.largest[i] = 0.0
        for m in range(given.lam.shape[1]):
            lam = given.lam[i, m] if m else 0.0
            block[STIFF] = 1.0 + lam
            if m:
                force[:] = lam * x
            _begin(x, force, block, given.sign)
            if not _newton(x, force, block, given.sign, tables):
                worst = math.nan
                break
            _bound(x, block, given.sign, tables, lam, errors)
            worst = max(worst, errors[0])
            v, kappa = 0.75 * (x[0] * x[0] + x[1] * x[1]), abs(1.0 + lam - omega * omega)
            largest = max(largest, math.hypot(x[0], x[1]))
            dip = (2 * kappa + math.sqrt(max(kappa * kappa - 3 * block[RATE] ** 2, 0.0))) / 3
            found.branch[i, m], found.answers[i, m] = _rank(v, block, dip), np.int8(block[BRANCH + WIDTH])
            found.phasor[i, m] = complex(x[0] * back, x[1] * back)
            found.third[i, m] = complex(x[2] * back, x[3] * back)
            points = np.empty(len(tables.fine))
            for s in range(len(points)):
                points[s] = np.sum(tables.fine[s] * x)
            stiffness = 1.0 + lam - 0.25 * given.delta * given.delta
            trace = trace_of(points, stiffness, given.sign, omega * omega)
            modulus = write_multipliers(found.multipliers[i, m], trace, decay)
            found.largest[i] = larger(found.largest[i], modulus)
        found.estimate[i] = _SAFETY * worst / largest if largest > 0 else worst
