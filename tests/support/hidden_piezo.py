"""Biased actuators of which nobody knows what a volt makes, nor their loops and creep."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from chainsim import Device
from planner import FramePlan, Measured

Floats = NDArray[np.float64]


class HiddenPiezo:
    """Actuators held by voltages: what a volt makes, a loop of twenty plays, creep; walked through in small steps."""

    def __init__(
        self, device: Device, seed: int, *, loop: float = 0.1, creep: float = 0.02, noise: float = 0.01
    ) -> None:
        self.device, self.rng = device, np.random.default_rng(seed)
        count = device.rows * device.cols
        self.gain = 1 + 0.03 * self.rng.standard_normal(count)
        self.stiffness = (1 + 0.01 * self.rng.standard_normal(count)) ** 2
        self.loop, self.creep, self.noise = loop, creep, noise
        self.radius = np.linspace(0.0, 0.15, 21)[1:]
        self.play, self.slow = np.zeros((count, 20)), np.zeros((count, 31))
        self.times_s = np.geomspace(0.1, 100.0, 31)
        self.force = np.zeros(count)

    def shows(self, frame: FramePlan) -> Floats:
        """Deflections at three quarters of the time a frame stands, in units of full scale."""
        goal = np.concatenate([state.bias for state in frame.states])
        for part in np.linspace(self.force, goal, 200)[1:]:
            self.play = np.minimum(np.maximum(self.play, part[:, None] - self.radius), part[:, None] + self.radius)
        self.force, hold_s = goal, frame.end_s - frame.settled_s
        seen = self._deflection(self._followed(0.75 * hold_s))
        self.slow = self._followed(hold_s)
        return np.asarray(seen / self.device.full_scale)

    def _followed(self, seconds: float) -> Floats:
        goal = self.force[:, None]
        return goal + (self.slow - goal) * np.exp(-seconds / self.times_s)

    def _deflection(self, slow: Floats) -> Floats:
        # Thirty-one times over three decades: a creep of one a decade is a tenth of each.
        force = self.gain * ((1 - self.loop) * self.force + self.loop * self.play.mean(axis=1))
        force += self.creep * slow.sum(axis=1) / 10
        z = force.copy()
        for _ in range(50):
            z = (force - self.device.beta * z**3) / self.stiffness
        return np.asarray(z)

    def measured(self, felt: Floats, frame: int = 0) -> Measured:
        noise = self.noise * self.rng.standard_normal(len(felt))
        return Measured(frame, self.device.full_scale * (felt + noise), np.full(len(felt), np.nan + 0j))
