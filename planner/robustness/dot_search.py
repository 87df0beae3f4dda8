"""One chain's raised and flat dots, set so that as many devices as possible keep them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from chainsim import Device

from ..operating_point import OperatingPoint
from ..targets import DotGoal
from .batch_march import BatchParts
from .robust_search import RobustSearch, TradeRow, Trial

__all__ = ["DotSearch"]

Floats = NDArray[np.float64]

# Raised dots are to stay above this, flat ones the contrast below it: then chains that know nothing of each other
# keep dots and contrast together. In units of full scale.
LEAST_RAISED = 0.7
# How far from its limit, in logarithms of amplitude, a dot begins to count as lost: ever nearer to a plain count.
WIDTHS = (0.4, 0.12)
# Without spread no raised dot is to be louder, and no step steeper, than the goal says; what the square of a logarithm
# beyond it costs.
BEYOND = 10.0
# Half of the volts stay free for the ways in and out.
STEADY_SHARE = 0.5
QUIETEST = 1e-9


class DotSearch(RobustSearch):
    """Drive and links under which the share of draws that lose a dot is least.

    A draw keeps its dots when the nearest to its limit is on the right side of it. The share of those that do not has
    no slope; in its place the search makes least a smooth step of that dot's distance, then a steeper one.

    Parameters
    ----------
    trial : its wish has the amplitudes to start from; those from its threshold on are raised dots.
    goal : contrast, and loudest raised dot.
    """

    def __init__(self, device: Device, trial: Trial, goal: DotGoal) -> None:
        super().__init__(device, trial, trial.spread)
        self._goal, self._width = goal, WIDTHS[0]
        self._raised = np.abs(trial.wish.amplitude.T[:, :, None]) >= trial.threshold
        raised = max(LEAST_RAISED, goal.threshold)
        self._limit = np.where(self._raised, raised, raised * 10 ** (-goal.contrast_db / 20))
        self._sign = np.where(self._raised, 1.0, -1.0)

    def fits(self, point: OperatingPoint) -> bool:
        """Whether the device can set it, with volts left to get there."""
        return super().fits(point) and abs(point.epsilon) <= STEADY_SHARE * self.device.epsilon_max

    def cost(self, row: TradeRow) -> float:
        """The share of draws that lose a dot."""
        motion = self._motion(self.judged, row.point)
        margin = self._margin(np.abs(motion.phasor) / self.device.full_scale)
        return float(np.mean((margin.min(axis=(0, 1)) < 0) | np.any(motion.escaped, axis=0)))

    def best(self, start: OperatingPoint) -> OperatingPoint:
        """The setting at the frequency of `start` that the fewest draws lose a dot under, near it."""
        for self._width in WIDTHS:
            start = self.least(start, free_omega=False)
        return start

    def _bounds(self, start: OperatingPoint, free_omega: bool) -> tuple[Floats, Floats]:
        low, top = super()._bounds(start, free_omega)
        top[0] += np.log(STEADY_SHARE)
        return low, top

    def _margin(self, level: Floats) -> Floats:
        """How far dots are on the right side of their limits, in logarithms of amplitude."""
        return np.asarray(self._sign * np.log(np.maximum(level, QUIETEST) / self._limit))

    def _expected(self, x: Floats, like: OperatingPoint) -> tuple[float, Floats]:
        """About the share of fitted draws that lose a dot, and what is beyond the goal; and the gradient."""
        level, slopes = self._levels(self.fitted, x, like)
        margin = self._margin(level)
        worst = np.argmin(margin, axis=0)[None]
        nearest = np.take_along_axis(margin, worst, axis=0)
        rates = self._sign[:, None] * slopes / level[:, None]
        rate = np.take_along_axis(rates, worst[:, None], axis=0)[0]
        lost = 1 / (1 + np.exp(np.clip(nearest / self._width, -50, 50)))
        gradient = -(rate * lost * (1 - lost) / self._width).mean(axis=(1, 2))
        over, rate = self._beyond(x, like)
        return float(lost.mean() + BEYOND * np.sum(over**2)), gradient + 2 * BEYOND * over @ rate

    def _beyond(self, x: Floats, like: OperatingPoint) -> tuple[Floats, Floats]:
        """Logarithms of what is too loud and too steep, shape (2 n - 1,), and their derivatives, (2 n - 1, D)."""
        level, slopes = self._levels(self.exact, x, like)
        log, rate = np.log(level[:, 0, 0]), slopes[:, :, 0, 0] / level[:, 0]
        loud = np.where(self._raised[:, 0, 0], log - np.log(self._goal.loudest), 0.0)
        over = np.concatenate([loud, np.diff(log) - np.log(self._goal.steepest)])
        return np.maximum(over, 0.0), np.concatenate([rate, np.diff(rate, axis=0)])

    def _levels(self, parts: BatchParts, x: Floats, like: OperatingPoint) -> tuple[Floats, Floats]:
        """Amplitudes in units of full scale, shape (n, 1, draws), and their derivatives by `x`."""
        deviation, slopes = self._judged(parts, x, like)
        wanted = np.abs(self.trial.wish.amplitude.T[:, :, None])
        return np.maximum(deviation + wanted, QUIETEST), slopes
