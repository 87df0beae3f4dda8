"""A batch of settings in the form the kernels take: |beta| <= 1, forces as constants and factors."""

from __future__ import annotations

import math
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ..equations.scaling import coupled_stiffness, length_scale, second_links
from ..model.chain import Chain, Closure, Setting
from .network import Network
from .splitting import System

__all__ = ["Problem", "in_threads", "scaled"]

Floats = NDArray[np.float64]
Lanes = NDArray[np.int64]


@dataclass(frozen=True)
class Problem:
    """N settings of one chain, with z in units of 1/scale.

    Attributes
    ----------
    n : oscillators. plain : one chain or ring of equal oscillators. joint : whether one acts on one before it.
    scale : square root of the largest |beta| (1 for a linear chain); z here is z there times `scale`.
    network : the settings and the oscillators, all of them scaled.
    """

    n: int
    plain: bool
    joint: bool
    scale: float
    network: Network

    @property
    def system(self) -> System:
        """A plain chain as the faster kernels of `splitting` take it."""
        it = self.network
        return System(it.lam, it.constant, it.drive, it.period, float(it.delta[0]), float(it.beta[0]), it.ring)

    @property
    def linear(self) -> bool:
        """Whether no oscillator has a cubic term."""
        return not self.network.beta.any()

    @property
    def bounded(self) -> bool:
        """Whether the cubic terms harden and so bound every motion."""
        return not self.linear and bool((self.network.beta >= 0).all())

    @property
    def period(self) -> Floats:
        """2 pi/omega; float64, shape (N,)."""
        return self.network.period

    def __len__(self) -> int:
        return len(self.period)

    @property
    def escape(self) -> float:
        """The |z| beyond which a motion counts as escaped: 50 of the farthest hilltop, or 1e9 where there is none."""
        softest = np.max(self.network.beta, initial=-np.inf, where=self.network.beta < 0)
        return 50.0 / math.sqrt(-softest) if np.isfinite(softest) else 1e9 * self.scale

    @property
    def coarse_steps(self) -> Lanes:
        """Steps per period for transients: int64, shape (N,), eight per natural or drive period.

        Amplitude errors are then about 1e-7 at z^2 = 0.01 (chains of six, 300 periods, Q = 160).
        """
        return self.steps_at(np.zeros(len(self)))

    def steps_at(self, peak: Floats) -> Lanes:
        """The same for motions that reach z^2 + p^2 = `peak`, shape (N,): where beta > 0 they swing faster.

        Then z^4/4 is at most p^2/2, and the frequency squared is k + 3/4 z^2.
        """
        hardening = 0.75 * max(float(np.max(self.network.beta)), 0.0) * np.sqrt(2 * np.where(peak < 1e30, peak, 0.0))
        fastest = np.sqrt(np.maximum(np.max(self.network.stiffness, axis=1) + hardening, 1.0))
        # The composition also steps backwards, where a strong damping grows.
        fastest = np.maximum(fastest, 0.5 * float(np.max(self.network.delta)))
        ratio = np.maximum(fastest * self.period / (2 * np.pi), 1.0)
        doublings = np.ceil(np.log2(ratio) - 0.5).clip(0, 40).astype(np.int64)
        steps: Lanes = 8 * 2**doublings
        return steps


def scaled(chain: Chain, setting: Setting) -> Problem:
    """Scale `setting` of `chain` by z -> z sqrt|beta| (physics: beta = -1e12 is then no harder than -1)."""
    length = length_scale(chain, setting)
    scale = length or 1.0
    beta = chain.betas / np.abs(chain.betas).max() if length else np.zeros(1)
    constant = setting.bias * scale
    constant[:, 0] += setting.preload * scale
    strength = setting.epsilon * scale
    drive = np.stack([strength * np.cos(setting.phase), -strength * np.sin(setting.phase)], axis=1)
    other, stride = second_links(chain, setting)
    network = Network(
        np.array(coupled_stiffness(chain, setting)), np.array(setting.lam),
        np.zeros_like(setting.lam) if other is None else np.array(other), stride,
        constant, drive, np.array(setting.period),
        np.array(np.broadcast_to(chain.deltas, (chain.n,))), np.array(np.broadcast_to(beta, (chain.n,))),
        chain.closure is Closure.RING,
    )  # fmt: skip
    return Problem(chain.n, chain.plain, not chain.feed_forward, scale, network)


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
