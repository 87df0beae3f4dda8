"""What a piezo remembers of the voltages it was held at: play operators and relaxations."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

__all__ = ["BiasHistory"]

Floats = NDArray[np.float64]

# Relaxation times in seconds, two to a decade: creep as `planner.assumed` has it, from 0.1 s on for three decades.
TIMES_S = 0.1 * 10.0 ** (np.arange(7) / 2)
EACH = 2


@dataclass(frozen=True)
class BiasHistory:
    """Operators of every actuator under the electric force that it has had so far.

    Attributes
    ----------
    radius : float64, shape (R,), of the play operators, in units of force: each keeps its value while the force stays
        within its radius, and is pushed along at that distance (Prandtl and Ishlinskii's hysteresis is their sum).
    play : float64, shape (actuators, R), their values.
    relaxed : float64, shape (actuators, 7), the force followed at the times of creep.
    """

    radius: Floats
    play: Floats
    relaxed: Floats

    @classmethod
    def at_rest(cls, actuators: int, radius: Floats) -> Self:
        """Of a grid that was never held at anything."""
        return cls(radius, np.zeros((actuators, len(radius))), np.zeros((actuators, len(TIMES_S))))

    def after(self, force: Floats, seconds: float) -> Self:
        """After `force`, float64, shape (actuators,), was gone to without turning back, and held for so long."""
        play = self._pushed(force[:, None])
        relaxed = force[:, None] + (self.relaxed - force[:, None]) * np.exp(-seconds / TIMES_S)
        return replace(self, play=play, relaxed=relaxed)

    def terms(self, force: Floats, seconds: float) -> Floats:
        """What the force is made of `seconds` after it was gone to: itself, the plays, and a creep of 1 a decade.

        Returns
        -------
        float64, shape (actuators, R + 2).
        """
        held = self.after(force, seconds)
        return np.column_stack([force, held.play, held.relaxed.sum(axis=1) / EACH])

    def inverse(self, wanted: Floats, numbers: Floats, seconds: float) -> Floats:
        """The force whose `terms` times `numbers` are what is wanted.

        They rise with the force, in straight pieces that meet where a play begins to be pushed.

        Parameters
        ----------
        wanted : float64, shape (actuators,).
        numbers : float64, shape (actuators, R + 2).
        """
        ends = np.concatenate([self.play - self.radius, self.play + self.radius], axis=1)
        far = 4 * (np.abs(ends).max(axis=1) + np.abs(wanted))[:, None]
        nodes = np.sort(np.concatenate([-far, ends, far], axis=1), axis=1)
        made = np.stack([np.sum(self.terms(node, seconds) * numbers, axis=1) for node in nodes.T], axis=1)
        rising = np.all(np.diff(made, axis=1) >= 0, axis=1)
        found = [np.interp(*row) if fine else row[0] for fine, *row in zip(rising, wanted, made, nodes, strict=True)]
        return np.array(found)

    def _pushed(self, force: Floats) -> Floats:
        return np.asarray(np.clip(self.play, force - self.radius, force + self.radius))
