"""Measuring at the controller: what the actuators sense while a window of the stream goes out, fitted row by row."""

from __future__ import annotations

from collections import deque
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from planner import Measured

from .measured import WHOLE_TURN, Measure
from .playout import OutputBlock

__all__ = ["Meter", "Senses"]

Floats = NDArray[np.float64]

FEWEST = 1e-9  # of the sums' largest singular value: below, mean and harmonic are one


class Senses(Protocol):
    """Actuators that sense themselves."""

    def sense(self, block: OutputBlock) -> Floats:
        """Move through what goes out; what is sensed at its samples, dimensionless z, shape (S, rows, cols)."""
        ...

    def read(self, measured: Measured) -> Measured:
        """What is read of a fit: the same with the noise of the reading."""
        ...


class Meter:
    """Fits ``mean + Re(harmonic e^{i phase})`` to what is sensed in the windows it is asked for.

    By least squares, weighted with Hann's window (sine squared, 0 at both ends).

    A window in which the output is held is given up, for what it shows is not the frame.
    """

    def __init__(self, rows: int, cols: int, senses: Senses, *, tapered: bool = True) -> None:
        """`tapered` : False weights all samples of a window alike."""
        self._shape, self._tapered = (rows, cols), tapered
        self._senses = senses
        self.clear()

    def clear(self) -> None:
        """Forget what was asked for."""
        self._asked: deque[_Window] = deque()
        self._done: list[Measured] = []

    def ask(self, measure: Measure) -> None:
        """One more window; they come in the order of the stream."""
        self._asked.append(_Window(measure, *self._shape, self._tapered))

    def take(self, block: OutputBlock) -> None:
        """What goes out."""
        sensed = self._senses.sense(block)
        while self._asked:
            window = self._asked[0]
            if block.live:
                window.take(block.played, sensed)
            elif window.begun:
                self._asked.popleft()
                continue
            if not window.over(block):
                return
            self._asked.popleft()
            if window.whole:
                self._done.append(self._senses.read(window.fitted()))

    def finished(self) -> list[Measured]:
        """What was measured since the last call."""
        done, self._done = self._done, []
        return done


class _Window:
    """Sums over the samples of one window: of 1, cos and -sin of the phase with each other and with what is sensed."""

    def __init__(self, measure: Measure, rows: int, cols: int, tapered: bool) -> None:
        self._measure, self._tapered = measure, tapered
        self._turns = [measure.turns[min(row, len(measure.turns) - 1)] for row in range(rows)]
        self._gram = np.zeros((rows, 3, 3))
        self._load = np.zeros((rows, 3, cols))
        self._tilted = np.zeros((rows, 2, cols))
        self._square = np.zeros((rows, cols))
        self._count = 0

    @property
    def begun(self) -> bool:
        """Whether some of it went out."""
        return self._count > 0

    @property
    def whole(self) -> bool:
        """Whether all of it went out."""
        return self._count == self._measure.samples

    def over(self, block: OutputBlock) -> bool:
        """Whether nothing of it comes after `block`."""
        return block.live and block.played + len(block.volts) >= self._measure.at + self._measure.samples

    def take(self, first: int, sensed: Floats) -> None:
        """What was sensed from sample `first` of the session on, float64, shape (S, rows, cols)."""
        begin, end = self._measure.at, self._measure.at + self._measure.samples
        if end <= first or first + len(sensed) <= begin:
            return
        inside = slice(max(0, begin - first), end - first)
        index = (first + np.arange(len(sensed))[inside]).astype(np.uint64)
        self._count += len(index)
        # Smooth at both ends: what rings at other frequencies is hardly seen.
        place = 2 * np.pi * ((index - np.uint64(begin)).astype(np.float64) + 0.5) / self._measure.samples
        weight = 0.5 - 0.5 * np.cos(place) if self._tapered else np.ones(len(place))
        # Of the weight, over the length of the window.
        slope = np.pi * np.sin(place) if self._tapered else np.zeros(len(place))
        bases: dict[int, Floats] = {}
        for row, turns in enumerate(self._turns):
            if turns not in bases:
                phase = (index * np.uint64(turns)).astype(np.float64) * (2 * np.pi / WHOLE_TURN)
                bases[turns] = np.stack([np.ones(len(index)), np.cos(phase), -np.sin(phase)])
            basis = bases[turns]
            weighted = basis * weight
            self._gram[row] += weighted @ basis.T
            self._load[row] += weighted @ sensed[inside, row]
            self._tilted[row] += (basis[1:] * slope) @ sensed[inside, row]
            self._square[row] += weight @ sensed[inside, row] ** 2

    def fitted(self) -> Measured:
        """Mean and harmonic of every actuator; the mean alone where the window is too short to tell them apart."""
        mean = np.empty(self._load[:, 0].shape)
        harmonic = np.full(mean.shape, np.nan, dtype=np.complex128)
        change, rest = harmonic.copy(), np.zeros(mean.shape)
        for row, turns in enumerate(self._turns):
            mean[row] = self._load[row, 0] / self._gram[row, 0, 0]
            found, _, rank, _ = np.linalg.lstsq(self._gram[row], self._load[row], rcond=FEWEST)
            if turns and rank == 3:
                mean[row], harmonic[row] = found[0], found[1] + 1j * found[2]
                change[row] = -2 * (self._tilted[row, 0] + 1j * self._tilted[row, 1]) / self._gram[row, 0, 0]
            basis = np.stack([mean[row], np.nan_to_num(harmonic[row].real), np.nan_to_num(harmonic[row].imag)])
            left = self._square[row] - np.sum(self._load[row] * basis, axis=0)
            rest[row] = np.maximum(left, 0.0) / self._gram[row, 0, 0]
        return Measured(self._measure.frame, mean.ravel(), harmonic.ravel(), change.ravel(), rest.ravel())
