"""The one scaled chain that every rung solves or takes its view of: |beta| <= 1, oscillators first, settings last."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from .chain import Chain, Setting
from .coupling import CouplingLaw
from .views import Network

__all__ = ["FAINT", "ScaledChain"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
Wholes = NDArray[np.intp]

# Below this scaled force the cubic term is lost in rounding whatever the damping, and its square underflows.
FAINT = 1e-140


@dataclass(frozen=True)
class ScaledChain:
    """N settings of a chain: ``z_m'' + delta_m z_m' + k_m z_m + sign_m z_m^3 = f_m(tau) + inputs``.

    z, epsilon and the constant forces are multiplied by `length` = sqrt|beta| (theory.md section 1.2: this
    removes |beta|), so a beta of -1e12 is no harder than -1. The inputs of oscillator m are
    ``lam_m z_{m-1} + other_m z_{m+stride}``; the back terms of the links are in k.

    Attributes
    ----------
    law : who feeds whom.
    delta : float64, shape (n, 1), or (1, 1) when all are alike; damping.
    sign : float64, of the same shape; beta over the largest |beta|.
    length : scaled z over z.
    omega : float64, shape (N,).
    k : float64, shape (n, N), linear stiffness with the back terms of the links, 1 + lam_m in a plain chain.
    lam : float64, shape (n, N), the link from m - 1 into m; `lam[0]` closes a ring and is 0 elsewhere.
    drive : complex128, shape (N,), scaled epsilon e^{i psi}.
    force : float64, shape (n, N), scaled constant force (preload and bias).
    other : float64, shape (n, N), or None: the second input, from m + stride of the law.
    plain : whether it is one open chain or ring of equal oscillators over resistors.
    """

    law: CouplingLaw
    delta: Floats
    sign: Floats
    length: float
    omega: Floats
    k: Floats
    lam: Floats
    drive: Complexes
    force: Floats
    other: Floats | None
    plain: bool

    @classmethod
    def of(cls, chain: Chain, setting: Setting) -> ScaledChain:
        """The scaled chain under `setting`."""
        force = np.array(setting.bias.T, order="C")
        force[0] += setting.preload
        length = _length(chain, setting)
        sign = np.zeros((1, 1)) if length == 0 else (chain.betas / np.abs(chain.betas).max())[:, None]
        length = length or 1.0
        other = chain.law.second(setting.lam, setting.lam_y)
        stiffness = chain.law.stiffness(chain.stiffness, setting.lam, setting.lam_y)
        return cls(
            chain.law, chain.deltas[:, None], sign, length, setting.omega,
            np.ascontiguousarray(stiffness.T), np.ascontiguousarray(setting.lam.T),
            setting.epsilon * length * np.exp(1j * setting.phase), force * length,
            None if other is None else np.ascontiguousarray(other.T), chain.plain,
        )  # fmt: skip

    @property
    def n(self) -> int:
        """Number of oscillators."""
        return len(self.k)

    def __len__(self) -> int:
        return len(self.omega)

    @property
    def joint(self) -> bool:
        """Whether an oscillator acts on one before it: to be solved all at once."""
        return not self.law.feed_forward

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

    @cached_property
    def hardens(self) -> bool:
        """Whether the cubic terms harden and so bound every motion."""
        return not (self.linear or self.softens)

    @cached_property
    def layers(self) -> list[Wholes]:
        """Oscillators that do not feed each other, in the order in which they can be solved (feed-forward only)."""
        return self.law.layers(self.n)

    @cached_property
    def network(self) -> Network:
        """The view that the kernels in time take, settings first."""
        drive = np.stack([self.drive.real, -self.drive.imag], axis=1)
        lam = np.ascontiguousarray(self.lam.T)
        return Network(
            np.ascontiguousarray(self.k.T), lam,
            np.zeros_like(lam) if self.other is None else np.ascontiguousarray(self.other.T), self.law.stride,
            np.ascontiguousarray(self.force.T), drive, 2 * np.pi / self.omega,
            np.array(self.of_each(self.delta)), np.array(self.of_each(self.sign)), self.law.closed,
        )  # fmt: skip

    def of_each(self, values: Floats) -> Floats:
        """`delta` or `sign` of every oscillator; float64, shape (n,)."""
        return np.broadcast_to(values[:, 0], (self.n,))

    def inputs(self, m: int) -> list[tuple[int, Floats]]:
        """The oscillators that feed m and the links from them, shape (N,) each."""
        found = [((m - 1) % self.n, self.lam[m])] if m or self.law.closed else []
        if self.other is not None and 0 <= m + self.law.stride < self.n:
            found.append((m + self.law.stride, self.other[m]))
        return found

    def feeds(self, layer: Wholes) -> list[tuple[Floats, Wholes]]:
        """Links (M, N) into the oscillators `layer` and whence they come, < 0 from nowhere (feed-forward only)."""
        found = [(self.lam[layer], layer - 1)]
        if self.other is not None:
            found.append((self.other[layer], layer + self.law.stride))
        return found

    def links(self) -> list[tuple[Wholes, Wholes, Floats]]:
        """Every link as (oscillators fed, oscillators that feed them, strengths of shape (len, N))."""
        each = np.arange(self.n)
        fed = each if self.law.closed else each[1:]
        found = [(fed, (fed - 1) % self.n, self.lam[fed])]
        if self.other is not None:
            stride = self.law.stride
            second = each[(each + stride >= 0) & (each + stride < self.n)]
            found.append((second, second + stride, self.other[second]))
        return found

    def forward(self) -> ScaledChain:
        """The same fed forward alone, whatever acts backwards left out."""
        return replace(self, law=self.law.forward, other=None)

    def pick(self, index: NDArray[np.intp] | NDArray[np.bool_]) -> ScaledChain:
        """The chain under some of the settings."""
        return replace(
            self, omega=self.omega[index], k=self.k[:, index], lam=self.lam[:, index],
            drive=self.drive[index], force=self.force[:, index],
            other=None if self.other is None else self.other[:, index],
        )  # fmt: skip


def _length(chain: Chain, setting: Setting) -> float:
    """sqrt of the largest |beta|; 0 where there is no cubic term, or forces too faint for it to be seen."""
    strength = max(float(np.abs(array).max(initial=0.0)) for array in (setting.epsilon, setting.preload, setting.bias))
    length = math.sqrt(float(np.abs(chain.betas).max()))
    return 0.0 if 0 < strength * length < FAINT else length
