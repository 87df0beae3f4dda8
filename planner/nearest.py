"""Devices that cannot make patterns at will: the nearest they can make, and what they lack."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from chainsim import Closure, Outcome

from .plan import ChainState, Margins, Ramp
from .strategy import Strategy

__all__ = ["Nearest"]

Floats = NDArray[np.float64]

RATIOS = 400


class Nearest(Strategy):
    """With one lam and one drive a chain's small amplitudes are geometric: a_m = a_1 r^m, for any closure.

    (A_m / A_{m-1} = lam / (kappa + lam + i delta omega) is the same at every stage.) So the nearest pattern is
    the best a_1 and r in least squares; r is at most lam / (delta omega), and at most 1 round a ring, which
    would otherwise grow by itself.
    """

    @property
    def ramp_s(self) -> float:
        """Nothing is played, so nothing ramps."""
        return 0.0

    def held(self, target: Floats, started: bool) -> Floats:
        """Just what is wanted, so that the nearest is nearest to the wish."""
        return target

    def states(self, targets: Floats) -> list[ChainState]:
        """The nearest amplitudes as `phasor`; unreachable as soon as any dot is wanted."""
        device = self.device
        steepest = device.coupling.lam.max / (device.delta * device.omega.min)
        if device.coupling.closure is Closure.RING:
            steepest = min(1.0, steepest)
        shapes = np.linspace(0.0, steepest, RATIOS)[:, None] ** np.arange(device.chain_length)
        heights = np.clip(targets @ shapes.T / np.sum(shapes**2, axis=1), 0.0, 1.0 / shapes.max(axis=1))
        misfit = np.sum((heights[:, :, None] * shapes - targets[:, None, :]) ** 2, axis=2)
        best = np.argmin(misfit, axis=1)
        nearest = np.take_along_axis(heights, best[:, None], axis=1) * shapes[best]
        return [self._state(target, near) for target, near in zip(targets, nearest, strict=True)]

    def _state(self, target: Floats, near: Floats) -> ChainState:
        n = self.device.chain_length
        return ChainState(
            target=target,
            epsilon=0j,
            lam=np.zeros(n - 1),
            bias=np.zeros(n),
            omega=1.0,
            phasor=(near * self.device.full_scale).astype(np.complex128),
            mean=np.zeros(n),
            error=float(np.abs(near - target).max()),
            margins=Margins(volts=0.0, well=0.0),
            outcome=Outcome.UNREACHABLE if np.any(target) else Outcome.OK,
        )

    def ramps(self, before: list[ChainState], after: list[ChainState]) -> list[Ramp | None]:
        """None: an unreachable plan is not played."""
        return [None] * len(after)

    def note(self) -> str:
        """What is lacking."""
        shape = "ring" if self.device.coupling.closure is Closure.RING else "chain"
        return (
            f"{self.device.name} cannot make on/off patterns at will: one lam and one drive per {shape} fix the ratio "
            "between neighbours, and it lacks a bias per actuator or a lam per link of an open chain."
        )
