"""Least movement under the condition that the end is met, by steps of Gauss and Newton.

Every step solves ``min |cost + C d|^2 subject to end + E d = 0`` for slopes C and E by differences, all unknowns
side by side.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .steering import Steering

__all__ = ["Slopes", "Steered", "slopes_at", "steer"]

Floats = NDArray[np.float64]

DIFFERENCE = 1e-5
# How much a missed end counts against movement when a step is judged, and the shares of a step that are tried.
END = 10.0
SHARES = np.array([1.0, 0.5, 0.25, 0.1, 0.03])
# The end is met when it is missed by less than this, relative to the largest amplitude.
MET = 1e-5
# From here on a step that only meets the end is tried too: where the way curves much, the cost's steps go astray.
CLOSE = 0.02
# Keeps a step finite along directions that cost nothing.
RIDGE = 1e-9


@dataclass(frozen=True)
class Steered:
    """Unknowns found, shape (size,), by how much their end is missed, and how many slopes that took."""

    unknowns: Floats
    missed: float
    slopes: int


@dataclass(frozen=True)
class Slopes:
    """End, shape (2 n,), and cost, shape (S,), and their derivatives, shape (..., size)."""

    end: Floats
    cost: Floats
    end_slope: Floats
    cost_slope: Floats

    @property
    def finite(self) -> bool:
        """Whether nothing grew without bound."""
        return bool(np.isfinite(self.end_slope).all() and np.isfinite(self.cost_slope).all())

    def step(self, end: Floats) -> Floats:
        """The change of the unknowns that moves the end by -`end` at the least cost."""
        return self._solved(end, -self.cost_slope.T @ self.cost)

    def least_step(self, end: Floats) -> Floats:
        """The change that does so with the least change of movement: nothing else is improved by it."""
        return self._solved(end, np.zeros(self.end_slope.shape[1]))

    def _solved(self, end: Floats, descent: Floats) -> Floats:
        size, rows = self.end_slope.shape[1], len(self.end)
        system = np.zeros((size + rows, size + rows))
        system[:size, :size] = self.cost_slope.T @ self.cost_slope + RIDGE * np.eye(size)
        system[size:, :size], system[:size, size:] = self.end_slope, self.end_slope.T
        right = np.concatenate([descent, -end])
        try:
            return np.asarray(np.linalg.solve(system, right)[:size])
        except np.linalg.LinAlgError:
            return np.zeros(size)


def slopes_at(task: Steering, unknowns: Floats, softness: float) -> Slopes:
    """Differences along every unknown."""
    width = DIFFERENCE * np.maximum(1.0, np.abs(unknowns))
    end, cost = task.misses(np.vstack([unknowns, unknowns + np.diag(width)]), softness)
    with np.errstate(all="ignore"):
        ends, costs = (end[1:] - end[0]) / width[:, None], (cost[1:] - cost[0]) / width[:, None]
    return Slopes(end[0], cost[0], ends.T, costs.T)


def steer(task: Steering, unknowns: Floats, softness: float, most: int) -> Steered:
    """Steps from `unknowns`, at most so many, until the end is met."""
    missed = np.inf
    for count in range(1, most + 1):
        slopes = slopes_at(task, unknowns, softness)
        if not slopes.finite:
            return Steered(unknowns, np.inf, count)
        missed = float(np.abs(slopes.end).max())
        if missed < MET:
            return Steered(unknowns, missed, count)
        tried = unknowns + SHARES[:, None] * slopes.step(slopes.end)
        if missed < CLOSE:
            tried = np.vstack([tried, unknowns + slopes.least_step(slopes.end)])
        end, cost = task.misses(tried, softness)
        with np.errstate(all="ignore"):
            merit = END * np.abs(end).max(axis=1) + 0.5 * np.sum(cost**2, axis=1)
        best = int(np.argmin(np.where(np.isfinite(merit), merit, np.inf)))
        if not np.isfinite(merit[best]):
            return Steered(unknowns, np.inf, count)
        unknowns, missed = tried[best], float(np.abs(end[best]).max())
        if missed < MET:
            return Steered(unknowns, missed, count)
    return Steered(unknowns, missed, most)
