"""What was built (`Chain`) and what is chosen for it (`Setting`), both dimensionless."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .coupling import Closure, CouplingKind, CouplingLaw, law_of

__all__ = ["Chain", "Setting", "Spread"]

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Spread:
    """What differs from oscillator to oscillator, n numbers each.

    delta : damping. beta : cubic term. stiffness : natural frequency squared, over that of f0.
    """

    delta: tuple[float, ...]
    beta: tuple[float, ...]
    stiffness: tuple[float, ...]


@dataclass(frozen=True)
class Chain:
    """A chain or grid of n forced, coupled Duffing oscillators (the paper's Eq. 2, theory.md section 1.1).

    ``z_1'' + delta z_1' + z_1 + beta z_1^3 = epsilon cos(omega tau + psi) + epsilon_0``
    ``z_m'' + delta z_m' + z_m + beta z_m^3 = lam_m (z_{m-1} - z_m) + b_m``

    A ring adds ``lam_1 (z_n - z_1)`` to the first. Bidirectional coupling adds ``lam_{m+1} (z_{m+1} - z_m)`` to all but
    the last. With `rows` > 1 the n oscillators are a grid, row by row: each is fed from its left neighbour over `lam`
    and from the one above over `lam_y`, and the first of the first row is driven. Amplifiers lack the ``- z_m``.

    Parameters
    ----------
    n : number of oscillators, 1 or more.
    delta : damping, >= 0 (Q = 1/delta).
    beta : cubic term; below 0 softens.
    closure : open, ring or bidirectional.
    rows : rows of a grid, which divide n.
    kind : of every link.
    spread : what differs from oscillator to oscillator; `delta` and `beta` are then one number for them all.
        `Chain.of` makes it from lists.

    Attributes
    ----------
    law : who feeds whom and what a link does, as `closure`, `rows` and `kind` say.

    Raises
    ------
    ValueError
        With the field and its value when one is out of range.

    Examples
    --------
    >>> from chainsim import Chain
    >>> Chain(n=6, delta=5.3006e-3, beta=-1.0).cols
    6
    """

    n: int
    delta: float
    beta: float
    closure: Closure = Closure.OPEN
    rows: int = 1
    kind: CouplingKind = CouplingKind.RESISTOR
    spread: Spread | None = None
    law: CouplingLaw = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        if self.n < 1:
            raise ValueError(f"chain.n: expected a whole number >= 1, got {self.n}")
        object.__setattr__(self, "closure", Closure(self.closure))
        object.__setattr__(self, "kind", CouplingKind(self.kind))
        if self.rows < 1 or self.n % self.rows:
            raise ValueError(f"chain.rows: expected a divisor of n = {self.n}, got {self.rows}")
        object.__setattr__(self, "law", law_of(self.closure, self.kind, cols=self.cols if self.rows > 1 else None))
        _in_range("delta", self.deltas, lowest=0.0)
        _in_range("beta", self.betas)
        _in_range("stiffness", self.stiffness)

    @classmethod
    def of(
        cls,
        n: int,
        *,
        delta: ArrayLike,
        beta: ArrayLike,
        stiffness: ArrayLike = 1.0,
        closure: Closure | str = Closure.OPEN,
        rows: int = 1,
        kind: CouplingKind | str = CouplingKind.RESISTOR,
    ) -> Chain:
        """A chain whose `delta`, `beta` and `stiffness` are each one number or n of them.

        Raises
        ------
        ValueError
            As the chain itself, and when a list has another length.
        """
        parts = [_each(name, value, n) for name, value in (("delta", delta), ("beta", beta), ("stiffness", stiffness))]
        alike = all(len(set(part)) <= 1 for part in parts) and set(parts[2]) <= {1.0}
        spread = None if alike else Spread(*parts)
        one = sum(parts[0]) / max(n, 1), max(parts[1], key=abs, default=0.0)
        if alike:
            one = next(iter(parts[0]), 0.0), next(iter(parts[1]), 0.0)
        return cls(n, *one, Closure(closure), rows, CouplingKind(kind), spread)

    @property
    def cols(self) -> int:
        """Oscillators in a row; n unless the chain is a grid."""
        return self.n // self.rows

    @property
    def deltas(self) -> Floats:
        """Damping of each oscillator; float64, shape (n,) or, when all are alike, (1,)."""
        return np.array([self.delta] if self.spread is None else self.spread.delta, dtype=np.float64)

    @property
    def betas(self) -> Floats:
        """Cubic term of each oscillator; float64, shape (n,) or, when all are alike, (1,)."""
        return np.array([self.beta] if self.spread is None else self.spread.beta, dtype=np.float64)

    @property
    def stiffness(self) -> Floats:
        """Natural frequency squared of each oscillator alone; float64, shape (n,) or, when all are 1, (1,)."""
        return np.array([1.0] if self.spread is None else self.spread.stiffness, dtype=np.float64)

    @property
    def feed_forward(self) -> bool:
        """Whether no oscillator acts on one before it, so that they can be solved in turn."""
        return self.law.feed_forward

    @property
    def plain(self) -> bool:
        """Whether it is one open chain or ring of equal oscillators over resistors."""
        return self.spread is None and self.law.plain


def _each(name: str, value: ArrayLike, n: int) -> tuple[float, ...]:
    numbers = np.asarray(value, dtype=np.float64)
    if numbers.ndim > 1 or (numbers.ndim and len(numbers) != n):
        raise ValueError(f"chain.{name}: expected a number or a list of {n}, got shape {numbers.shape}")
    return (float(numbers),) * n if numbers.ndim == 0 else tuple(numbers.tolist())


def _in_range(name: str, values: Floats, lowest: float = -np.inf) -> None:
    bad = ~(np.isfinite(values) & (values >= lowest))
    if bad.any():
        wanted = "a finite number" if lowest == -np.inf else f"a finite number >= {lowest:g}"
        raise ValueError(f"chain.{name}: expected {wanted}, got {values[bad][0]}")


@dataclass(frozen=True)
class Setting:
    """What is chosen for a chain of n oscillators, batched: every field has the leading axis N.

    Attributes
    ----------
    epsilon : float64, shape (N,), drive amplitude on the first oscillator.
    lam : float64, shape (N, n); ``lam[:, m]`` couples oscillator m-1 into oscillator m (bidirectional: also m into
        m-1). ``lam[:, 0]`` closes a ring and is 0 in an open chain; so is the first of every row of a grid.
    omega : float64, shape (N,), drive frequency over f0, > 0.
    preload : float64, shape (N,), the fingertip's constant force epsilon_0 on the first oscillator.
    bias : float64, shape (N, n), constant force b_m on each oscillator.
    phase : float64, shape (N,), psi in radians.
    lam_y : float64, shape (N, n), couples the oscillator above into oscillator m of a grid (0 in the first row);
        None for a chain.

    Build one with `Setting.of`, which broadcasts and checks.

    Examples
    --------
    >>> from chainsim import Chain, Setting
    >>> setting = Setting.of(Chain(n=3, delta=0.005, beta=-1.0), epsilon=[1e-4, 2e-4], lam=0.006, omega=1.0)
    >>> len(setting), setting.lam.shape
    (2, (2, 3))
    """

    epsilon: Floats
    lam: Floats
    omega: Floats
    preload: Floats
    bias: Floats
    phase: Floats
    lam_y: Floats | None = None

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
        lam_y: ArrayLike = 0.0,
    ) -> Setting:
        """Broadcast numbers and arrays to one batch for `chain`.

        `epsilon`, `omega`, `preload` and `phase` are numbers or shape (N,). `lam` is a number, shape (N,)
        with N > 1 only as shape (N, 1), or links of shape (..., n-1) (open) or (..., n) (ring, the first
        is the closing link). `bias` is a number or shape (..., n). In a grid `lam` (to the right) is a number or shape
        (..., rows, cols - 1) and `lam_y` (downwards) a number or shape (..., rows - 1, cols).

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
        downs = _links_down(chain, _checked("lam_y", lam_y))
        biases = _checked("bias", bias)
        if biases.ndim and biases.shape[-1] not in (1, chain.n):
            raise ValueError(f"setting.bias: expected {chain.n} numbers, got {biases.shape[-1]}")
        biases = np.broadcast_to(biases, (*biases.shape[:-1], chain.n))
        listed = (links, downs, biases)
        size = np.broadcast_shapes((1,), *(s.shape for s in scalars), *(each.shape[:-1] for each in listed))
        if len(size) != 1:
            raise ValueError(f"setting: expected one leading axis, got shape {size}")
        epsilon_, omega_, preload_, phase_ = (_frozen(s, size) for s in scalars)
        if np.any(omega_ <= 0):
            raise ValueError(f"setting.omega: expected a number > 0, got {omega_[omega_ <= 0][0]}")
        both = (*size, chain.n)
        down = _frozen(downs, both) if chain.rows > 1 else None
        return cls(epsilon_, _frozen(links, both), omega_, preload_, _frozen(biases, both), phase_, down)

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
            None if self.lam_y is None else self.lam_y[index],
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
    if chain.rows > 1:
        return _in_grid("lam", lam, chain, (chain.rows, chain.cols - 1))
    wanted = chain.law.count(chain.n)
    if lam.ndim == 0 or lam.shape[-1] == 1:
        lam = np.broadcast_to(lam, (*lam.shape[:-1], wanted))
    if lam.shape[-1] != wanted:
        raise ValueError(f"setting.lam: expected 1 or {wanted} numbers, got {lam.shape[-1]}")
    if chain.law.closed:
        return lam
    return np.concatenate([np.zeros((*lam.shape[:-1], 1)), lam], axis=-1)


def _links_down(chain: Chain, lam_y: Floats) -> Floats:
    if chain.rows > 1:
        return _in_grid("lam_y", lam_y, chain, (chain.rows - 1, chain.cols))
    if lam_y.any():
        raise ValueError("setting.lam_y: only a grid (rows > 1) has links downwards")
    return np.zeros(1)


def _in_grid(name: str, lam: Floats, chain: Chain, wanted: tuple[int, int]) -> Floats:
    """Links of a grid as one number per oscillator, shape (..., n); the first column or row has none."""
    if lam.ndim == 0 or lam.shape[-2:] == (1, 1):
        lam = np.broadcast_to(lam[..., None, None] if lam.ndim == 0 else lam, (*lam.shape[:-2], *wanted))
    if lam.shape[-2:] != wanted:
        raise ValueError(f"setting.{name}: expected a number or shape {wanted}, got {lam.shape}")
    full = np.zeros((*lam.shape[:-2], chain.rows, chain.cols))
    full[..., chain.rows - wanted[0] :, chain.cols - wanted[1] :] = lam
    return full.reshape(*lam.shape[:-2], chain.n)


def _frozen(array: Floats, shape: tuple[int, ...]) -> Floats:
    full = np.array(np.broadcast_to(array, shape), dtype=np.float64)
    full.flags.writeable = False
    return full
