"""The full equations of a whole grid under sampled forces: what `verify` believes."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .compiled import compiled
from .errors import ChainError
from .scaled import in_threads
from .splitting import FLOWS, KICK_TIMES, KICKS, WIDTH, flow

__all__ = ["Escape", "GridError", "GridIntegrator"]

Floats = NDArray[np.float64]
Whole = NDArray[np.int64]

# At a resonance of every stage (Q = 189, lam = 1, six stages) the error is then about 5e-7 of the amplitude.
_LONGEST_STEP = 0.06

# One actuator's share of the workspace, in runs of WIDTH numbers: q, p, force and lam at the last sample,
# their changes to the next, and a run of padding against cache-set conflicts.
_ROW = 7 * WIDTH

_TILE = 64
"""Samples all blocks go through before the next ones, so that a large grid's samples stay in the cache."""


class GridError(ChainError, ValueError):
    """A grid or the samples given to it cannot be integrated.

    Examples: the chain length does not divide the columns; forces of another shape; a NaN among them.
    """


@dataclass(frozen=True)
class Escape:
    """Where |z| first passed the limit: the sample's index since the start, and the actuator."""

    sample: int
    row: int
    col: int


@compiled
def _kick_row(row: Floats, previous: Floats, at: float, c: float, s: float, d: float, b: float, beta: float) -> None:
    # Slices with constant offsets, as in splitting: the form the compiler vectorises.
    for w in range(WIDTH):
        x = row[w]
        force = row[2 * WIDTH + w] + at * row[4 * WIDTH + w]
        lam = row[3 * WIDTH + w] + at * row[5 * WIDTH + w]
        y = row[WIDTH + w] + b * (force + lam * (previous[w] - x) - beta * x * x * x)
        row[w] = c * x + s * y
        row[WIDTH + w] = c * y - d * x


@compiled
def _flow_row(row: Floats, c: float, s: float, d: float) -> None:
    for w in range(WIDTH):
        x, y = row[w], row[WIDTH + w]
        row[w] = c * x + s * y
        row[WIDTH + w] = c * y - d * x


class _System(NamedTuple):
    """What every chain has in common; `limit` is the |z| beyond which it counts as escaped."""

    delta: float
    beta: float
    ring: bool
    dtau: float
    substeps: int
    limit: float


class _Span(NamedTuple):
    """Chains first..last-1, samples of the block from `skip` on; `done` samples came before the block."""

    first: int
    last: int
    skip: int
    done: int


@compiled
def _one_sample(work: Floats, flows: Floats, system: _System) -> None:
    """Move one block from a sample to the next; force and lam are linear between them."""
    last, h = len(work) - _ROW, system.dtau / system.substeps
    for sub in range(system.substeps):
        for at in range(_ROW, len(work), _ROW):
            _flow_row(work[at : at + 2 * WIDTH], flows[0, 0], flows[0, 1], flows[0, 2])
        for k in range(7):
            if system.ring:
                for w in range(WIDTH):
                    work[w] = work[last + w]
            c, s, d = flows[k + 1, 0], flows[k + 1, 1], flows[k + 1, 2]
            part = (sub + KICK_TIMES[k]) / system.substeps
            for at in range(last, 0, -_ROW):
                _kick_row(
                    work[at : at + 6 * WIDTH], work[at - _ROW : at - _ROW + WIDTH],
                    part, c, s, d, KICKS[k] * h, system.beta,
                )  # fmt: skip


@compiled
def _aim(work: Floats, start: int, force: Floats, lam: Floats) -> None:
    """Take the next sample's forces and links as changes from the present ones."""
    for at in range(force.shape[1]):
        row = work[(at + 1) * _ROW : (at + 2) * _ROW]
        for w in range(min(WIDTH, len(force) - start)):
            row[4 * WIDTH + w] = force[start + w, at] - row[2 * WIDTH + w]
            row[5 * WIDTH + w] = lam[start + w, at] - row[3 * WIDTH + w]


@compiled
def _arrive(work: Floats, start: int, force: Floats, lam: Floats) -> None:
    """Make the next sample's forces and links the present ones, without the round-off of their changes."""
    for at in range(force.shape[1]):
        row = work[(at + 1) * _ROW : (at + 2) * _ROW]
        for w in range(min(WIDTH, len(force) - start)):
            row[2 * WIDTH + w], row[3 * WIDTH + w] = force[start + w, at], lam[start + w, at]


@compiled
def _store(work: Floats, start: int, limit: float, sample: int, z: Floats, held: Floats, escaped: Whole) -> None:
    """Write one sample of positions; a chain that passes `limit` keeps the positions it had before."""
    n = z.shape[1]
    for w in range(min(WIDTH, len(z) - start)):
        chain = start + w
        for at in range(n):
            x = work[(at + 1) * _ROW + w]
            if escaped[chain, 0] < 0 and not abs(x) <= limit:
                escaped[chain, 0], escaped[chain, 1] = sample, at
        for at in range(n):
            row = work[(at + 1) * _ROW : (at + 2) * _ROW]
            if escaped[chain, 0] < 0:
                held[chain, at] = row[w]
            else:
                row[w], row[WIDTH + w] = 0.0, 0.0
            z[chain, at] = held[chain, at]


@compiled
def _exchange(work: Floats, start: int, state: Floats, out: bool) -> None:
    """Copy the four parts of the state of a block's chains into the workspace, or out of it."""
    for part in range(4):
        for w in range(min(WIDTH, state.shape[1] - start)):
            for at in range(state.shape[2]):
                here = (at + 1) * _ROW + part * WIDTH + w
                if not out:
                    work[here] = state[part, start + w, at]
                elif part > 0:
                    state[part, start + w, at] = work[here]


@compiled
def _advance(
    span: _Span, state: Floats, force: Floats, lam: Floats, system: _System, z: Floats, escaped: Whole
) -> None:
    """Advance the chains of `span` through every sample after the first `skip`.

    `state` is float64, shape (4, chains, n): q, p, and force and lam at the last sample. `force` and `z` are
    (S, chains, n), `lam` the same or (1, chains, n). `span.first` is a multiple of WIDTH.
    """
    flows = np.empty((8, 3))
    for k in range(8):
        flows[k, 0], flows[k, 1], flows[k, 2] = flow(system.delta, 1.0, FLOWS[k] * system.dtau / system.substeps)
    work = np.zeros((force.shape[2] + 1) * _ROW)
    for tile in range(span.skip, len(force), _TILE):
        for start in range(span.first, span.last, WIDTH):
            _exchange(work, start, state, False)
            for s in range(tile, min(tile + _TILE, len(force))):
                links = lam[s if len(lam) > 1 else 0]
                _aim(work, start, force[s], links)
                _one_sample(work, flows, system)
                _arrive(work, start, force[s], links)
                _store(work, start, system.limit, span.done + s, z[s], state[0], escaped)
            _exchange(work, start, state, True)


class GridIntegrator:
    """Open chains or rings side by side, advanced block by block under sampled forces.

    Each row of the grid is cut into chains of `chain_length`. Sample k of force and lam holds at the sample's
    instant; between instants both are linear. The first sample ever given sets the instant of the state, in
    which everything is at rest. The result does not depend on how the samples are cut into blocks.

    Parameters
    ----------
    shape : rows and columns of the grid. chain_length : actuators a chain; divides the columns.
    delta, beta : of `Chain`. ring : whether each chain's last actuator feeds its first.
    dtau : tau from a sample to the next, > 0. Long intervals are subdivided so that integration errors stay
        below 1e-6 of the amplitude at a resonance of Q = 200 and lam <= 1.

    Raises
    ------
    GridError
        With the argument and its value.
    """

    def __init__(
        self, *, shape: tuple[int, int], chain_length: int, delta: float, beta: float, ring: bool, dtau: float
    ) -> None:
        if min(shape) < 1 or chain_length < 1 or shape[1] % chain_length:
            raise GridError(f"chain_length: expected a divisor of the {shape[1]} columns, got {chain_length}")
        if not (math.isfinite(delta) and delta >= 0 and math.isfinite(beta)):
            raise GridError(f"delta, beta: expected finite numbers and delta >= 0, got {delta}, {beta}")
        if not (math.isfinite(dtau) and dtau > 0):
            raise GridError(f"dtau: expected a finite number > 0, got {dtau}")
        self._shape, self._length = (int(shape[0]), int(shape[1])), int(chain_length)
        limit = 50 / math.sqrt(-beta) if beta < 0 else 1e9
        substeps = math.ceil(dtau / _LONGEST_STEP)
        self._system = _System(float(delta), float(beta), bool(ring), float(dtau), substeps, limit)
        chains = shape[0] * shape[1] // chain_length
        self._state = np.zeros((4, chains, chain_length))
        self._escaped = np.full((chains, 2), -1, dtype=np.int64)
        self._samples = 0

    @property
    def escaped(self) -> Escape | None:
        """Where |z| first passed 50/sqrt|beta| (beta < 0) or 1e9, or None; that chain is frozen from then on."""
        gone = np.flatnonzero(self._escaped[:, 0] >= 0)
        if not len(gone):
            return None
        chain = int(gone[np.argmin(self._escaped[gone, 0])])
        sample, at = (int(value) for value in self._escaped[chain])
        row, col = divmod(chain * self._length + at, self._shape[1])
        return Escape(sample, row, col)

    def advance(self, force: Floats, lam: Floats) -> Floats:
        """Move through the next S samples.

        Parameters
        ----------
        force : float64, shape (S, rows, cols), dimensionless force on each actuator.
        lam : float64, shape (S, rows, cols), or (rows, cols) when the same at all S samples;
            ``lam[..., m]`` couples actuator m-1 into m of its chain. That of a chain's first actuator is the
            closing link of a ring and is ignored in an open chain.

        Returns
        -------
        float64, shape (S, rows, cols): z at the S instants.

        Raises
        ------
        GridError
            When a shape does not fit or a number is not finite.
        """
        count = len(force)
        forces = self._chains("force", force, (count, *self._shape))
        constant = np.ndim(lam) == 2
        links = self._chains("lam", lam, self._shape if constant else (count, *self._shape))
        if not self._system.ring:
            links = links.copy()
            links[:, :, 0] = 0.0
        z = np.empty_like(forces)
        skip = self._begin(forces, links, z)

        def work(part: slice) -> None:
            span = _Span(part.start, part.stop, skip, self._samples)
            _advance(span, self._state, forces, links, self._system, z, self._escaped)

        in_threads(work, z.shape[1], WIDTH)
        self._samples += count
        return z.reshape(count, *self._shape)

    def _begin(self, forces: Floats, links: Floats, z: Floats) -> int:
        """Let the very first sample only set the instant; returns how many samples need no motion."""
        if self._samples or not len(forces):
            return 0
        self._state[2], self._state[3], z[0] = forces[0], links[0], 0.0
        return 1

    def _chains(self, name: str, values: Floats, shape: tuple[int, ...]) -> Floats:
        array = np.ascontiguousarray(values, dtype=np.float64)
        if array.shape != shape:
            raise GridError(f"{name}: expected shape {shape}, got {array.shape}")
        if not np.isfinite(array).all():
            raise GridError(f"{name}: expected finite numbers, got {array[~np.isfinite(array)][0]}")
        return array.reshape(-1, self._state.shape[1], self._length)
