"""Truncated Fourier series as real coordinates, with the tables of alternating time-frequency evaluation."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

__all__ = ["Basis", "basis_for", "resize"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class Basis:
    """Coordinates x of ``z = sum_h Re((x_2h + i x_2h+1) e^{i h theta}) [+ x_last]``.

    The first harmonic stands first, the mean (when there is one) last. With `samples` > 4 K points the
    projection of z^3 is exact, so the equations are Galerkin's and their Jacobian is exact too. An odd
    series changes sign after half a period: half the points do.

    Attributes
    ----------
    order : highest harmonic K.
    mean : whether the mean and even harmonics are in.
    harmonics : float64, shape (H,).
    size : number d of coordinates.
    values : float64, shape (S, d), z at the points from x.
    project : float64, shape (d, S), coordinates from values.
    bilinear : float64, shape (d * d, S + 3): Jacobian from [z^2, k, omega^2, delta omega], sign left out
        (the first S columns are to be multiplied by it).
    """

    order: int
    mean: bool
    harmonics: Floats
    size: int
    values: Floats
    project: Floats
    bilinear: Floats

    def evaluate_at(self, theta: Floats) -> Floats:
        """Rows of values at the angles `theta`; float64, shape (len(theta), d)."""
        return _values(self.harmonics, self.mean, theta)

    def phasors(self, x: Floats) -> Complexes:
        """Complex amplitudes of harmonics 1..K, shape (K, ...), from coordinates of shape (d, ...)."""
        full = np.zeros((max(self.order, 1), *x.shape[1:]), dtype=np.complex128)
        for row, harmonic in enumerate(self.harmonics.astype(int)):
            full[harmonic - 1] = x[2 * row] + 1j * x[2 * row + 1]
        return full

    def coordinates(self, phasors: Complexes, mean: Floats) -> Floats:
        """Coordinates, shape (d, ...), of harmonics of shape (K', ...) and a mean of shape (...)."""
        x = np.zeros((self.size, *mean.shape))
        for row, harmonic in enumerate(self.harmonics.astype(int)):
            if harmonic <= len(phasors):
                x[2 * row] = phasors[harmonic - 1].real
                x[2 * row + 1] = phasors[harmonic - 1].imag
        if self.mean:
            x[-1] = mean
        return x


@cache
def basis_for(order: int, mean: bool) -> Basis:
    """The basis with harmonics up to `order`: all of them and the mean, or the odd ones only."""
    harmonics = np.arange(1, order + 1, 1 if mean else 2, dtype=np.float64)
    size = 2 * len(harmonics) + mean
    points = 4 * order + 2
    theta = np.arange(points if mean else points // 2, dtype=np.float64) * (2 * np.pi / points)
    values = _values(harmonics, mean, theta)
    weight = np.full(size, 2.0)
    if mean:
        weight[-1] = 1.0
    project = weight[:, None] * values.T / len(theta)
    cubic = 3 * np.einsum("is,sj->ijs", project, values)
    table = np.concatenate([cubic, _linear(harmonics, size, mean)], axis=2).reshape(size * size, -1)
    made = (harmonics, values, project, table)
    for array in made:
        array.flags.writeable = False
    return Basis(order, mean, harmonics, size, values, project, table)


def resize(x: Floats, old: Basis, new: Basis) -> Floats:
    """The same series in another basis; what does not fit is dropped, what is new is 0."""
    if old is new:
        return x
    mean = x[-1] if old.mean else np.zeros(x.shape[1:])
    return new.coordinates(old.phasors(x), mean)


def _values(harmonics: Floats, mean: bool, theta: Floats) -> Floats:
    angle = theta[:, None] * harmonics
    pairs = np.stack([np.cos(angle), -np.sin(angle)], axis=2).reshape(len(theta), -1)
    return np.concatenate([pairs, np.ones((len(theta), 1))], axis=1) if mean else pairs


def _linear(harmonics: Floats, size: int, mean: bool) -> Floats:
    """Columns of k, omega^2 and delta omega in the Jacobian: k - h^2 omega^2 + i h delta omega."""
    table = np.zeros((size, size, 3))
    table[:, :, 0] = np.eye(size)
    for row, h in enumerate(harmonics):
        re, im = 2 * row, 2 * row + 1
        table[re, re, 1] = table[im, im, 1] = -h * h
        table[re, im, 2], table[im, re, 2] = -h, h
    return table
