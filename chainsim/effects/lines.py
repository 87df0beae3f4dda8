"""Which frequencies a motion under one or several tones has, and how much of each is in a stretch of samples."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from .effects import Tone

__all__ = ["LineWindow", "Lines"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
Wholes = NDArray[np.int64]

HARMONICS = 7  # Of one tone.
ORDERS = {2: 5, 3: 3, 4: 3}  # Highest |k1| + |k2| + ... of several.
SAME = 1e-9  # Frequencies nearer than this, over the highest, are one.
TURNS = 2  # Least turns that the two nearest lines differ by in a window.
SAMPLES = 32  # A period of one tone.
PER_TURN = 8  # A turn of the highest line of several.


@dataclass(frozen=True)
class Lines:
    """The lines sum_j k_j omega_j of a motion under tones omega_j, the tones themselves first.

    Attributes
    ----------
    index : int64, shape (L, T), the k_j.
    omega : float64, shape (L,), all > 0 and distinct.
    """

    index: Wholes
    omega: Floats

    @classmethod
    def of(cls, tones: tuple[Tone, ...]) -> Lines:
        """The harmonics of one tone, or the mixtures of several."""
        top = ORDERS.get(len(tones), HARMONICS)
        many = [k for k in product(range(-top, top + 1), repeat=len(tones)) if 0 < sum(map(abs, k)) <= top]
        # Tones first, then by the order, which is how fast the lines fall.
        many.sort(key=lambda k: (sum(map(abs, k)), [-each for each in k]))
        index = np.array(many, dtype=np.int64)
        omega = index @ np.array([tone.omega for tone in tones])
        kept: list[int] = []
        for at in np.flatnonzero(omega > SAME * omega.max()):
            if all(abs(omega[at] - omega[other]) > SAME * omega.max() for other in kept):
                kept.append(int(at))
        return cls(index[kept], omega[kept])

    def place(self, *wanted: int) -> int | None:
        """Where the line of these k_j stands, or None."""
        there = np.flatnonzero((self.index == wanted).all(axis=1))
        return int(there[0]) if len(there) else None

    @property
    def window(self) -> LineWindow:
        """Where to sample: a period of one tone, or until the nearest lines of several have drawn apart."""
        if self.index.shape[1] == 1:
            return LineWindow(2 * np.pi / float(self.omega[0]), SAMPLES, self.omega)
        spacing = float(np.diff(np.sort(np.concatenate([[0.0], self.omega]))).min())
        length = 2 * np.pi * TURNS / spacing
        return LineWindow(length, int(np.ceil(length * self.omega.max() / (2 * np.pi) * PER_TURN)), self.omega)


@dataclass(frozen=True)
class LineWindow:
    """`count` samples, `length`/`count` apart, the first one such step after the window begins."""

    length: float
    count: int
    omega: Floats

    def reader(self) -> Floats:
        """Matrix (2 L + 1, count) from samples to the mean and (Re, Im) of every line, by least squares."""
        tau = np.arange(1, self.count + 1) * (self.length / self.count)
        angle = np.outer(tau, self.omega)
        columns = np.stack([np.cos(angle), -np.sin(angle)], axis=2).reshape(self.count, -1)
        columns = np.concatenate([np.ones((self.count, 1)), columns], axis=1)
        # Over whole turns apart the columns are all but orthogonal: the normal equations lose nothing.
        found: Floats = np.linalg.solve(columns.T @ columns, columns.T)
        return found

    def read(self, reader: Floats, begin: float, tip: Floats) -> tuple[Floats, Complexes]:
        """Mean (n,) and amplitudes (L, n), z = Re(amplitude e^{i omega tau}), of `tip` (count, n) from `begin` on."""
        found = reader @ tip
        turned: Complexes = (found[1::2] + 1j * found[2::2]) * np.exp(-1j * self.omega * begin)[:, None]
        return found[0], turned
