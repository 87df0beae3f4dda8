"""Periodic orbits by Newton shooting, with their harmonics and multipliers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..equations.scaled_chain import ScaledChain
from ..threads import in_threads
from .period_map import HARMONICS, map_joint, shoot_forward
from .splitting import forcing_table

__all__ = ["FAR_SMALLER", "Orbits", "shoot"]

Floats = NDArray[np.float64]
Lanes = NDArray[np.int64]

_ROUNDS = 14
_CLOSE = 1e-14
_STALL = 1e-9
FAR_SMALLER = 1e-9


@dataclass(frozen=True)
class Orbits:
    """What shooting found for L settings, in the units of `ScaledChain`.

    Attributes
    ----------
    found : bool, shape (L,).
    state : float64, shape (L, 2n), all q then all p at phase 0.
    harmonics : complex128, shape (L, 8, n), the mean and harmonics 1..7; NaN where not found.
    multipliers : complex128, shape (L, n, 2).
    defect : float64, shape (L,), last Newton correction relative to the orbit, worst oscillator.
    turns : total Newton corrections.
    """

    found: NDArray[np.bool_]
    state: Floats
    harmonics: NDArray[np.complex128]
    multipliers: NDArray[np.complex128]
    defect: Floats
    turns: int

    @property
    def stable(self) -> NDArray[np.bool_]:
        """Found, and every multiplier inside the unit circle."""
        inside: NDArray[np.bool_] = np.max(np.abs(self.multipliers), axis=(1, 2)) < 1
        return self.found & inside


def shoot(scaled: ScaledChain, lanes: Lanes, guess: Floats, steps: int) -> Orbits:
    """Solve for the periodic orbits of settings `lanes` near `guess` (shape (L, 2n)) at `steps` per period."""
    return (_shoot_joint if scaled.joint else _shoot_forward)(scaled, lanes, guess, steps)


def _shoot_forward(scaled: ScaledChain, lanes: Lanes, guess: Floats, steps: int) -> Orbits:
    count, n, table = len(lanes), scaled.n, forcing_table(steps)
    state = np.array(guess)
    harmonics = np.full((count, HARMONICS + 1, n), np.nan, dtype=np.complex128)
    tangent = np.full((count, n, 2, 2), np.nan)
    defect, turns = np.full((count, n), np.nan), np.zeros(count, dtype=np.int64)

    def work(part: slice) -> None:
        shoot_forward(
            state[part], lanes[part], scaled.network, table,
            harmonics[part], tangent[part], defect[part], turns[part],
        )  # fmt: skip

    in_threads(work, count, 16)
    worst = np.max(defect, axis=1)
    found = np.isfinite(worst)
    harmonics[~found] = np.nan
    return Orbits(found, state, harmonics, _block_multipliers(tangent), worst, int(turns.sum()))


def _block_multipliers(tangent: Floats) -> NDArray[np.complex128]:
    """Eigenvalues of 2 x 2 blocks, shape (..., 2), from half trace and discriminant."""
    half = 0.5 * (tangent[..., 0, 0] + tangent[..., 1, 1])
    # (a - d)^2/4 + b c, the form of the discriminant without cancellation.
    square = 0.25 * (tangent[..., 0, 0] - tangent[..., 1, 1]) ** 2 + tangent[..., 0, 1] * tangent[..., 1, 0]
    root = np.sqrt(square.astype(np.complex128))
    return np.stack([half + root, half - root], axis=-1)


def _shoot_joint(scaled: ScaledChain, lanes: Lanes, guess: Floats, steps: int) -> Orbits:
    count, n, table = len(lanes), scaled.n, forcing_table(steps)
    state, end, high = np.array(guess), np.empty((count, 2 * n)), np.empty((count, n))
    tangent, defect = np.empty((count, 2 * n, 2 * n)), np.full(count, np.nan)
    harmonics = np.full((count, HARMONICS + 1, n), np.nan, dtype=np.complex128)
    last, live, turns = np.full(count, np.inf), np.arange(count), 0

    def work(part: slice) -> None:
        mine = live[part]
        found = np.empty((len(mine), 2 * n)), np.empty((len(mine), 2 * n, 2 * n)), np.empty((len(mine), n))
        waves = np.empty((len(mine), HARMONICS + 1, n), dtype=np.complex128)
        map_joint(state[mine], lanes[mine], scaled.network, table, *found, waves)
        end[mine], tangent[mine], high[mine] = found
        harmonics[mine] = waves

    for _ in range(_ROUNDS):
        in_threads(work, len(live), 4)
        turns += len(live)
        live, step = _drop_lost(live, state, end, tangent)
        size = _relative(step, _in_view(high[live]))
        done = (size < _CLOSE) | ((size < _STALL) & (size > 0.5 * last[live]))
        defect[live[done]] = size[done]
        go = ~done & (size <= 1)
        last[live] = size
        live, step = live[go], step[go]
        state[live] += step
        if not len(live):
            break
    found = np.isfinite(defect)
    harmonics[~found] = np.nan
    multipliers = np.full((count, n, 2), np.nan, dtype=np.complex128)
    if found.any():
        multipliers[found] = np.linalg.eigvals(tangent[found]).reshape(-1, n, 2)
    return Orbits(found, state, harmonics, multipliers, defect, turns)


def _drop_lost(live: Lanes, state: Floats, end: Floats, tangent: Floats) -> tuple[Lanes, Floats]:
    """The settings whose map stayed finite, and their Newton corrections."""
    finite = np.isfinite(end[live]).all(axis=1) & np.isfinite(tangent[live]).all(axis=(1, 2))
    live = live[finite]
    matrix = np.eye(state.shape[1]) - tangent[live]
    # A multiplier of exactly 1 has no correction; the least-squares one keeps the batch going.
    try:
        step = np.asarray(np.linalg.solve(matrix, (end - state)[live][..., None])[..., 0], dtype=np.float64)
    except np.linalg.LinAlgError:
        step = np.asarray((np.linalg.pinv(matrix) @ (end - state)[live][..., None])[..., 0], dtype=np.float64)
    return live, step


def _in_view(size: Floats) -> Floats:
    """Sizes (L, n) of oscillators that act on each other: one far smaller than the largest is as good as at rest."""
    seen: Floats = np.maximum(size, FAR_SMALLER * np.max(size, axis=1, keepdims=True, initial=0.0))
    return seen


def _relative(step: Floats, size: Floats) -> Floats:
    """Worst ratio of an oscillator's correction to its own size, shape (L,); above 1 only when not finite."""
    n = size.shape[1]
    length = np.hypot(step[:, :n], step[:, n:])
    whole = np.maximum(size, length)
    ratio: Floats = np.max(np.divide(length, whole, out=np.zeros_like(length), where=whole > 0), axis=1)
    return ratio
