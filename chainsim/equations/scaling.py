"""The scaled form every steady rung solves: |beta| <= 1, oscillators first, settings last."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..model.chain import Chain, Closure, CouplingKind, Setting

__all__ = ["FAINT", "Stages", "coupled_stiffness", "length_scale", "second_links"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
Wholes = NDArray[np.intp]

# Below this scaled force the cubic term is lost in rounding whatever the damping, and its square underflows.
FAINT = 1e-140


@dataclass(frozen=True)
class Stages:
    """A chain as forced oscillators ``z_m'' + delta_m z_m' + k_m z_m + sign_m z_m^3 = f_m(tau) + inputs``.

    z, epsilon and the constant forces are multiplied by `length` = sqrt|beta| (physics: z -> z sqrt|beta|
    removes |beta|), so a beta of -1e12 is no harder than -1. The input of oscillator m is
    ``lam_m z_{m-1} + other_m z_{m+stride}``.

    Attributes
    ----------
    delta, sign : float64, shape (n, 1), or (1, 1) when all are alike; damping, and beta over the largest |beta|.
    length : scaled z over z.
    omega : float64, shape (N,).
    k : float64, shape (n, N), linear stiffness with the back terms of the links, 1 + lam_m in a plain chain.
    lam : float64, shape (n, N), the link from m - 1 into m; `lam[0]` closes a ring and is 0 elsewhere.
    drive : complex128, shape (N,), scaled epsilon e^{i psi}.
    force : float64, shape (n, N), scaled constant force (preload and bias).
    other : float64, shape (n, N), or None: the second input; the next oscillator's of a bidirectional chain
        (stride 1), that of the one above in a grid (stride -cols).
    joint : whether an oscillator acts on one before it (ring, bidirectional): to be solved all at once.
    """

    delta: Floats
    sign: Floats
    length: float
    omega: Floats
    k: Floats
    lam: Floats
    drive: Complexes
    force: Floats
    other: Floats | None = None
    stride: int = 0
    joint: bool = False

    @classmethod
    def of(cls, chain: Chain, setting: Setting) -> Stages:
        """The scaled stages of `setting`."""
        force = np.array(setting.bias.T, order="C")
        force[0] += setting.preload
        length = length_scale(chain, setting)
        sign = np.zeros((1, 1)) if length == 0 else (chain.betas / np.abs(chain.betas).max())[:, None]
        length = length or 1.0
        other, stride = second_links(chain, setting)
        return cls(
            chain.deltas[:, None], sign, length, setting.omega,
            np.ascontiguousarray(coupled_stiffness(chain, setting).T), np.ascontiguousarray(setting.lam.T),
            setting.epsilon * length * np.exp(1j * setting.phase), force * length,
            None if other is None else np.ascontiguousarray(other.T), stride, not chain.feed_forward,
        )  # fmt: skip

    @property
    def n(self) -> int:
        """Number of oscillators."""
        return len(self.k)

    def __len__(self) -> int:
        return len(self.omega)

    @cached_property
    def has_mean(self) -> bool:
        """Whether any constant force acts, so that means and even harmonics appear."""
        return bool(self.force.any())

    @cached_property
    def linear(self) -> bool:
        """Whether no oscillator has a cubic term."""
        return not self.sign.any()

    @cached_property
    def softens(self) -> bool:
        """Whether any oscillator has a hilltop."""
        return bool((self.sign < 0).any())

    @property
    def ring(self) -> bool:
        """Whether the last oscillator feeds the first."""
        return self.joint and self.other is None

    @cached_property
    def layers(self) -> list[Wholes]:
        """Oscillators that do not feed each other, in the order in which they can be solved (feed-forward only)."""
        each = np.arange(self.n)
        if self.stride >= 0:
            return list(each[:, None])
        diagonal = each // -self.stride + each % -self.stride
        order = np.argsort(diagonal, kind="stable")
        return np.split(order, np.flatnonzero(np.diff(diagonal[order])) + 1)

    def of_each(self, values: Floats) -> Floats:
        """`delta` or `sign` of every oscillator; float64, shape (n,)."""
        return np.broadcast_to(values[:, 0], (self.n,))

    def inputs(self, m: int) -> list[tuple[int, Floats]]:
        """The oscillators that feed m and the links from them, shape (N,) each."""
        found = [((m - 1) % self.n, self.lam[m])] if m or self.ring else []
        if self.other is not None and 0 <= m + self.stride < self.n:
            found.append((m + self.stride, self.other[m]))
        return found

    def links(self) -> list[tuple[Wholes, Wholes, Floats]]:
        """Every link as (oscillators fed, oscillators that feed them, strengths of shape (len, N))."""
        each = np.arange(self.n)
        fed = each if self.ring else each[1:]
        found = [(fed, (fed - 1) % self.n, self.lam[fed])]
        if self.other is not None:
            second = each[(each + self.stride >= 0) & (each + self.stride < self.n)]
            found.append((second, second + self.stride, self.other[second]))
        return found

    def pick(self, index: NDArray[np.intp] | NDArray[np.bool_]) -> Stages:
        """The stages of some settings."""
        return replace(
            self, omega=self.omega[index], k=self.k[:, index], lam=self.lam[:, index],
            drive=self.drive[index], force=self.force[:, index],
            other=None if self.other is None else self.other[:, index],
        )  # fmt: skip


def length_scale(chain: Chain, setting: Setting) -> float:
    """sqrt of the largest |beta|; 0 where there is no cubic term, or forces too faint for it to be seen."""
    strength = max(float(np.abs(array).max(initial=0.0)) for array in (setting.epsilon, setting.preload, setting.bias))
    length = math.sqrt(float(np.abs(chain.betas).max()))
    return 0.0 if 0 < strength * length < FAINT else length


def second_links(chain: Chain, setting: Setting) -> tuple[Floats | None, int]:
    """Links from oscillator m + stride into m, shape (N, n), and the stride; None and 0 where there are none."""
    if chain.rows > 1:
        return setting.lam_y, -chain.cols
    if chain.closure is not Closure.BIDIRECTIONAL:
        return None, 0
    back = np.zeros_like(setting.lam)
    back[:, :-1] = setting.lam[:, 1:]
    return back, 1


def coupled_stiffness(chain: Chain, setting: Setting) -> Floats:
    """Each oscillator's own stiffness and what the back terms of its links add; float64, shape (N, n)."""
    own: Floats = np.broadcast_to(chain.stiffness, setting.lam.shape)
    if chain.kind is CouplingKind.AMPLIFIER:
        return own
    other, _ = second_links(chain, setting)
    stiffness: Floats = own + setting.lam if other is None else own + setting.lam + other
    return stiffness
