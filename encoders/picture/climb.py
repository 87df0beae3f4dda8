"""Raising the similarity dot by dot: flips of one dot, of two, and on large grids of many that do not touch."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .similarity import Quadratic, Target, agreement, slopes

__all__ = ["climbed", "nearby", "neighbours", "swept"]

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

GAIN = 1e-9
FLAT = 1e-9
SWEEPS = 40


def climbed(parts: list[Quadratic], dots: Bools, ties: Floats) -> Bools:
    """The pattern reached from `dots` by the best flip of one group, or else of two, until no flip helps.

    Parameters
    ----------
    dots : bool, shape (n,).
    ties : float64, shape (n, groups), the dots that are flipped together.
    """
    small = [Quadratic(part.share, part.linear @ ties, ties.T @ part.matrix @ ties) for part in parts]
    state = (dots @ ties) >= 0.5 * ties.sum(axis=0)
    best = float(_value(small, state))
    while True:
        one = _one_flip(small, state)
        index = int(one.argmax())
        if one[index] > best + GAIN:
            state[index] ^= True
            best = float(one[index])
            continue
        two = _two_flips(small, state)
        flat = int(two.argmax())
        if two.flat[flat] <= best + GAIN:
            done: Bools = (ties @ state) > 0.5
            return done
        for index in divmod(flat, len(state)):
            state[index] ^= True
        best = float(two.flat[flat])


def neighbours(parts: list[Quadratic], dots: Bools, count: int) -> list[tuple[float, Bools]]:
    """A pattern and the most similar of those that differ from it in one or two dots, `count` in all at most."""
    found = [(float(_value(parts, dots)), dots)]
    if count == 1:
        return found
    values = _two_flips(parts, dots)
    np.fill_diagonal(values, _one_flip(parts, dots))
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


def _value(parts: list[Quadratic], state: Bools) -> float:
    raised = state.astype(np.float64)
    halves = [part.share * float(_ratio(part.linear @ raised, raised @ part.matrix @ raised)) for part in parts]
    return sum(halves)


def _one_flip(parts: list[Quadratic], state: Bools) -> Floats:
    raised = state.astype(np.float64)
    sign = 1 - 2 * raised
    total = np.zeros(len(state))
    for part in parts:
        pull = part.matrix @ raised
        top = part.linear @ raised + sign * part.linear
        total += part.share * _ratio(top, raised @ pull + 2 * sign * pull + np.diag(part.matrix))
    return total


def _two_flips(parts: list[Quadratic], state: Bools) -> Floats:
    raised = state.astype(np.float64)
    sign = 1 - 2 * raised
    total = np.zeros((len(state), len(state)))
    for part in parts:
        pull = part.matrix @ raised
        step, bend = sign * part.linear, 2 * sign * pull + np.diag(part.matrix)
        top = part.linear @ raised + step[:, None] + step
        below = raised @ pull + bend[:, None] + bend + 2 * sign[:, None] * sign * part.matrix
        total += part.share * _ratio(top, below)
    np.fill_diagonal(total, -np.inf)
    return total


def _ratio(top: Floats, square: Floats) -> Floats:
    ratio: Floats = np.where(square > FLAT, top / np.sqrt(np.maximum(square, FLAT)), 0.0)
    return ratio


def _gains(target: Target, dots: Floats) -> Floats:
    """Change of the similarity by each single flip, shape (rows, cols)."""
    sign = 1 - 2 * dots
    total = np.zeros_like(dots)
    for part in slopes(target, dots):
        now = _ratio(np.asarray(part.top), np.asarray(part.square))
        flipped = _ratio(part.top + sign * part.linear, part.square + 2 * sign * part.pull + part.diagonal)
        total += part.share * (flipped - now)
    return total


def _highest(values: Floats) -> Floats:
    """Greatest value among each dot's 5 x 5 neighbours."""
    for axis in (0, 1):
        width = [(0, 0), (0, 0)]
        width[axis] = (2, 2)
        padded = np.pad(values, width, constant_values=-np.inf)
        size = values.shape[axis]
        values = np.max([np.take(padded, np.arange(k, k + size), axis=axis) for k in range(5)], axis=0)
    return values
