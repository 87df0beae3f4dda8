"""What was built (`Chain`) and what is chosen for it (`Setting`), both dimensionless."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["Chain", "Closure", "Setting"]

Floats = NDArray[np.float64]


class Closure(StrEnum):
    """How the end of a chain meets its beginning."""

    OPEN = "open"
    RING = "ring"


@dataclass(frozen=True)
class Chain:
    """A chain of n forced, feed-forward coupled Duffing oscillators (the paper's Eq. 2).

    ``z_1'' + delta z_1' + z_1 + beta z_1^3 = epsilon cos(omega tau + psi) + epsilon_0``
    ``z_m'' + delta z_m' + z_m + beta z_m^3 = lam_m (z_{m-1} - z_m) + b_m``

    A ring adds ``lam_1 (z_n - z_1)`` to the first.

    Parameters
    ----------
    n : number of oscillators, 1 or more.
    delta : damping, >= 0 (Q = 1/delta).
    beta : cubic term; below 0 softens.
    closure : open or ring.

    Raises
    ------
    ValueError
        With the field and its value when one is out of range.
    """

    n: int
    delta: float
    beta: float
    closure: Closure = Closure.OPEN

    def __post_init__(self) -> None:
        if self.n < 1:
            raise ValueError(f"chain.n: expected a whole number >= 1, got {self.n}")
        if not (np.isfinite(self.delta) and self.delta >= 0):
            raise ValueError(f"chain.delta: expected a finite number >= 0, got {self.delta}")
        if not np.isfinite(self.beta):
            raise ValueError(f"chain.beta: expected a finite number, got {self.beta}")
        object.__setattr__(self, "closure", Closure(self.closure))


@dataclass(frozen=True)
class Setting:
    """What is chosen for a chain of n oscillators, batched: every field has the leading axis N.

    Attributes
    ----------
    epsilon : float64, shape (N,), drive amplitude on the first oscillator.
    lam : float64, shape (N, n); ``lam[:, m]`` couples oscillator m-1 into oscillator m.
        ``lam[:, 0]`` closes a ring and is 0 in an open chain.
    omega : float64, shape (N,), drive frequency over f0, > 0.
    preload : float64, shape (N,), the fingertip's constant force epsilon_0 on the first oscillator.
    bias : float64, shape (N, n), constant force b_m on each oscillator.
    phase : float64, shape (N,), psi in radians.

    Build one with `Setting.of`, which broadcasts and checks.
    """

    epsilon: Floats
    lam: Floats
    omega: Floats
    preload: Floats
    bias: Floats
    phase: Floats

    @classmethod
    def of(
        cls,
        chain: Chain,
        *,
        epsilon: ArrayLike,
        lam: ArrayLike,
        omega: ArrayLike,
        preload: ArrayLike = 0.0,
        bias: ArrayLike = 0.0,
        phase: ArrayLike = 0.0,
    ) -> Setting:
        """Broadcast numbers and arrays to one batch for `chain`.

        `epsilon`, `omega`, `preload` and `phase` are numbers or shape (N,). `lam` is a number, shape (N,)
        with N > 1 only as shape (N, 1), or links of shape (..., n-1) (open) or (..., n) (ring, the first
        is the closing link). `bias` is a number or shape (..., n).

        Raises
        ------
        ValueError
            When a shape does not fit, a value is not finite, or omega is not > 0.
        """
        scalars = [
            _checked(name, value)
            for name, value in (("epsilon", epsilon), ("omega", omega), ("preload", preload), ("phase", phase))
        ]
        links = _links(chain, _checked("lam", lam))
        biases = _checked("bias", bias)
        if biases.ndim and biases.shape[-1] not in (1, chain.n):
            raise ValueError(f"setting.bias: expected {chain.n} numbers, got {biases.shape[-1]}")
        biases = np.broadcast_to(biases, (*biases.shape[:-1], chain.n))
        size = np.broadcast_shapes((1,), *(s.shape for s in scalars), links.shape[:-1], biases.shape[:-1])
        if len(size) != 1:
            raise ValueError(f"setting: expected one leading axis, got shape {size}")
        epsilon_, omega_, preload_, phase_ = (_frozen(s, size) for s in scalars)
        if np.any(omega_ <= 0):
            raise ValueError(f"setting.omega: expected a number > 0, got {omega_[omega_ <= 0][0]}")
        both = (*size, chain.n)
        return cls(epsilon_, _frozen(links, both), omega_, preload_, _frozen(biases, both), phase_)

    def __len__(self) -> int:
        return len(self.epsilon)

    @property
    def n(self) -> int:
        """Number of oscillators."""
        return int(self.lam.shape[1])

    def __getitem__(self, index: slice | NDArray[np.intp] | NDArray[np.bool_]) -> Setting:
        """The settings picked by a slice, an index array or a mask; the leading axis stays."""
        return Setting(
            self.epsilon[index], self.lam[index], self.omega[index],
            self.preload[index], self.bias[index], self.phase[index],
        )  # fmt: skip

    @property
    def period(self) -> Floats:
        """Drive period 2 pi/omega in tau; float64, shape (N,)."""
        return 2 * np.pi / self.omega


def _checked(name: str, value: ArrayLike) -> Floats:
    array = np.asarray(value, dtype=np.float64)
    if not np.all(np.isfinite(array)):
        raise ValueError(f"setting.{name}: expected finite numbers, got {array[~np.isfinite(array)].flat[0]}")
    return array


def _links(chain: Chain, lam: Floats) -> Floats:
    ring = chain.closure is Closure.RING
    wanted = chain.n if ring else chain.n - 1
    if lam.ndim == 0 or lam.shape[-1] == 1:
        lam = np.broadcast_to(lam, (*lam.shape[:-1], wanted))
    if lam.shape[-1] != wanted:
        raise ValueError(f"setting.lam: expected 1 or {wanted} numbers, got {lam.shape[-1]}")
    if ring:
        return lam
    return np.concatenate([np.zeros((*lam.shape[:-1], 1)), lam], axis=-1)


def _frozen(array: Floats, shape: tuple[int, ...]) -> Floats:
    full = np.array(np.broadcast_to(array, shape), dtype=np.float64)
    full.flags.writeable = False
    return full
