"""Views of the scaled chain in the memory layouts that compiled kernels take: settings first, oscillators last."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["Network", "PlainNetwork"]

Floats = NDArray[np.float64]


class PlainNetwork(NamedTuple):
    """N settings of one chain or ring of equal oscillators over resistors.

    Attributes
    ----------
    lam : float64, shape (N, n).
    constant : float64, shape (N, n), forces that do not change.
    drive : float64, shape (N, 2), factors of cosine and sine of the drive's phase on the first oscillator.
    period : float64, shape (N,), 2 pi/omega.
    delta, beta : of every oscillator.
    ring : whether the last feeds the first.
    """

    lam: Floats
    constant: Floats
    drive: Floats
    period: Floats
    delta: float
    beta: float
    ring: bool


class Network(NamedTuple):
    """N settings of n oscillators under any coupling law.

    Attributes
    ----------
    stiffness : float64, shape (N, n), with the back terms of the links.
    lam, other : float64, shape (N, n), links from m - 1 and from m + stride into m.
    stride : of the second inputs.
    constant : float64, shape (N, n), forces that do not change.
    drive : float64, shape (N, 2), factors of cosine and sine of the drive's phase on the first oscillator.
    period : float64, shape (N,), 2 pi/omega.
    delta, beta : float64, shape (n,).
    ring : whether the last feeds the first.
    """

    stiffness: Floats
    lam: Floats
    other: Floats
    stride: int
    constant: Floats
    drive: Floats
    period: Floats
    delta: Floats
    beta: Floats
    ring: bool

    @property
    def plain(self) -> PlainNetwork:
        """The same for the faster kernels, where oscillators are equal and their links plain."""
        return PlainNetwork(
            self.lam, self.constant, self.drive, self.period, float(self.delta[0]), float(self.beta[0]), self.ring
        )
