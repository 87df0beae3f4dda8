"""How many actuators feel different between two patterns, and patterns chosen so that no two of a set are alike.

What an actuator feels like is one number: 0 flat, else the level in steps of 3 dB (the smallest that are told apart)
and, where phase is part of the wish, the phase in sectors of 30 degrees after that of the first raised actuator. The
distance of two patterns is the number of actuators whose numbers differ.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .scene import TargetPattern

__all__ = ["APART", "Choice", "Distinctness", "choose_distinct", "distinctness", "felt_codes", "weakened"]

Codes = NDArray[np.uint8]
Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

APART = 2
"""Patterns nearer than this are taken for one another; `choose_distinct` keeps them as far apart."""

STEP_DB = 3.0
FAINTEST = 7
SECTORS = 12
# Words compared at a time, so that the pairs of some thousand patterns take megabytes.
BLOCK_WORDS = 1 << 21
SWEEPS = 30
# Prices against a similarity of at most 1: being equal to another, and being next to another.
EQUAL, NEAR = 1e6, 1e3
GAIN = 1e-12


def felt_codes(pattern: TargetPattern) -> Codes:
    """What each actuator feels like; uint8, shape (rows * cols,), see the module's text."""
    amplitude = pattern.amplitude.ravel()
    level = np.abs(amplitude)
    down = -20 * np.log10(np.maximum(level, 1e-6)) / STEP_DB
    steps = np.where(down > FAINTEST - 0.5, 0, 1 + np.rint(np.clip(down, 0, FAINTEST))).astype(np.uint8)
    if not pattern.phase_matters or not steps.any():
        return steps
    first = amplitude[np.flatnonzero(steps)[0]]
    sector = np.rint(np.angle(amplitude * np.conj(first)) / (2 * np.pi / SECTORS)).astype(np.int64) % SECTORS
    return np.where(steps > 0, steps + (FAINTEST + 1) * sector.astype(np.uint8), 0).astype(np.uint8)


@dataclass(frozen=True)
class Distinctness:
    """How far the patterns of a set are apart.

    Attributes
    ----------
    nearest : int64, shape (N,), index of the nearest other pattern (the first of several), -1 in a set of one.
    distance : int64, shape (N,), actuators by which that one differs, -1 in a set of one.
    pairs : int64, shape (dots + 1,), how many pairs have each distance.
    close : pairs nearer than asked, as (first, second, distance), the nearest first; at most `MOST_LISTED`.
    """

    nearest: Ints
    distance: Ints
    pairs: Ints
    close: tuple[tuple[int, int, int], ...]

    MOST_LISTED = 10_000


def distinctness(codes: Codes, closer_than: int = APART) -> Distinctness:
    """Compare every pattern of a set with every other.

    Parameters
    ----------
    codes : uint8, shape (N, dots), of `felt_codes`.
    closer_than : pairs below this distance are listed.
    """
    count, dots = codes.shape
    nearest, distance = np.full(count, -1, np.int64), np.full(count, -1, np.int64)
    pairs = np.zeros(dots + 1, np.int64)
    close = np.empty((0, 3), np.int64)
    for start, apart in _rows_of_distances(codes):
        rows = np.arange(start, start + len(apart))
        later = np.arange(count) > rows[:, None]
        pairs += np.bincount(apart[later], minlength=dots + 1)
        first, second = np.nonzero(later & (apart < closer_than))
        found = np.stack([start + first, second, apart[first, second]], axis=1)
        close = _nearest(np.concatenate([close, found]))
        if count > 1:
            apart[np.arange(len(rows)), rows] = dots + 1
            nearest[rows] = apart.argmin(axis=1)
            distance[rows] = apart.min(axis=1)
    return Distinctness(nearest, distance, pairs, tuple((one, other, apart) for one, other, apart in close.tolist()))


def _nearest(pairs: Ints) -> Ints:
    """The first `Distinctness.MOST_LISTED` by distance; in a set of equal patterns every pair is near."""
    return pairs[np.argsort(pairs[:, 2], kind="stable")[: Distinctness.MOST_LISTED]]


def _rows_of_distances(codes: Codes) -> Iterator[tuple[int, NDArray[np.int32]]]:
    """Distances of some patterns to all, shape (some, N), with the index of the first of them."""
    planes = _planes(codes)
    width = max(1, planes.shape[1] * planes.shape[2])
    step = max(1, BLOCK_WORDS // (width * max(1, len(codes))))
    for start in range(0, len(codes), step):
        part = planes[start : start + step]
        apart = np.zeros((len(part), len(codes)), np.int32)
        for word in range(planes.shape[2]):
            differ = np.zeros(apart.shape, np.uint64)
            for plane in range(planes.shape[1]):
                differ |= part[:, None, plane, word] ^ planes[None, :, plane, word]
            apart += np.bitwise_count(differ)
        yield start, apart


def _planes(codes: Codes) -> NDArray[np.uint64]:
    """The bits of the codes, plane by plane, packed in words: uint64, shape (N, planes, words)."""
    count, dots = codes.shape
    padded = np.zeros((count, -(-dots // 64) * 64), np.uint8)
    padded[:, :dots] = codes
    planes = [
        np.packbits((padded >> bit) & 1, axis=1, bitorder="little").view("<u8")
        for bit in range(int(codes.max(initial=0)).bit_length())
    ]
    return np.stack(planes, axis=1).astype(np.uint64) if planes else np.zeros((count, 1, 1), np.uint64)


@dataclass(frozen=True)
class Choice:
    """The good patterns of one picture, among which `choose_distinct` chooses.

    Attributes
    ----------
    codes : uint8, shape (K, dots), all different, best first.
    similarity : float64, shape (K,).
    """

    codes: Codes
    similarity: Floats


def choose_distinct(choices: Sequence[Choice]) -> Ints:
    """For each picture one of its patterns: first no two equal, then few nearer than `APART`, then most similar.

    Pictures with little to lose give way; then every picture in turn takes the best place there is, alone or by
    moving the one that is in its way, until none can. The result depends on the order of `choices` only, so give
    them in a fixed one.

    Returns
    -------
    int64, shape (len(choices),), an index into each picture's patterns.
    """
    table = _Table(choices)
    for _ in range(SWEEPS):
        moved = [table.settle(index) for index in range(len(choices))]
        moved += [table.trade(index) for index in range(len(choices))]
        if not any(moved):
            break
    return np.array(table.chosen, np.int64)


class _Table:
    """Who has which pattern, and what each pattern would cost a picture."""

    def __init__(self, choices: Sequence[Choice]) -> None:
        alphabet = np.unique(np.concatenate([choice.codes.ravel() for choice in choices] or [np.zeros(1, np.uint8)]))
        self._swaps = [(int(old), int(old) ^ int(new)) for old in alphabet for new in alphabet if new != old]
        self._keys = [[int.from_bytes(code.tobytes(), "little") for code in choice.codes] for choice in choices]
        self._loss = [(choice.similarity.max() - choice.similarity).tolist() for choice in choices]
        self._order = [sorted(range(len(loss)), key=loss.__getitem__) for loss in self._loss]
        self._dots = choices[0].codes.shape[1] if choices else 0
        self._holders: dict[int, set[int]] = {}
        self._near: Counter[int] = Counter()
        self._balls: dict[int, list[int]] = {}
        self.chosen = [0] * len(choices)
        # Who loses most by moving chooses first.
        second = [sorted(loss)[1] if len(loss) > 1 else np.inf for loss in self._loss]
        for index in sorted(range(len(choices)), key=lambda i: (-second[i], i)):
            self._put(index, self._best(index))

    def _ball(self, key: int) -> list[int]:
        """Keys that differ in one actuator."""
        if key not in self._balls:
            raw = key.to_bytes(self._dots, "little")
            self._balls[key] = [
                key ^ (change << 8 * place)
                for place, old in enumerate(raw)
                for was, change in self._swaps
                if was == old
            ]
        return self._balls[key]

    def _put(self, index: int, option: int) -> None:
        self.chosen[index] = option
        key = self._keys[index][option]
        self._holders.setdefault(key, set()).add(index)
        for other in self._ball(key):
            self._near[other] += 1

    def _lift(self, index: int) -> None:
        key = self._keys[index][self.chosen[index]]
        self._holders[key].remove(index)
        for other in self._ball(key):
            self._near[other] -= 1

    def _cost(self, index: int, option: int) -> float:
        key = self._keys[index][option]
        return EQUAL * len(self._holders.get(key, ())) + NEAR * self._near[key] + float(self._loss[index][option])

    def _best(self, index: int) -> int:
        keys, holders, near = self._keys[index], self._holders, self._near
        for option in self._order[index]:
            # No conflict is worth its price, so the first without one is the best.
            if not holders.get(keys[option]) and not near[keys[option]]:
                return option
        return min(self._order[index], key=lambda option: self._cost(index, option))

    def settle(self, index: int) -> bool:
        """Move a picture to the cheapest of its patterns; whether it moved."""
        before = self.chosen[index]
        self._lift(index)
        best = self._best(index)
        gains = self._cost(index, best) < self._cost(index, before) - GAIN
        self._put(index, best if gains else before)
        return gains

    def trade(self, index: int) -> bool:
        """Take a better pattern whose neighbourhood one other picture holds, if that one has a cheap way out."""
        before = self.chosen[index]
        for option in range(len(self._keys[index])):
            if self._loss[index][option] >= self._loss[index][before] - GAIN:
                continue
            key = self._keys[index][option]
            around = [key, *(self._ball(key) if self._near[key] else ())]
            others = set().union(*(self._holders.get(one, ()) for one in around)) - {index}
            if len(others) == 1 and self._traded(index, option, others.pop()):
                return True
        return False

    def _traded(self, index: int, option: int, other: int) -> bool:
        old, others_old = self.chosen[index], self.chosen[other]
        self._lift(index)
        cost = self._cost(index, old)
        self._lift(other)
        cost += self._cost(other, others_old)
        # As above, what the two cost one another is counted once, by the one looked at while the other is there.
        new = self._cost(index, option)
        self._put(index, option)
        way_out = self._best(other)
        new += self._cost(other, way_out)
        if new < cost - GAIN:
            self._put(other, way_out)
            return True
        self._lift(index)
        self._put(index, old)
        self._put(other, others_old)
        return False


def weakened(dots: NDArray[np.bool_]) -> Floats:
    """The same dots with textures in place of an even level: half of them, or all, 6 dB weaker.

    Returns
    -------
    float64, shape (3, rows, cols): every second row, every second column, all.
    """
    row, col = np.indices(dots.shape)
    weak = np.stack([row % 2 == 1, col % 2 == 1, np.ones(dots.shape, np.bool_)])
    return np.where(weak, 0.5, 1.0) * dots
