"""The full equations of a whole grid under sampled forces: what `verify` believes."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..equations.coupling import CouplingLaw, law_of
from ..errors import ChainError
from ..threads import in_threads
from .grid_kernels import WIDTH, Actuators, Chains, Stretch, advance_chains, advance_unequal
from .linked_kernels import Samples, Wiring, advance_linked

__all__ = ["LONGEST_STEP", "Escape", "GridError", "GridIntegrator", "limit_of"]

Floats = NDArray[np.float64]

LONGEST_STEP = 0.06
"""At a resonance of every stage (Q = 189, lam = 1, six stages) the error is then about 5e-7 of the amplitude."""


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


class GridIntegrator:
    """Chains, rings or 2-D grids side by side, advanced block by block under sampled forces.

    Each row of the grid is cut into chains of `chain_length`. Sample k of force and lam holds at the sample's
    instant; between instants both are linear. The first sample ever given sets the instant of the state, in
    which everything is at rest. The result does not depend on how the samples are cut into blocks.

    Parameters
    ----------
    shape : rows and columns of the grid.
    chain_length : actuators a chain; divides the columns.
    delta, beta, stiffness : of `Chain`, a number, or float64 that fits (rows, cols): one for each actuator. The
        stiffness is the natural frequency squared, in units of f0.
    ring : whether each chain's last actuator feeds its first.
    both_ways : whether every link also acts on the actuator before it.
    down : whether the chains of all rows that stand one above another are one 2-D grid, each actuator also fed from the
        one above it.
    kind : of every link; an amplifier pushes without pulling back, one way only.
    dtau : tau from a sample to the next, > 0. Long intervals are subdivided so that integration errors stay
        below 1e-6 of the amplitude at a resonance of Q = 200 and lam <= 1.

    Raises
    ------
    GridError
        With the argument and its value.
    """

    def __init__(
        self,
        *,
        shape: tuple[int, int],
        chain_length: int,
        delta: ArrayLike,
        beta: ArrayLike,
        ring: bool,
        dtau: float,
        stiffness: ArrayLike = 1.0,
        both_ways: bool = False,
        down: bool = False,
        kind: str = "resistor",
    ) -> None:
        if min(shape) < 1 or chain_length < 1 or shape[1] % chain_length:
            raise GridError(f"chain_length: expected a divisor of the {shape[1]} columns, got {chain_length}")
        if not (math.isfinite(dtau) and dtau > 0):
            raise GridError(f"dtau: expected a finite number > 0, got {dtau}")
        self._shape, self._length = (int(shape[0]), int(shape[1])), int(chain_length)
        self._down = down
        self._law = _law(self._length, ring, both_ways, down, kind)
        rows = shape[0] if down else 1
        chains, n = shape[0] * shape[1] // (rows * chain_length), rows * chain_length
        self._state = np.zeros((5, chains, n))
        each = Actuators(*(self._of_each(*one) for one in (("delta", delta), ("beta", beta), ("stiffness", stiffness))))
        if each.delta.min() < 0:
            raise GridError(f"delta: expected numbers >= 0, got {each.delta.min()}")
        unequal = bool(np.ptp(each.delta) or np.ptp(each.beta) or (each.stiffness != 1.0).any())
        self._wiring = None if self._law.plain else Wiring(*self._law.sources(n), self._law.back)
        self._each = each if unequal or self._wiring else None
        softest = each.beta[each.beta < 0].max(initial=-np.inf)
        limit = limit_of(float(softest))
        fastest = math.sqrt(max(float(each.stiffness.max()), 1.0))
        substeps = math.ceil(dtau * fastest / LONGEST_STEP)
        first = float(each.delta[0, 0]), float(each.beta[0, 0])
        self._system = Chains(*first, bool(ring), float(dtau), substeps, limit)
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
        if self._down:
            row, col = divmod(at, self._length)
            return Escape(sample, row, chain * self._length + col)
        row, col = divmod(chain * self._length + at, self._shape[1])
        return Escape(sample, row, col)

    def advance(self, force: Floats, lam: Floats, lam_y: Floats | None = None) -> Floats:
        """Move through the next S samples.

        Parameters
        ----------
        force : float64, shape (S, rows, cols), dimensionless force on each actuator.
        lam : float64, shape (S, rows, cols), or (rows, cols) when the same at all S samples;
            ``lam[..., m]`` couples actuator m-1 into m of its chain. That of a chain's first actuator is the
            closing link of a ring and is ignored in an open chain.
        lam_y : the same for the links downwards, from actuator (row - 1, col) into (row, col), when they are there;
            that of the first row is ignored.

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
        links = self._links("lam", lam, count)
        if not self._system.ring:
            links[:, :, :: self._length] = 0.0
        other = self._others(links, lam_y, count)
        z = np.empty_like(forces)
        skip = self._begin(forces, links, other, z)

        def work(part: slice) -> None:
            stretch = Stretch(part.start, part.stop, skip, self._samples)
            if self._each is None:
                advance_chains(stretch, self._state, forces, links, self._system, z, self._escaped)
            elif self._wiring is None:
                advance_unequal(stretch, self._state, forces, links, self._system, self._each, z, self._escaped)
            else:
                given = Samples(forces, links, other)
                advance_linked(
                    stretch, self._state, given, self._wiring, self._system, self._each, z, self._escaped
                )  # fmt: skip

        in_threads(work, z.shape[1], WIDTH)
        self._samples += count
        return self._in_place(z)

    def _of_each(self, name: str, value: ArrayLike) -> Floats:
        """One number for each actuator, shape (chains, n)."""
        numbers = np.asarray(value, dtype=np.float64)
        if not np.isfinite(numbers).all():
            raise GridError(f"{name}: expected finite numbers, got {numbers[~np.isfinite(numbers)].flat[0]}")
        try:
            whole: Floats = self._by_chain(np.broadcast_to(numbers, self._shape)[None])[0]
        except ValueError as error:
            message = f"{name}: expected a number, or numbers that fit the shape {self._shape}, got {numbers.shape}"
            raise GridError(message) from error
        return whole

    def _begin(self, forces: Floats, links: Floats, other: Floats, z: Floats) -> int:
        """Let the very first sample only set the instant; returns how many samples need no motion."""
        if self._samples or not len(forces):
            return 0
        self._state[2], self._state[3], self._state[4], z[0] = forces[0], links[0], other[0], 0.0
        return 1

    def _links(self, name: str, values: Floats, count: int) -> Floats:
        constant = np.ndim(values) == 2
        return self._chains(name, values, self._shape if constant else (count, *self._shape)).copy()

    def _others(self, links: Floats, lam_y: Floats | None, count: int) -> Floats:
        """The second link of every actuator: from the one after it, or from the one above."""
        if self._down:
            if lam_y is None:
                raise GridError("lam_y: missing; a grid with links downwards needs their strengths")
            downs = self._links("lam_y", lam_y, count)
            downs[:, :, : self._length] = 0.0
            return downs
        if lam_y is not None:
            raise GridError("lam_y: this grid has no links downwards; leave it out")
        other = self._law.second(links, None)
        return np.zeros((1, *links.shape[1:])) if other is None else other

    def _chains(self, name: str, values: Floats, shape: tuple[int, ...]) -> Floats:
        array = np.ascontiguousarray(values, dtype=np.float64)
        if array.shape != shape:
            raise GridError(f"{name}: expected shape {shape}, got {array.shape}")
        if not np.isfinite(array).all():
            raise GridError(f"{name}: expected finite numbers, got {array[~np.isfinite(array)][0]}")
        return self._by_chain(array.reshape(-1, *self._shape))

    def _by_chain(self, array: Floats) -> Floats:
        """(S, rows, cols) as (S, chains, n)."""
        chains, n = self._state.shape[1:]
        if self._down:
            array = array.reshape(len(array), self._shape[0], chains, self._length).swapaxes(1, 2)
        return np.ascontiguousarray(array).reshape(len(array), chains, n)

    def _in_place(self, z: Floats) -> Floats:
        """(S, chains, n) as (S, rows, cols)."""
        if self._down:
            z = z.reshape(len(z), z.shape[1], self._shape[0], self._length).swapaxes(1, 2)
        return np.ascontiguousarray(z).reshape(len(z), *self._shape)


def limit_of(softest: float) -> float:
    """The |z| beyond which a chain has escaped, by its beta nearest to 0 of those below; -inf where there is none."""
    return 50 / math.sqrt(-softest) if math.isfinite(softest) else 1e9


def _law(length: int, ring: bool, both_ways: bool, down: bool, kind: str) -> CouplingLaw:
    """Who feeds whom in each chain, or in the one grid of them all."""
    if (ring or both_ways) and down:
        raise GridError("down: a 2-D grid is open and acts one way; leave ring and both_ways out")
    law = law_of("ring" if ring else "open", kind)
    if both_ways and not (law.plain and law.in_line):
        raise GridError("both_ways: an open chain of resistors only; leave ring and amplifiers out")
    if both_ways:
        return law_of("bidirectional", kind)
    return law_of("open", kind, cols=length) if down else law
