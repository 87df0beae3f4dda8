"""The scaled form every steady rung solves: beta in {-1, 0, 1}, oscillators first, settings last."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from .chain import Chain, Setting

__all__ = ["Stages"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

# Below this scaled force the cubic term is lost in rounding whatever the damping, and its square underflows.
FAINT = 1e-140


@dataclass(frozen=True)
class Stages:
    """An open chain as a sequence of forced oscillators ``z'' + delta z' + k z + sign z^3 = f(tau)``.

    z, epsilon and the constant forces are multiplied by `length` = sqrt|beta| (physics: z -> z sqrt|beta|
    removes |beta|), so a beta of -1e12 is no harder than -1.

    Attributes
    ----------
    delta : damping. sign : -1.0, 0.0 or 1.0. length : scaled z over z.
    omega : float64, shape (N,).
    k : float64, shape (n, N), linear stiffness 1 + lam_m (1 for the first of an open chain).
    lam : float64, shape (n, N), the link into each oscillator.
    drive : complex128, shape (N,), scaled epsilon e^{i psi}.
    force : float64, shape (n, N), scaled constant force (preload and bias).
    """

    delta: float
    sign: float
    length: float
    omega: Floats
    k: Floats
    lam: Floats
    drive: Complexes
    force: Floats

    @classmethod
    def of(cls, chain: Chain, setting: Setting) -> Stages:
        """The scaled stages of an open chain (for a ring, `lam[0]` is the closing link)."""
        force = np.array(setting.bias.T, order="C")
        force[0] += setting.preload
        strength = max(float(np.abs(setting.epsilon).max(initial=0.0)), float(np.abs(force).max(initial=0.0)))
        length = math.sqrt(abs(chain.beta))
        faint = 0 < strength * length < FAINT
        if length == 0 or faint:
            length, sign = 1.0, 0.0
        else:
            sign = math.copysign(1.0, chain.beta)
        lam = np.ascontiguousarray(setting.lam.T)
        drive = setting.epsilon * length * np.exp(1j * setting.phase)
        return cls(chain.delta, sign, length, setting.omega, 1.0 + lam, lam, drive, force * length)

    @property
    def n(self) -> int:
        """Number of oscillators."""
        return len(self.k)

    def __len__(self) -> int:
        return len(self.omega)

    @property
    def has_mean(self) -> bool:
        """Whether any constant force acts, so that means and even harmonics appear."""
        return bool(self.force.any())

    def pick(self, index: NDArray[np.intp] | NDArray[np.bool_]) -> Stages:
        """The stages of some settings."""
        return replace(
            self, omega=self.omega[index], k=self.k[:, index], lam=self.lam[:, index],
            drive=self.drive[index], force=self.force[:, index],
        )  # fmt: skip
