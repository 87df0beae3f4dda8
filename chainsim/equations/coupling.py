"""Coupling laws: who feeds whom in a chain, how strongly, and what a link does to the oscillator it feeds.

Every oscillator has at most two inputs,

    lam_m (z_{m-1} - back z_m) + other_m (z_{m+stride} - back z_m),

the first from the oscillator before it, the second from the one `stride` places on. This is the form that all kernels
take. A law says which of the inputs are there; rungs ask the law, and branch on no `Closure` and no `CouplingKind`.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import ClassVar, TypeVar

import numpy as np
from numpy.typing import NDArray

__all__ = ["Closure", "CouplingKind", "CouplingLaw", "law_of"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
Wholes = NDArray[np.intp]
Numbers = TypeVar("Numbers", Floats, Complexes)


class Closure(StrEnum):
    """How the end of a chain meets its beginning, and whether a link acts both ways."""

    OPEN = "open"
    RING = "ring"
    BIDIRECTIONAL = "bidirectional"


class CouplingKind(StrEnum):
    """What a link does to the oscillator it feeds: ``lam (z_{m-1} - z_m)`` or, without a back term, ``lam z_{m-1}``."""

    RESISTOR = "resistor"
    AMPLIFIER = "amplifier"


@dataclass(frozen=True)
class CouplingLaw:
    """An open chain: each oscillator is fed by the one before it. Other laws say how they differ.

    A newcomer supplies a class that overrides

    1. `name`, as messages call such a chain;
    2. `closed`, whether the last oscillator feeds the first over ``lam[..., 0]``;
    3. `feed_forward`, whether no oscillator acts on one before it, so that they can be solved in turn;
    4. `stride` and `second`, where the second input comes from and how strong it is;
    5. `layers`, which oscillators can be solved side by side, where that is more than one at a time;
    6. `places`, an order in which those that act on each other stand near each other;
    7. `refusal`, what it cannot be combined with;

    as far as they differ from an open chain's, and a line in `law_of`. All else follows from these.

    Parameters
    ----------
    kind : whether links also pull back (resistor) or only push (amplifier).
    """

    kind: CouplingKind = CouplingKind.RESISTOR

    name: ClassVar[str] = "open chain"
    closed: ClassVar[bool] = False
    feed_forward: ClassVar[bool] = True

    @property
    def stride(self) -> int:
        """From an oscillator to the one that is its second input; 0 where it has none."""
        return 0

    def second(self, lam: Floats, lam_y: Floats | None) -> Floats | None:
        """Strengths of the second inputs.

        Parameters
        ----------
        lam : float64, shape (..., n), the links as in `Setting`.
        lam_y : float64, of the same shape, the links downwards of a grid; None for a chain.

        Returns
        -------
        float64, shape (..., n), 0 where an oscillator has none; None where no oscillator has.
        """
        return None

    def layers(self, n: int) -> list[Wholes]:
        """Oscillators that do not feed each other, in the order in which they can be solved (feed-forward only)."""
        return list(np.arange(n)[:, None])

    def places(self, n: int) -> Wholes:
        """The place of each oscillator in an order that keeps those joined by links near each other; shape (n,)."""
        return np.arange(n)

    @property
    def refusal(self) -> str:
        """Why such a chain cannot be built, or ""."""
        return ""

    @property
    def back(self) -> float:
        """1 where a link pulls the oscillator it feeds towards its source, 0 where it only pushes."""
        return float(self.kind is CouplingKind.RESISTOR)

    @property
    def plain(self) -> bool:
        """Whether it is one chain or ring whose links act one way and pull back."""
        return not self.stride and bool(self.back)

    @property
    def both_ways(self) -> bool:
        """Whether every link also acts on the oscillator before it."""
        return self.stride > 0

    @property
    def in_line(self) -> bool:
        """Whether each oscillator is fed by the one before it alone, and the first by none."""
        return self.feed_forward and not self.stride

    @property
    def forward(self) -> CouplingLaw:
        """The open chain that is left when whatever acts backwards is left out."""
        return CouplingLaw(self.kind)

    def count(self, n: int) -> int:
        """How many links a list of them has in a chain of n."""
        return n if self.closed else n - 1

    def sources(self, n: int) -> tuple[Wholes, Wholes]:
        """The oscillators that feed each one, first and second input; itself where nothing does. Shape (n,) each."""
        each = np.arange(n)
        first = (each - 1) % n if self.closed else np.maximum(each - 1, 0)
        second = each + self.stride
        return first, np.where((second >= 0) & (second < n), second, each)

    def stiffness(self, own: Floats, lam: Floats, lam_y: Floats | None) -> Floats:
        """Each oscillator's `own` stiffness and what the back terms of its links add; float64, shape (..., n)."""
        if not self.back:
            return np.broadcast_to(own, lam.shape)
        other = self.second(lam, lam_y)
        stiffness: Floats = own + lam if other is None else own + lam + other
        return stiffness

    def matrix(self, lam: Floats, lam_y: Floats | None) -> Floats:
        """What the links (N, n) add to the matrix of stiffness; float64, shape (N, n, n).

        Row m is the stiffness that links add to oscillator m, and minus their pulls on it.
        """
        size, n = lam.shape
        matrix, each = np.zeros((size, n, n)), np.arange(n)
        for links, step in ((lam, -1), (self.second(lam, lam_y), self.stride)):
            if links is not None:
                matrix[:, each, (each + step) % n] -= links
                if self.back:
                    matrix[:, each, each] += links
        return matrix

    def pull(self, push: Numbers, z: Numbers, lam: Floats) -> None:
        """Add to `push` what links of strengths `lam`, none of them downwards, do to oscillators at `z` (..., n)."""
        push += lam * (np.roll(z, 1, axis=-1) - self.back * z)
        other = self.second(lam, None)
        if other is not None:
            push += other * (np.roll(z, -self.stride, axis=-1) - self.back * z)


@dataclass(frozen=True)
class _Ring(CouplingLaw):
    """The last oscillator also feeds the first."""

    name: ClassVar[str] = "ring chain"
    closed: ClassVar[bool] = True
    feed_forward: ClassVar[bool] = False

    def places(self, n: int) -> Wholes:
        """Numbered 0, n-1, 1, n-2, ... neighbours are at most two apart."""
        each = np.arange(n)
        return np.where(2 * each < n, 2 * each, 2 * (n - each) - 1)


@dataclass(frozen=True)
class _BothWays(CouplingLaw):
    """Every link also acts on the oscillator before it."""

    name: ClassVar[str] = "bidirectional chain"
    feed_forward: ClassVar[bool] = False

    @property
    def stride(self) -> int:
        return 1

    def second(self, lam: Floats, lam_y: Floats | None) -> Floats | None:
        back = np.zeros_like(lam)
        back[..., :-1] = lam[..., 1:]
        return back

    @property
    def refusal(self) -> str:
        return "" if self.back else "chain.kind: an amplifier acts one way; use closure open or ring"


@dataclass(frozen=True)
class _Grid(CouplingLaw):
    """Rows of `cols`, one after the other: each oscillator is also fed by the one above it."""

    cols: int = 1

    name: ClassVar[str] = "grid"

    @property
    def stride(self) -> int:
        return -self.cols

    def second(self, lam: Floats, lam_y: Floats | None) -> Floats | None:
        return lam_y

    def layers(self, n: int) -> list[Wholes]:
        """Diagonal by diagonal."""
        each = np.arange(n)
        diagonal = each // self.cols + each % self.cols
        order = np.argsort(diagonal, kind="stable")
        return np.split(order, np.flatnonzero(np.diff(diagonal[order])) + 1)

    def sources(self, n: int) -> tuple[Wholes, Wholes]:
        """The first of every row has nothing before it."""
        first, second = super().sources(n)
        return np.where(np.arange(n) % self.cols, first, np.arange(n)), second


_LAWS = {Closure.OPEN: CouplingLaw, Closure.RING: _Ring, Closure.BIDIRECTIONAL: _BothWays}


def law_of(
    closure: Closure | str, kind: CouplingKind | str = CouplingKind.RESISTOR, *, cols: int | None = None
) -> CouplingLaw:
    """The law of a chain, or of a grid.

    Parameters
    ----------
    closure : open, ring or bidirectional.
    kind : of every link.
    cols : oscillators in a row of a grid; None for a chain.

    Raises
    ------
    ValueError
        With the field of `Chain` when there is no such law.
    """
    end, links = Closure(closure), CouplingKind(kind)
    if cols is not None and end is not Closure.OPEN:
        raise ValueError(f"chain.closure: a grid is open, got {end}")
    law = _LAWS[end](links) if cols is None else _Grid(links, cols)
    if law.refusal:
        raise ValueError(law.refusal)
    return law
