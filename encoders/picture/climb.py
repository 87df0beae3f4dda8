"""Raising the similarity dot by dot: flips of one dot, of two, and on large grids of many that do not touch.

One half of the measure is c.p / sqrt(p.M.p). A flip of dot i adds s = 1 - 2 p_i there, which changes the upper part by
s c_i and the lower one by 2 s (M p)_i + M_ii: all flips of many patterns are judged at once.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from .similarity import SHARES, Target, agreement, matrices, pulls, ratio, squares

__all__ = ["climbed", "nearby", "neighbours", "swept"]

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

GAIN = 1e-9
SWEEPS = 40


def climbed(target: Target, begins: Bools, ties: Floats, free: Bools) -> tuple[Bools, Floats]:
    """The patterns reached by the best flip of one group until none helps, the best of them by flips of two as well.

    Parameters
    ----------
    begins : bool, shape (A, dots).
    ties : float64, shape (dots, groups), the dots that are flipped together.
    free : bool, shape (dots,), those that may be flipped.

    Returns
    -------
    Patterns, bool, shape (A, dots), and their similarity with the first figure of the target, shape (A,).
    """
    small = [ties.T @ matrix @ ties for matrix in matrices(target.shape)]
    linear = [half[0] @ ties for half in target.linear]
    states = (begins @ ties) >= 0.5 * ties.sum(axis=0)
    held = (~free @ ties) > 0
    values = _by_single_flips(linear, small, states, held)
    best = int(values.argmax())
    while _flipped_two(linear, small, states[best], float(values[best]), held):
        values[best] = _by_single_flips(linear, small, states[best : best + 1], held)[0]
    done: Bools = (states @ ties.T) > 0.5
    return done, values


def _by_single_flips(linear: Sequence[Floats], small: Sequence[Floats], states: Bools, held: Bools) -> Floats:
    """Flip in place, what is not held, until nothing helps; the similarity reached."""
    values = np.zeros(len(states))
    live = np.arange(len(states))
    while len(live):
        now, flipped = _single_flips(linear, small, states[live])
        values[live] = now
        flipped[:, held] = -np.inf
        best = flipped.argmax(axis=1)
        helps = flipped[np.arange(len(live)), best] > now + GAIN
        live, best = live[helps], best[helps]
        states[live, best] ^= True
    return values


def _single_flips(linear: Sequence[Floats], small: Sequence[Floats], states: Bools) -> tuple[Floats, Floats]:
    """Similarity of patterns, shape (A,), and after each flip, shape (A, groups)."""
    raised = states.astype(np.float64)
    sign = 1 - 2 * raised
    now, flipped = np.zeros(len(states)), np.zeros(states.shape)
    for share, c, matrix in zip(SHARES, linear, small, strict=True):
        pull = raised @ matrix
        top, square = raised @ c, (raised * pull).sum(axis=1)
        now += share * ratio(top, square)
        flipped += share * ratio(top[:, None] + sign * c, square[:, None] + 2 * sign * pull + np.diag(matrix))
    return now, flipped


def _flipped_two(linear: Sequence[Floats], small: Sequence[Floats], state: Bools, value: float, held: Bools) -> bool:
    """Flip the best two in place when that helps; whether it did."""
    values = _double_flips(linear, small, state)
    values[held] = values[:, held] = -np.inf
    flat = int(values.argmax())
    if values.flat[flat] <= value + GAIN:
        return False
    for index in divmod(flat, len(state)):
        state[index] ^= True
    return True


def _double_flips(linear: Sequence[Floats], small: Sequence[Floats], state: Bools) -> Floats:
    raised = state.astype(np.float64)
    sign = 1 - 2 * raised
    total = np.zeros((len(state), len(state)))
    for share, c, matrix in zip(SHARES, linear, small, strict=True):
        pull = matrix @ raised
        step, bend = sign * c, 2 * sign * pull + np.diag(matrix)
        top = c @ raised + step[:, None] + step
        below = raised @ pull + bend[:, None] + bend + 2 * sign[:, None] * sign * matrix
        total += share * ratio(top, below)
    np.fill_diagonal(total, -np.inf)
    return total


def neighbours(target: Target, dots: Bools, free: Bools, count: int) -> list[tuple[float, Bools]]:
    """A pattern and the most similar of those that differ from it in one or two dots, `count` in all at most."""
    linear, small = [half[0] for half in target.linear], matrices(target.shape)
    now, flipped = _single_flips(linear, small, dots[None])
    found = [(float(now[0]), dots)]
    if count == 1:
        return found
    values = _double_flips(linear, small, dots)
    np.fill_diagonal(values, flipped[0])
    values[~free] = values[:, ~free] = -np.inf
    values[np.tril_indices(len(dots), -1)] = -np.inf
    order = np.argsort(-values, axis=None, kind="stable")[: count - 1]
    order = order[np.isfinite(values.flat[order])]
    one, other = np.divmod(order, len(dots))
    changed = np.repeat(dots[None], len(order), axis=0)
    rows = np.arange(len(order))
    changed[rows, one] ^= True
    changed[rows, other] ^= other != one
    return found + list(zip(values.flat[order].tolist(), changed, strict=True))


def nearby(target: Target, dots: Floats, count: int) -> list[tuple[float, Bools]]:
    """As `neighbours` for a large grid, of which only one dot is flipped; dots of shape (rows, cols), 0 or 1."""
    value, raised = float(agreement(target, dots[None, None])[0, 0]), dots.ravel() > 0.5
    if count == 1:
        return [(value, raised)]
    gains = _gains(target, dots).ravel()
    order = np.argsort(-gains, kind="stable")[: count - 1]
    changed = np.repeat(raised[None], len(order), axis=0)
    changed[np.arange(len(order)), order] ^= True
    return [(value, raised), *zip((value + gains[order]).tolist(), changed, strict=True)]


def swept(target: Target, dots: Floats) -> Floats:
    """As `climbed` for a large grid: in each sweep all helpful flips that are best among their 5 x 5 neighbours.

    Parameters
    ----------
    dots : float64, shape (rows, cols), 0 or 1.
    """
    best = float(agreement(target, dots[None, None])[0, 0])
    for _ in range(SWEEPS):
        gain = _gains(target, dots)
        chosen = (gain > GAIN) & (gain >= _highest(gain))
        for flips in (chosen, chosen & (gain == gain.max())):
            changed = np.where(flips, 1 - dots, dots)
            value = float(agreement(target, changed[None, None])[0, 0])
            if value > best + GAIN:
                dots, best = changed, value
                break
        else:
            break
    return dots


def _gains(target: Target, dots: Floats) -> Floats:
    """Change of the similarity by each single flip, shape (rows, cols)."""
    raised = dots.ravel()
    sign = 1 - 2 * raised
    total = np.zeros_like(raised)
    parts = zip(SHARES, target.linear, pulls(target.shape, raised), squares(target.shape), strict=True)
    for share, (c,), pull, diagonal in parts:
        top, square = c @ raised, raised @ pull
        now = ratio(np.asarray(top), np.asarray(square))
        total += share * (ratio(top + sign * c, square + 2 * sign * pull + diagonal) - now)
    return total.reshape(dots.shape)


def _highest(values: Floats) -> Floats:
    """Greatest value among each dot's 5 x 5 neighbours."""
    for axis in (0, 1):
        width = [(0, 0), (0, 0)]
        width[axis] = (2, 2)
        padded = np.pad(values, width, constant_values=-np.inf)
        size = values.shape[axis]
        values = np.max([np.take(padded, np.arange(k, k + size), axis=axis) for k in range(5)], axis=0)
    return values
