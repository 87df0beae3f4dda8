"""The full equations of a whole grid under sampled forces: what `verify` believes."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .errors import ChainError
from .grid_kernels import Actuators, Chains, Stretch, advance_chains, advance_unequal
from .scaled import in_threads
from .splitting import WIDTH

__all__ = ["Escape", "GridError", "GridIntegrator"]

Floats = NDArray[np.float64]

# At a resonance of every stage (Q = 189, lam = 1, six stages) the error is then about 5e-7 of the amplitude.
_LONGEST_STEP = 0.06


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
    """Open chains or rings side by side, advanced block by block under sampled forces.

    Each row of the grid is cut into chains of `chain_length`. Sample k of force and lam holds at the sample's
    instant; between instants both are linear. The first sample ever given sets the instant of the state, in
    which everything is at rest. The result does not depend on how the samples are cut into blocks.

    Parameters
    ----------
    shape : rows and columns of the grid. chain_length : actuators a chain; divides the columns.
    delta, beta, stiffness : of `Chain`, a number or float64 of shape (rows, cols): one for each actuator. The stiffness
        is the natural frequency squared, in units of f0. ring : whether each chain's last actuator feeds its first.
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
    ) -> None:
        if min(shape) < 1 or chain_length < 1 or shape[1] % chain_length:
            raise GridError(f"chain_length: expected a divisor of the {shape[1]} columns, got {chain_length}")
        if not (math.isfinite(dtau) and dtau > 0):
            raise GridError(f"dtau: expected a finite number > 0, got {dtau}")
        self._shape, self._length = (int(shape[0]), int(shape[1])), int(chain_length)
        chains = shape[0] * shape[1] // chain_length
        each = Actuators(*(self._of_each(*one) for one in (("delta", delta), ("beta", beta), ("stiffness", stiffness))))
        if each.delta.min() < 0:
            raise GridError(f"delta: expected numbers >= 0, got {each.delta.min()}")
        unequal = bool(np.ptp(each.delta) or np.ptp(each.beta) or (each.stiffness != 1.0).any())
        self._each = each if unequal else None
        softest = each.beta[each.beta < 0].max(initial=-np.inf)
        limit = 50 / math.sqrt(-softest) if np.isfinite(softest) else 1e9
        fastest = math.sqrt(max(float(each.stiffness.max()), 1.0))
        substeps = math.ceil(dtau * fastest / _LONGEST_STEP)
        first = float(each.delta[0, 0]), float(each.beta[0, 0])
        self._system = Chains(*first, bool(ring), float(dtau), substeps, limit)
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
            stretch = Stretch(part.start, part.stop, skip, self._samples)
            if self._each is None:
                advance_chains(stretch, self._state, forces, links, self._system, z, self._escaped)
            else:
                advance_unequal(stretch, self._state, forces, links, self._system, self._each, z, self._escaped)

        in_threads(work, z.shape[1], WIDTH)
        self._samples += count
        return z.reshape(count, *self._shape)

    def _of_each(self, name: str, value: ArrayLike) -> Floats:
        """One number for each actuator, shape (chains, n)."""
        numbers = np.asarray(value, dtype=np.float64)
        if numbers.ndim and numbers.shape != self._shape:
            raise GridError(f"{name}: expected a number or shape {self._shape}, got {numbers.shape}")
        if not np.isfinite(numbers).all():
            raise GridError(f"{name}: expected finite numbers, got {numbers[~np.isfinite(numbers)].flat[0]}")
        return np.ascontiguousarray(np.broadcast_to(numbers, self._shape)).reshape(-1, self._length)

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
