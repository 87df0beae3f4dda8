"""A batch of settings in the form the kernels take: beta in {-1, 0, 1}, forces as constants and factors."""

from __future__ import annotations

import math
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from .chain import Chain, Closure, Setting
from .splitting import System

__all__ = ["Problem", "in_threads", "scaled"]

Floats = NDArray[np.float64]
Lanes = NDArray[np.int64]


@dataclass(frozen=True)
class Problem:
    """N settings of one chain, with z in units of 1/scale.

    Attributes
    ----------
    delta, beta, ring : of the chain; beta is -1, 0 or 1. n : oscillators.
    scale : sqrt|beta| of the chain (1 for a linear one); z here is z there times `scale`.
    lam : float64, shape (N, n). constant : float64, shape (N, n), preload and bias.
    drive : float64, shape (N, 2), factors of cos(omega tau) and sin(omega tau) on the first oscillator.
    period : float64, shape (N,), 2 pi/omega.
    """

    n: int
    delta: float
    beta: float
    ring: bool
    scale: float
    lam: Floats
    constant: Floats
    drive: Floats
    period: Floats

    @property
    def system(self) -> System:
        """What the kernels are given."""
        return System(self.lam, self.constant, self.drive, self.period, self.delta, self.beta, self.ring)

    def __len__(self) -> int:
        return len(self.period)

    @property
    def escape(self) -> float:
        """The |z| beyond which a motion counts as escaped: 50 hilltops, or 1e9 where there is no hilltop."""
        return 50.0 if self.beta < 0 else 1e9 * self.scale

    @property
    def coarse_steps(self) -> Lanes:
        """Steps per period for transients: int64, shape (N,), eight per natural or drive period.

        Amplitude errors are then about 1e-7 at z^2 = 0.01 (chains of six, 300 periods, Q = 160).
        """
        fastest = np.sqrt(np.maximum(1.0 + np.max(self.lam, axis=1), 1.0))
        ratio = np.maximum(fastest * self.period / (2 * np.pi), 1.0)
        doublings = np.ceil(np.log2(ratio) - 0.5).clip(0, 40).astype(np.int64)
        steps: Lanes = 8 * 2**doublings
        return steps


def scaled(chain: Chain, setting: Setting) -> Problem:
    """Scale `setting` of `chain` by z -> z sqrt|beta| (physics: beta = -1e12 is then no harder than -1)."""
    scale = math.sqrt(abs(chain.beta)) or 1.0
    constant = setting.bias * scale
    constant[:, 0] += setting.preload * scale
    strength = setting.epsilon * scale
    drive = np.stack([strength * np.cos(setting.phase), -strength * np.sin(setting.phase)], axis=1)
    return Problem(
        chain.n, float(chain.delta), float(np.sign(chain.beta)), chain.closure is Closure.RING, scale,
        np.array(setting.lam), constant, drive, np.array(setting.period),
    )  # fmt: skip


def in_threads(work: Callable[[slice], None], count: int, block: int) -> None:
    """Call `work` on slices of ``range(count)``, whole blocks each, on every core; kernels release the lock."""
    blocks = -(-count // block)
    workers = min(os.cpu_count() or 1, blocks)
    if workers <= 1:
        work(slice(0, count))
        return
    edges = [min(count, block * (blocks * k // workers)) for k in range(workers + 1)]
    with ThreadPoolExecutor(workers) as pool:
        list(pool.map(work, [slice(a, b) for a, b in pairwise(edges)]))
